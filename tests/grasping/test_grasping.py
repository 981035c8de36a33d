import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse
from handey_studio.grasping import (
    fill_grasp_plane,
    grasp_groups,
    hand_in_plane,
    plan_approach,
)
from handey_studio.grasping.hand_outline import hand_outline, hand_rectangles
from handey_studio.world import Library, PlacedPart, World, hand_hulls

LIBRARY = Library.choose()
ROBOT = LIBRARY.robot("ur5")
HAND = ROBOT.hand
T_RANGE = from_xyz_rpy((0.28, -0.2, 0.0))


def terrain(*blocks):
    """Columns of 2 mm with axis-parallel blocks (x0, x1, y0, y1, height) [m] in the world."""
    top = np.zeros((200, 200))
    for x0, x1, y0, y1, height in blocks:
        top[round((y0 + 0.2) / 0.002) : round((y1 + 0.2) / 0.002), round((x0 - 0.28) / 0.002) : round((x1 - 0.28) / 0.002)] = height
    return HeightField(top, 0.002, T_RANGE)


@given(st.floats(-np.pi, np.pi), st.sampled_from([1, -1]))
def test_hand_in_plane_is_a_rotation_with_the_fingers_along_the_angle(angle, side):
    T = hand_in_plane(np.array([0.1, 0.2]), angle, side)
    assert np.isclose(np.linalg.det(T[:3, :3]), 1) and np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3))
    assert np.allclose(T[:3, 2], (0, np.cos(angle), np.sin(angle)))


@settings(max_examples=20, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5), st.floats(0.0, 3.0))
def test_filled_cells_agree_with_a_naive_count(roll, pitch, yaw):
    """Oracle: points on every ray under every column, sorted one by one into the slabs."""
    field = terrain((0.46, 0.50, -0.03, 0.02, 0.05))
    T = from_xyz_rpy((0.48, 0.0, 0.03), (roll, pitch, yaw))
    opening = 0.05
    plane = fill_grasp_plane(World(ROBOT, terrain=field), T, np.zeros(2), HAND, opening)
    coarse = field
    j, i = np.nonzero(coarse.top > 0.001)
    depth = np.arange(0.0, 0.05, 0.0007)
    x, y = np.repeat((i + 0.5) * coarse.cell + 0.28, len(depth)), np.repeat((j + 0.5) * coarse.cell - 0.2, len(depth))
    z = (coarse.top[j, i][:, None] - depth).ravel()
    local = apply(inverse(T), np.c_[x, y, z])
    beside = (np.abs(local[:, 0]) > opening / 2) & (np.abs(local[:, 0]) < opening / 2 + HAND.finger_thickness)
    assert filled_near(plane, "fingers", local[beside][:, 1:]), "no intrusion is missed"
    across = np.abs(local[:, 0]) < HAND.crosspiece_length / 2
    assert filled_near(plane, "crosspiece", local[across][:, 1:])


def filled_near(plane, volume, points):
    """Whether each point's cell is filled, or the cell that a ray a quarter of a cell beside it meets: rays are sampled."""
    shifts = [(0.0, 0.0), *((dy, dz) for dy in (-0.0005, 0.0005) for dz in (-0.0005, 0.0005))]
    return np.any([plane.is_filled(volume, points + shift) for shift in shifts], axis=0).all()


def approach(world, part, T_world_part, group):
    T_world_plane = T_world_part @ group.grasp_class.T_part_plane
    opening = group.opening(HAND)
    plane = fill_grasp_plane(world, T_world_plane, group.point, HAND, opening)
    along = np.array([np.cos(group.angle), np.sin(group.angle)])
    start = np.append(group.point - (0.08 + group.depth) * along, group.angle)
    return plan_approach(plane, hand_outline(HAND), start, group.point), T_world_plane, opening


def from_above(part, T_world_part):
    groups, _ = grasp_groups(part, HAND)
    return [g for g in groups if (T_world_part @ g.grasp_class.T_part_plane @ hand_in_plane(g.point, g.angle, 1))[2, 2] < -0.95]


def test_the_free_approach_is_a_straight_line():
    part, T = LIBRARY.part("brick"), from_xyz_rpy((0.48, 0.0, 0.015))
    world = World(ROBOT, parts=(PlacedPart("brick#1", part, T),), terrain=terrain())
    for group in from_above(part, T):
        run, _, _ = approach(world, part, T, group)
        assert run.status == "reached" and run.distance <= 0.0015
        assert np.abs(run.path[:, 2] - group.angle).max() < 1e-9


def test_the_approach_goes_round_an_obstacle_and_never_through_it():
    """A block hangs over the straight way in for one side: the hand turns or steps aside, and its volumes stay clear of every cell."""
    part, T = LIBRARY.part("brick"), from_xyz_rpy((0.48, 0.0, 0.015))
    field = terrain((0.50, 0.56, -0.06, 0.06, 0.06))
    world = World(ROBOT, parts=(PlacedPart("brick#1", part, T),), terrain=field)
    reached = 0
    for group in from_above(part, T):
        run, T_world_plane, opening = approach(world, part, T, group)
        reached += run.status == "reached"
        if run.status == "blocked start":
            continue
        j, i = np.nonzero(field.top > 0.002)
        tops = apply(T_RANGE, np.c_[(i + 0.5) * 0.002, (j + 0.5) * 0.002, field.top[j, i] - 0.0005])
        for pose in run.path[:: max(1, len(run.path) // 8)]:
            local = apply(inverse(T_world_plane @ hand_in_plane(pose[:2], pose[2], 1)), tops)
            for corners in hand_hulls(ROBOT, opening).values():
                low, high = corners.min(axis=0), corners.max(axis=0)
                assert not ((local > low + 0.002) & (local < high - 0.002)).all(axis=1).any()
    assert reached > 0


def test_the_hand_outline_covers_the_whole_hand():
    total = min(low for _, _, low, _ in hand_rectangles(HAND))
    assert np.isclose(total, -HAND.T_flange_hand[2, 3])
    assert max(high for _, _, _, high in hand_rectangles(HAND)) == 0.0
