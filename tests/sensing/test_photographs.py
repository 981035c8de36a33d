"""Photographs from files, the laser's own light in them, and the folder's conventions."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.sensing.stripes.photographs import Photograph, dark_frame_of, list_photographs, read_photograph
from handey_studio.sensing.stripes.stripe_light import laser_colour, laser_light
from handey_studio.sensing.stripes.stripe_peaks import find_peaks
from tests.sensing.stripe_images import noisy, stripe

CENTRES = 60.0 + np.linspace(-4, 4, 100)
COLOURS = {"red": (0.05, 0.1, 1.0), "green": (0.1, 1.0, 0.1), "blue": (1.0, 0.2, 0.05), "grey": (1.0, 1.0, 1.0)}


def scene(rng) -> np.ndarray:
    """A checked, coloured background (H, W, 3) in a lit room."""
    v, u = np.mgrid[:100, :140]
    checks = np.where((u // 17 + v // 13) % 2 == 0, 150.0, 30.0)[..., None] * np.array([0.8, 1.0, 0.9])
    checks[20:60, 100:130] = (30, 60, 170)  # an orange thing
    return checks


def photographs(colour: str, rng, exposure: float = 1.0) -> tuple[Photograph, Photograph]:
    """With the laser and without; `exposure` is the first's to the second's."""
    background = scene(rng)
    laser = stripe(CENTRES, 140, 1.4, 90.0)[..., None] * np.array(COLOURS[colour])
    lit, dark = noisy(exposure * background + laser, rng), noisy(background, rng)
    return Photograph(lit, lit.max(axis=2) >= 250), Photograph(dark, dark.max(axis=2) >= 250)


def off(light, photograph) -> np.ndarray:
    peaks = find_peaks(light, photograph.saturated, "down")
    assert len(peaks.uv) >= 85, peaks.dropped
    return peaks.uv[:, 0] - CENTRES[peaks.uv[:, 1].astype(int)]


@pytest.mark.parametrize("colour", list(COLOURS))
@pytest.mark.parametrize("exposure", [1.0, 0.7])
def test_the_dark_frame_leaves_the_laser_only_whatever_its_colour(colour, exposure):
    lit, dark = photographs(colour, np.random.default_rng(0), exposure)
    found = laser_colour([(lit, dark)], "auto")
    assert found.name == colour
    assert np.sqrt(np.mean(off(laser_light(lit, dark, found), lit) ** 2)) < 0.08


@pytest.mark.parametrize("colour", ["red", "green", "blue"])
def test_without_a_dark_frame_a_coloured_laser_stands_out_from_black_and_white(colour):
    lit, _ = photographs(colour, np.random.default_rng(1))
    found = laser_colour([(lit, None)], "auto")
    assert found.name == colour
    assert np.median(np.abs(off(laser_light(lit, None, found), lit))) < 0.1
    assert laser_colour([(lit, None)], colour) == found


def test_grey_photographs_have_a_grey_laser():
    image = noisy(stripe(CENTRES, 140, 1.4, 90.0)[..., None] * np.ones(3), np.random.default_rng(0), 0.0)
    photograph = Photograph(image, image.max(axis=2) >= 250)
    assert laser_colour([(photograph, None)], "auto").name == "grey"
    assert np.abs(off(laser_light(photograph, None, laser_colour([(photograph, None)], "auto")), photograph)).max() < 0.05
    with pytest.raises(BadInput, match="infrared"):
        laser_colour([(photograph, None)], "infrared")


def test_a_dark_frame_of_another_size_is_told():
    a, b = (Photograph(np.zeros((4, n, 3), np.float32), np.zeros((4, n), bool)) for n in (4, 5))
    with pytest.raises(BadInput, match="one size"):
        laser_light(a, b, laser_colour([(a, a)], "red"))


def test_8_and_16_bits_grey_and_colour_png_and_jpeg_read_alike(tmp_path):
    grey = np.tile(np.arange(0, 256, 2, dtype=np.uint8), (40, 1))
    colour = np.repeat(grey[..., None], 3, axis=2)
    files = {"a.png": grey, "b.png": colour, "c.png": grey.astype(np.uint16) * 257, "d.jpg": grey, "e.png": np.dstack([colour, grey])}
    for name, image in files.items():
        cv2.imwrite(str(tmp_path / name), image)
        photograph = read_photograph(tmp_path / name)
        assert photograph.size == (128, 40)
        assert np.abs(photograph.light - colour).max() <= (3 if name == "d.jpg" else 0)
        assert photograph.saturated[0, -1] and not photograph.saturated[0, 0]


def test_a_folder_is_read_in_the_order_of_names_and_dark_frames_belong_by_name(tmp_path):
    for name in ("b.png", "a.jpg", "c.png", "a.dark.png", "left-1.png", "left.dark.png", "dark.jpg", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    assert [path.name for path in list_photographs(tmp_path)] == ["a.jpg", "b.png", "c.png", "left-1.png"]
    darks = {name: dark_frame_of(tmp_path / name, None, "left" if "left" in name else "") for name in ("a.jpg", "b.png", "left-1.png")}
    wanted = {"a.jpg": "a.dark.png", "b.png": "dark.jpg", "left-1.png": "left.dark.png"}
    assert {name: path.name for name, path in darks.items() if path} == wanted
    assert dark_frame_of(tmp_path / "b.png", tmp_path / "mine.png") == tmp_path / "mine.png"
    for folder in (tmp_path / "missing", tmp_path / "notes.txt"):
        with pytest.raises(BadInput, match="does not exist"):
            list_photographs(folder)
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match="no photograph"):
        list_photographs(tmp_path / "empty")


def encoded(suffix: str) -> bytes:
    return cv2.imencode(suffix, np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8))[1].tobytes()


@settings(max_examples=80, deadline=None)
@given(st.sampled_from([".png", ".jpg"]), st.integers(0, 400), st.binary(max_size=6), st.booleans())
def test_damaged_files_are_told_in_a_sentence(tmp_path_factory, suffix, place, junk, cut):
    content = encoded(suffix)
    damaged = content[:place] + junk + (b"" if cut else content[place + len(junk) :])
    path = tmp_path_factory.mktemp("damaged") / f"p{suffix}"
    path.write_bytes(damaged)
    try:
        assert read_photograph(path).light.ndim == 3
    except BadInput as error:
        assert "\n" not in str(error) and path.name in str(error)


def test_a_photograph_that_claims_to_be_huge_is_not_decoded(tmp_path):
    png = bytearray(encoded(".png"))
    png[16:24] = (60000).to_bytes(4, "big") * 2
    (tmp_path / "huge.png").write_bytes(bytes(png))
    with pytest.raises(BadInput, match="60000 × 60000"):
        read_photograph(tmp_path / "huge.png")
