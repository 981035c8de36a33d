"""Random scenes are at rest and seen exactly; their truth tells what is visible; saved ones come back."""

from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody, fixed_bodies
from handey_studio.cell.camera import DepthCamera, SensorFaults, beside_jumps, look_exactly, pixels_alone, with_faults
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.scenes.pile_scenes import SceneOptions, random_scene
from handey_studio.cell.scenes.scene_files import load_scene, save_scene
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, inverse, pose_difference, transform
from handey_studio.sensing.depth_view import Orthographic, Pinhole
from tests.cell.overlaps import body_overlap

CLEAN = SensorFaults(noise_m=0.0, step_m=0.0, grazing_lost=0.0, jump_lost=0.0, jump_mixed=0.0)
DOWN = transform(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 0.6))


def _bodies(scene, library):
    parts = [SolidBody(f"{p.part}{k}", library.part(p.part).solid, p.T_world_part) for k, p in enumerate(scene.truth)]
    return [*fixed_bodies(Workcell()), *parts, *scene.clutter]


@pytest.fixture(scope="module")
def clean(library):
    return random_scene(3, library, SceneOptions(faults=CLEAN))


def test_a_scene_holds_parts_and_strangers_at_rest(clean, library):
    bodies = _bodies(clean, library)
    assert len(clean.truth) + len(clean.clutter) == 20 and 4 <= len(clean.clutter) <= 8
    assert {pose.part for pose in clean.truth} <= set(library.part_files())
    assert max(Counter(pose.part for pose in clean.truth).values()) >= 2
    assert all(body_overlap(a, b) < 5e-4 for a, b in combinations(bodies, 2))
    again = settle(bodies)
    assert again.resting
    assert max(pose_difference(a.T_world_body, b.T_world_body)[0] for a, b in zip(again.bodies, bodies, strict=True)) < 1e-3


def test_the_camera_sees_every_surface_where_it_is(clean, library):
    """Without faults each reading lies on the boundary of some body, and in none."""
    readings = clean.view.points_sensor()[::7, ::7].reshape(-1, 3)
    points = apply(clean.view.T_world_sensor, readings[np.isfinite(readings).all(axis=1)])
    gaps = np.full(len(points), np.inf)
    for body in _bodies(clean, library):
        local = apply(inverse(body.T_world_body), points)
        for piece in body.pieces:
            low = _signed(piece, local)
            gaps = np.where(np.abs(low) < np.abs(gaps), low, gaps)
    assert np.abs(gaps).max() < 2e-5


