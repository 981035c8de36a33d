import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import shapely
import trimesh

from handey_studio.app.palette import css
from handey_studio.app.pictures.thumbnail import SIGHT, _shade, part_thumbnail
from handey_studio.geometry import box, prism
from handey_studio.world import Library, Part

LIBRARY = Library.choose()
ROUND = np.linspace(0, 2 * np.pi, 24, endpoint=False)
GEAR = prism(np.c_[np.cos(ROUND), np.sin(ROUND)] * np.where(np.arange(24) % 4 < 2, 0.05, 0.035)[:, None], 0.02)
PARTS = [LIBRARY.part(name) for name in sorted(LIBRARY.part_files())] + [Part("gear", GEAR), Part("sheet", box((0.2, 0.1, 0.001)))]


def drawn(text: str) -> list[tuple[shapely.Polygon, str]]:
    """The filled outlines of a picture in the order in which they are drawn."""
    shapes = []
    for path in ET.fromstring(text).iter("path"):
        if path.get("fill") != "none":
            rings = [
                [[float(x) for x in pair.split(",")] for pair in ring.split("L")] for ring in re.findall("M([^Z]+)Z", path.get("d", ""))
            ]
            shapes.append((shapely.Polygon(rings[0], rings[1:]), path.get("fill", "")))
    return shapes


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_each_spot_shows_the_face_that_the_eye_meets_first(part):
    size, solid = 96, part.solid
    shapes = drawn(part_thumbnail(part, size))
    eye = SIGHT / np.linalg.norm(SIGHT)
    right = np.array([-eye[1], eye[0], 0.0]) / np.hypot(eye[0], eye[1])
    up = np.cross(eye, right)
    x, y = solid.vertices @ right, solid.vertices @ up
    scale = 0.9 * size / max(np.ptp(x), np.ptp(y))
    spots = np.random.default_rng(0).uniform(5, size - 5, (300, 2))
    middle = np.array([x.min() + x.max(), y.min() + y.max()]) / 2
    across = (spots - size / 2) / scale * (1, -1) + middle
    starts = across[:, :1] * right + across[:, 1:] * up + (solid.vertices @ eye).max() * eye + eye
    mesh = trimesh.Trimesh(solid.vertices, solid.triangles, process=False)
    _, rays, triangles = mesh.ray.intersects_location(starts, np.broadcast_to(-eye, starts.shape), multiple_hits=False)
    met = np.full(len(spots), -1)
    met[rays] = solid.face_of_triangle[triangles]
    right_colour = 0
    for spot, face in zip(spots, met, strict=True):
        over = [colour for outline, colour in shapes if outline.covers(shapely.Point(spot))]
        expected = css(_shade(solid.normals[face])) if face >= 0 else None
        right_colour += (over[-1] if over else None) == expected
    assert right_colour >= 295 and (met >= 0).sum() > 10  # a spot on an edge may fall to either side


def test_the_picture_is_small_text_that_names_the_part():
    for part in PARTS:
        text = part_thumbnail(part)
        assert len(text) < 20_000 and f'aria-label="{part.name}"' in text and "nan" not in text
    assert 'aria-label="&lt;b&gt;' in part_thumbnail(Part("<b>", box((0.1, 0.1, 0.1))))
