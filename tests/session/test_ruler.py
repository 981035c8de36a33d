"""What a click lies on: known corners, faces, readings and the table are found again along their rays."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.geometry.transforms import apply
from handey_studio.session.ruler import spot_at
from tests.session.samples import full_session

EYE = np.array([0.9, -0.9, 0.8])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return full_session(tmp_path_factory.mktemp("library")).scene


def test_a_click_near_a_corner_is_the_corner(scene):
    rng = np.random.default_rng(1)
    placed = scene.instances[0]
    bare = replace(scene.depth_map, elevation=np.zeros_like(scene.depth_map.elevation))
    alone = replace(scene, instances=(placed,), depth_map=bare)
    corners = apply(placed.T_world_part, placed.part.solid.vertices)
    for corner in corners[corners[:, 2] > corners[:, 2].max() - 1e-6]:
        away = rng.normal(size=3) * 0.0005
        assert np.allclose(spot_at(alone, 0.0, EYE, corner + away - EYE), corner, atol=1e-9)


def test_a_click_on_a_face_is_on_the_face(scene):
    placed = scene.instances[0]
    solid, T = placed.part.solid, placed.T_world_part
    vertices, normals = apply(T, solid.vertices), solid.normals @ T[:3, :3].T
    top = int(np.argmax(normals[:, 2] * (1.0 + vertices[[face.loops[0][0] for face in solid.faces], 2])))
    ring = vertices[list(solid.faces[top].loops[0])]
    inside = ring[0] + 0.5 * (ring[1] - ring[0]) + 0.3 * (ring[-1] - ring[0])
    spot = spot_at(replace(scene, instances=(placed,)), 0.0, EYE, inside - EYE)
    assert spot is not None and abs((spot - ring[0]) @ normals[top]) < 0.002


def test_beside_everything_there_is_the_table_or_nothing(scene):
    far = np.array([3.0, 3.0, 0.0])
    assert np.allclose(spot_at(scene, 0.0, EYE, far - EYE), far)
    assert np.allclose(spot_at(None, 0.1, EYE, far - EYE)[2], 0.1)
    assert spot_at(scene, 0.0, EYE, np.array([1.0, -1.0, 0.5])) is None


def test_a_reading_stands_before_the_table(scene):
    bare = replace(scene, instances=())
    points = scene.depth_map.points_world()
    high = points[np.argmax(points[:, 2])]
    spot = spot_at(bare, 0.0, high + np.array([0.0, 0.0, 0.6]), np.array([0.0, 0.0, -1.0]))
    assert spot is not None and np.linalg.norm(spot - high) < 0.006 and spot[2] > high[2] - 0.005
