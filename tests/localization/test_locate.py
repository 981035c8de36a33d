"""Localization: truth made, ray cast, hidden in noise and clutter, and found again up to symmetry."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, inverse, rotation_angle, transform
from handey_studio.localization import LocateOptions, localize
from handey_studio.localization.edges import edge_pixels
from handey_studio.localization.evidence import evidence_of, limits_of
from handey_studio.localization.samples import part_samples
from handey_studio.localization.segments import link
from handey_studio.localization.surface import surface_of
from handey_studio.localization.verify import verify
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.drawing import rendered_depth
from handey_studio.world.model_files import read_part
from handey_studio.world.part import Part
from tests.localization.rendering import looking_at, map_from_above, oblique_view, resting_poses

PARTS = {path.stem: read_part(path) for path in sorted((Path(__file__).parents[2] / "parts").glob("*.obj"))}


def error(T_true, T_found, part):
    """Millimetres between the centroids, and degrees, of the symmetric image that is nearest."""
    centre = np.append(part.solid.volume_and_centroid[1], 1.0)
    images = [T_found @ S for S in part.symmetries]
    return min(
        (float(np.rad2deg(rotation_angle(T_true[:3, :3].T @ T[:3, :3]))), 1e3 * float(np.linalg.norm((T - T_true) @ centre)))
        for T in images
    )


def on_table(part, rng, pose=None):
    poses = resting_poses(part.solid)
    yaw = from_xyz_rpy((0.48 + rng.uniform(-0.04, 0.04), rng.uniform(-0.04, 0.04), 0), (0, 0, rng.uniform(-np.pi, np.pi)))
    return yaw @ poses[rng.integers(len(poses)) if pose is None else pose]


def clutter(T, rng, count=4):
    """Cuboids of 20–60 mm on the table, off the part's middle by 75 mm or more."""
    bodies = []
    while len(bodies) < count:
        size, place = rng.uniform(0.02, 0.06, 3), np.array([0.48, 0.0]) + rng.uniform(-0.13, 0.13, 2)
        if np.linalg.norm(place - T[:2, 3]) > 0.08:
            bodies.append((box(size), from_xyz_rpy((*place, size[2] / 2), (0, 0, rng.uniform(0, 6)))))
    return bodies


@pytest.mark.parametrize("name", sorted(PARTS))
@pytest.mark.parametrize("seed", [0, 3])
def test_a_part_in_clutter_is_found_from_above(name, seed):
    rng, part = np.random.default_rng(seed), PARTS[name]
    T = on_table(part, rng)
    result = localize(map_from_above([(part.solid, T), *clutter(T, rng)], rng).view(), [part])
    assert result.poses, result.reason
    degrees, millimetres = error(T, result.poses[0].T_world_part, part)
    assert degrees < 0.3 and millimetres < 0.4
    assert result.poses[0].score > 0.8 and result.poses[0].edges_found <= result.poses[0].edges_predicted
    assert result.poses[0].surface_rms_m < 0.001


@pytest.mark.parametrize("name", ["brick", "l_block", "t_block"])
def test_a_part_is_found_by_an_oblique_camera(name):
    rng, part = np.random.default_rng(0), PARTS[name]
    T = on_table(part, rng)
    T_world_sensor = looking_at(np.array([0.4, -0.42, 0.42]), np.array([0.48, 0.0, 0.02]))
    result = localize(oblique_view([(part.solid, T), *clutter(T, rng)], T_world_sensor, rng), [part])
    assert result.poses, result.reason
    degrees, millimetres = error(T, result.poses[0].T_world_part, part)
    assert degrees < 0.7 and millimetres < 0.8
    assert np.allclose(result.poses[0].T_world_part, T_world_sensor @ result.poses[0].T_sensor_part)


def test_two_instances_are_found_once_each_and_no_third():
    rng, part = np.random.default_rng(1), PARTS["l_block"]
    truths = [
        from_xyz_rpy((0.42, -0.06, 0), (0, 0, 0.3)),
        from_xyz_rpy((0.52, 0.08, 0.06), (np.pi, 0, 2.0)) @ transform(translation=(0, 0, 0.02)),
    ]
    truths[1][2, 3] = 0.04
    poses = localize(map_from_above([(part.solid, T) for T in truths], rng).view(), [part]).poses
    assert len(poses) == 2
    for T in truths:
        degrees, millimetres = min((error(T, pose.T_world_part, part) for pose in poses), key=lambda e: e[1])
        assert degrees < 0.3 and millimetres < 0.4
    one = localize(map_from_above([(part.solid, T) for T in truths], rng).view(), [part], LocateOptions(max_poses=1))
    assert len(one.poses) == 1 and "as many poses as asked for were found" in one.rejected


def test_a_part_half_under_another_is_found():
    rng, part = np.random.default_rng(2), PARTS["brick"]
    T = from_xyz_rpy((0.48, 0.0, 0.015), (0, 0, 0.5))
    beam = (box([0.03, 0.2, 0.02]), from_xyz_rpy((0.47, 0.0, 0.041), (0, 0, 0.2)))
    result = localize(map_from_above([(part.solid, T), beam], rng).view(), [part])
    assert result.poses, result.reason
    degrees, millimetres = error(T, result.poses[0].T_world_part, part)
    assert degrees < 0.5 and millimetres < 0.6
    assert result.poses[0].visible_fraction < 0.8


