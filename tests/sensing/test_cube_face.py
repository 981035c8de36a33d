"""The cube's upper face in depth maps: its middle to a small part of a cell, and why it is not taken."""

import numpy as np
import pytest

from handey_studio.geometry.transforms import rotation_about
from handey_studio.sensing.cube_face import find_cube_face
from handey_studio.sensing.depth_map import DepthMap

CELL, SIDE, TOP = 0.001, 0.05, 0.2


def square_map(middle, yaw: float, rng, slope=(0.0, 0.0), side=SIDE, noise=2e-4, cut=None, corner=None) -> DepthMap:
    """A table and a square above it, read once a cell wherever the cell's own random reading falls on it."""
    j, i = np.indices((200, 200))
    xy = np.stack([(i + rng.uniform(size=i.shape)) * CELL, (j + rng.uniform(size=i.shape)) * CELL], axis=-1)
    local = (xy - middle) @ rotation_about((0, 0, 1), yaw)[:2, :2]
    on = (np.abs(local) <= side / 2).all(axis=-1)
    if cut is not None:
        on &= local[..., 0] < cut
    if corner is not None:
        on &= local.sum(axis=-1) < side - corner
    z = np.where(on, TOP + (xy - middle) @ np.array(slope), 0.0) + rng.normal(0.0, noise, i.shape)
    return DepthMap(z, CELL, np.eye(4), z, noise)


@pytest.mark.parametrize("yaw", [0.0, 0.3, 0.8, 2.0])
def test_the_middle_is_found_within_a_fraction_of_a_cell(yaw):
    rng = np.random.default_rng(2)
    off = []
    for _ in range(5):
        middle = np.array([0.1, 0.1]) + rng.uniform(-0.02, 0.02, 2)
        face = find_cube_face(square_map(middle, yaw, rng), SIDE)
        assert face.found, face.reason
        off.append(face.middle_range - [*middle, TOP])
    off = np.sqrt(np.mean(np.square(off), axis=0))
    assert off[:2].max() < 0.2 * CELL and off[2] < 2e-5


def test_a_leaning_face_has_its_height_at_its_middle():
    rng = np.random.default_rng(3)
    face = find_cube_face(square_map(np.array([0.1, 0.09]), 0.4, rng, slope=(0.05, -0.02)), SIDE)
    assert face.found and abs(face.middle_range[2] - TOP) < 3e-5
    np.testing.assert_allclose(face.normal_range, np.array([-0.05, 0.02, 1.0]) / np.linalg.norm([0.05, 0.02, 1.0]), atol=2e-3)


def test_a_hidden_corner_does_not_draw_the_middle_away():
    rng, off = np.random.default_rng(6), []
    for yaw in (0.2, 0.5, 1.1, 1.9):
        face = find_cube_face(square_map(np.array([0.1, 0.1]), yaw, rng, corner=0.01), SIDE)
        assert face.found, face.reason
        off.append(face.middle_range[:2] - 0.1)
    assert np.abs(off).max() < 0.2 * CELL


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"side": 0.044}, "the face has sides of 43.9 cells"),
        ({"cut": 0.012}, "half hidden"),
        ({"middle": np.array([0.1, 0.02])}, "leaves the depth map"),
        ({"slope": (0.3, 0.0)}, "leans by"),
        ({"side": 0.01}, "no level surface of about 50 × 50 mm"),
    ],
)
def test_why_a_face_is_not_taken(change, words):
    given = {"middle": np.array([0.1, 0.1]), "yaw": 0.3, "rng": np.random.default_rng(4)} | change
    face = find_cube_face(square_map(**given), SIDE)
    assert not face.found and words in face.reason


def test_an_oblong_of_the_same_area_is_not_the_cube():
    rng = np.random.default_rng(5)
    depth_map = square_map(np.array([0.1, 0.1]), 0.0, rng, side=0.06, cut=0.0117)
    face = find_cube_face(depth_map, SIDE)
    assert not face.found and ("no square" in face.reason or "sides of" in face.reason)