def _signed(piece, points):
    """Signed distance bound of points to a convex piece: exact on its faces."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(piece).equations
    return (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)


def test_visible_fractions_agree_with_counting_each_body_by_itself(clean, library):
    """The oracle: a pixel shows a part if that part alone gives the depth that the scene has there."""
    view = clean.view
    camera = DepthCamera(view.projection, view.depth.shape, view.T_world_sensor)
    for k, pose in list(enumerate(clean.truth))[:6]:
        alone = look_exactly(camera, [SolidBody(str(k), library.part(pose.part).solid, pose.T_world_part)])
        with np.errstate(invalid="ignore"):
            shown = int((np.abs(alone.depth - view.depth) < 1e-7).sum())
        assert abs(shown - pose.visible_px) <= 3
        assert 0.0 <= pose.visible_fraction <= 1.0


def test_a_part_cut_off_by_the_image_counts_what_lies_outside():
    cube = SolidBody("cube", box((0.04, 0.04, 0.04)), transform(None, (0.0, 0.0, 0.02)))
    whole = DepthCamera(Pinhole(600.0, 600.0, 49.5, 49.5), (100, 100), DOWN)
    half = DepthCamera(Pinhole(600.0, 600.0, -0.5, 49.5), (100, 100), DOWN)
    assert pixels_alone(whole, cube) == pixels_alone(half, cube) == (look_exactly(whole, [cube]).body == 0).sum()
    assert (look_exactly(half, [cube]).body == 0).sum() == pixels_alone(half, cube) / 2


def test_the_sensors_faults_are_as_large_as_told():
    bodies = [*fixed_bodies(Workcell()), SolidBody("cube", box((0.1, 0.1, 0.1)), transform(None, (0.0, 0.0, 0.05)))]
    seen = look_exactly(DepthCamera(Pinhole(600.0, 600.0, 127.5, 127.5), (256, 256), DOWN), bodies)
    faults = SensorFaults()
    depth = with_faults(seen, faults, np.random.default_rng(1))
    jumps = beside_jumps(seen, faults.jump_m)
    away = depth[~jumps] - seen.depth[~jumps]
    assert jumps.sum() == (4 * 120 - 4) + 4 * 120  # the rim of a top 120 pixels wide, and the table's pixels beside it
    assert np.isfinite(away).all() and away.std() == pytest.approx(faults.noise_m, rel=0.02) and abs(away.mean()) < 2e-5
    steps = depth[np.isfinite(depth)] / faults.step_m
    assert np.allclose(steps, np.round(steps), atol=1e-6)
    assert np.isnan(depth[jumps]).mean() == pytest.approx(faults.jump_lost, abs=0.04)
    with np.errstate(invalid="ignore"):
        floating = (depth > 0.5 + 0.003) & (depth < 0.6 - 0.003)
    assert floating[jumps].mean() == pytest.approx(faults.jump_mixed, abs=0.04) and not floating[~jumps].any()


def test_a_seed_gives_the_same_scene_and_another_seed_another(library):
    options = SceneOptions(bodies=6, size_px=128)
    first, second, other = (random_scene(seed, library, options) for seed in (11, 11, 12))
    assert first == second and first != other


@pytest.mark.parametrize("sensor", ["camera", "range_finder"])
def test_a_saved_scene_comes_back(sensor, library, tmp_path):
    scene = random_scene(5, library, SceneOptions(bodies=6, size_px=256, sensor=sensor, spread=(0.03, 0.06)))
    save_scene(scene, tmp_path / "scene")
    back = load_scene(tmp_path / "scene")
    assert np.array_equal(np.isnan(back.view.depth), np.isnan(scene.view.depth))
    assert np.nanmax(np.abs(back.view.depth - scene.view.depth)) <= 0.051e-3
    assert back.truth == scene.truth and back.clutter == scene.clutter and back.seed == 5
    assert back.view.projection == scene.view.projection and np.allclose(back.view.T_world_sensor, scene.view.T_world_sensor)
    assert isinstance(back.view.projection, Orthographic if sensor == "range_finder" else Pinhole)


def test_the_range_finders_scene_shows_its_parts_where_they_are(library):
    scene = random_scene(2, library, SceneOptions(bodies=8, sensor="range_finder", spread=(0.03, 0.08)))
    assert scene.view.depth.shape == (400, 400)
    in_sight = [pose for pose in scene.truth if pose.visible_fraction > 0.9]
    assert in_sight
    for pose in in_sight:
        solid = library.part(pose.part).solid
        corners = apply(inverse(scene.view.T_world_sensor) @ pose.T_world_part, solid.vertices)
        u, v = np.round(scene.view.projection.project(corners[np.argmin(corners[:, 2])])).astype(int)
        window = scene.view.depth[v - 3 : v + 4, u - 3 : u + 4]
        assert abs(np.nanmin(window) - corners[:, 2].min()) < 0.003


def test_bad_options_are_one_sentence(library, tmp_path):
    with pytest.raises(BadInput, match="camera, range_finder"):
        random_scene(0, library, replace(SceneOptions(), sensor="sonar"))
    (tmp_path / "truth.json").write_text('{"schema": "other"}')
    with pytest.raises(BadInput, match="handey/scene/1"):
        load_scene(tmp_path)