def test_a_part_that_touches_a_neighbour_of_its_height_is_found():
    rng, part = np.random.default_rng(4), PARTS["l_block"]
    T = from_xyz_rpy((0.45, -0.03, 0.0), (0, 0, 0.35))
    neighbour = (box([0.04, 0.03, 0.04]), T @ from_xyz_rpy((-0.02, 0.02, 0.02)))
    result = localize(map_from_above([(part.solid, T), neighbour], rng).view(), [part], LocateOptions(min_score=0.3))
    assert result.poses, result.reason
    assert error(T, result.poses[0].T_world_part, part)[1] < 0.8


@pytest.mark.parametrize("bodies", [[], [([0.2, 0.15, 0.05], 0.3)], [([0.11, 0.09, 0.02], 1.0), ([0.03, 0.03, 0.09], 0.1)]])
def test_what_is_not_there_is_not_found_and_the_record_says_why(bodies):
    rng = np.random.default_rng(6)
    solids = [(box(size), from_xyz_rpy((0.4 + 0.12 * k, 0.02, size[2] / 2), (0, 0, yaw))) for k, (size, yaw) in enumerate(bodies)]
    result = localize(map_from_above(solids, rng).view(), [PARTS["t_block"], PARTS["brick"]])
    assert result.poses == () and "not found" in result.reason
    assert result.ledger and result.rejected


def test_a_small_box_is_not_found_inside_a_bigger_face():
    rng = np.random.default_rng(8)
    big = (box([0.16, 0.1, 0.03]), from_xyz_rpy((0.48, 0.0, 0.015), (0, 0, 0.2)))
    result = localize(map_from_above([big], rng).view(), [PARTS["brick"]])
    assert result.poses == ()
    corner = from_xyz_rpy((0.48, 0.0, 0.015), (0, 0, 0.2)) @ transform(translation=(-0.04, -0.025, 0))
    view = map_from_above([big], rng).view()
    assert shares(view, PARTS["brick"], corner)[0] < 0.7


def shares(view, part, T_world_part):
    """Edge share and surface share of a pose."""
    surface = surface_of(view)
    evidence = evidence_of(view, surface, link(view, surface, edge_pixels(view, surface)))
    T = inverse(view.T_world_sensor) @ T_world_part
    verdict = verify(T[None, :3, :3], T[None, :3, 3], part_samples(part), evidence, limits_of(view))
    return float(verdict.edge_share[0]), float(verdict.surface_share[0])


def test_the_truth_is_judged_well_and_a_wrong_pose_badly():
    rng, part = np.random.default_rng(9), PARTS["l_block"]
    T = on_table(part, rng, 0)
    view = map_from_above([(part.solid, T)], rng).view()
    assert min(shares(view, part, T)) > 0.9
    lifted = T.copy()
    lifted[2, 3] += 0.02
    assert min(shares(view, part, lifted)) < 0.5
    assert min(shares(view, part, T @ from_xyz_rpy((0, 0, 0), (0, 0, 0.6)))) < 0.75


def test_nothing_readable_gives_an_empty_result():
    view = DepthView(np.full((50, 50), np.nan), map_from_above([], np.random.default_rng(0)).view().projection)
    result = localize(view, [PARTS["brick"]])
    assert result.poses == () and result.edges == () and result.reason


def test_the_same_view_gives_the_same_result():
    rng, part = np.random.default_rng(3), PARTS["stairs"]
    T = on_table(part, rng)
    view = map_from_above([(part.solid, T), *clutter(T, rng)], rng).view()
    assert localize(view, [part]).poses == localize(view, [part]).poses


def test_a_cancelled_search_ends_with_its_record():
    class Impatient:
        cancelled = True

        def report(self, fraction, message):
            assert 0.0 <= fraction <= 1.0 and message

    view = map_from_above([], np.random.default_rng(0)).view()
    result = localize(view, [PARTS["brick"]], progress=Impatient())
    assert result.cancelled and result.poses == ()


def test_no_pose_goes_below_the_table():
    """Only the top of a brick shows; a taller part of the same top would reach through the table."""
    rng, brick = np.random.default_rng(11), PARTS["brick"]
    tall = Part("tall", box([0.08, 0.05, 0.06]))
    view = map_from_above([(brick.solid, from_xyz_rpy((0.48, 0, 0.015), (0, 0, 1.0)))], rng).view()
    assert localize(view, [tall]).poses == ()
    assert localize(view, [tall], LocateOptions(table_z_m=None)).poses
    assert localize(replace(view, T_world_sensor=np.eye(4)), [brick]).poses, "a view that knows no world has no table to heed"


def test_drawing_agrees_with_ray_casting():
    rng, part = np.random.default_rng(12), PARTS["wedge"]
    T = on_table(part, rng)
    view = map_from_above([(part.solid, T)], rng, noise=0.0, dropped=0.0).view()
    T_sensor_part = inverse(view.T_world_sensor) @ T
    corners = part.solid.vertices @ T_sensor_part[:3, :3].T + T_sensor_part[:3, 3]
    scale = 1.0 / 0.001
    drawn = rendered_depth(corners, part.solid.triangles, view.depth.shape, (1.0, scale, scale, -0.5, -0.5))
    both = np.isfinite(drawn) & np.isfinite(view.depth)
    assert both.sum() > 500
    assert np.quantile(np.abs(drawn - view.depth)[both], 0.98) < 1e-4
