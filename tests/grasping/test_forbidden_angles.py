"""Forbidden angle ranges against dense sampling: of shapely's polygons in the plane, and of the collision model in space."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import affinity

from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import from_xyz_rpy, inverse
from handey_studio.grasping import HAND_MARGIN_M, GraspEnd, contact_area, grasp_groups, hand_in_plane, legal_rotations
from handey_studio.grasping.angle_ranges import complement, joined
from handey_studio.grasping.forbidden_angles import MOST_RANGES, insert, polygon_ranges
from handey_studio.grasping.plane_obstacles import clipped, hull
from handey_studio.world import Block, Library, PlacedPart, World
from handey_studio.world.collision import collision_model
from handey_studio.world.collision_queries import least_clearance

LIBRARY = Library.choose()
ROBOT = LIBRARY.robot("ur5")
HAND = ROBOT.hand
TOUCHED = [("finger_left", "part#1"), ("finger_right", "part#1")]


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_ranges_are_those_of_a_rectangle_turned_step_by_step(seed):
    """Oracle: shapely turns each rectangle to each of many angles. Fingers, crosspiece, wide boxes; small bodies and big, one or more."""
    rng = np.random.default_rng(seed)
    window = (c := float(rng.uniform(-3, 3)), c + 2.1)
    ranges, counts, pairs = np.empty((1, MOST_RANGES, 2)), np.zeros(1, np.int64), []
    for _ in range(rng.integers(1, 4)):
        low, high = [(-0.001, 0.061), (0.059, 0.086), (0.08, 0.12), (0.0, 0.03)][rng.integers(4)]
        w, size = float(rng.choice([0.011, 0.016, 0.2])), float(rng.choice([0.01, 0.05, 1.0]))
        points = rng.normal(size=(rng.integers(1, 10), 2)) * size * rng.random() + rng.uniform(-0.1, 0.1, 2)
        outline = shapely.MultiPoint(points).convex_hull
        polygon_ranges(hull(points), (w, low, high), window, ranges, counts, 0)
        pairs.append((shapely.box(-high, -w, -low, w), outline))
    found = ranges[0, : counts[0]]
    for angle in np.linspace(*window, 40):
        met = any(affinity.rotate(box, angle, origin=(0, 0), use_radians=True).intersects(outline) for box, outline in pairs)
        inside = bool(((found[:, 0] <= angle) & (angle <= found[:, 1])).any())
        near_an_end = len(found) and np.abs(found - angle).min() < 1e-6
        assert inside == met or near_an_end


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(0, 7)), max_size=100))
def test_inserted_ranges_are_joined_and_clipped(spans):
    """Whole turns do not matter, and with more ranges than there is room for, more is forbidden, never less."""
    window = (-1.0, 1.0)
    ranges, counts = np.empty((1, MOST_RANGES, 2)), np.zeros(1, np.int64)
    for first, width in spans:
        insert(first, first + width, window, ranges, counts, 0)
    found = joined([(float(low), float(high)) for low, high in ranges[0, : counts[0]]])
    assert len(found) == counts[0] <= MOST_RANGES
    assert all(window[0] <= low <= high <= window[1] for low, high in found)
    for angle in np.linspace(*window, 41):
        taken = any((angle - first) % (2 * np.pi) <= width for first, width in spans)
        assert not taken or any(low - 1e-9 <= angle <= high + 1e-9 for low, high in found)


def test_ranges_apart_by_rounding_alone_are_one():
    ranges, counts = np.empty((1, MOST_RANGES, 2)), np.zeros(1, np.int64)
    for first, last in ((-0.9, -0.2), (-0.2 + 1e-13, 0.5), (0.7, 0.8)):
        insert(first, last, (-1.0, 1.0), ranges, counts, 0)
    assert sorted(ranges[0, : counts[0]].tolist()) == [[-0.9, 0.5], [0.7, 0.8]]


def test_what_is_left_of_a_range():
    assert complement([(-2.0, -1.0), (0.0, 0.5)], -1.5, 1.0) == [(-1.0, 0.0), (0.5, 1.0)]
    assert complement([], 0.0, 1.0) == [(0.0, 1.0)]
    assert complement([(-1.0, 2.0)], 0.0, 1.0) == []


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_body_clipped_to_a_slab_is_seen_whole(seed):
    """Oracle: points inside the body and the slab lie in the outline; each corner of the outline belongs to a point of both."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(rng.integers(4, 12), 3))
    low, high = np.sort(rng.uniform(-1, 1, 2))
    outline = hull(clipped(corners, low, high))
    points = rng.dirichlet(np.ones(len(corners)), 400) @ corners
    points = points[(points[:, 0] >= low) & (points[:, 0] <= high)]
    if len(outline) < 3:
        assert not len(points)
        return
    polygon = shapely.Polygon(outline)
    assert polygon.is_valid and polygon.exterior.is_ccw
    assert shapely.distance(shapely.points(points[:, 1:]), polygon).max(initial=0.0) < 1e-9


def draw_end(rng, part):
    """The part anywhere above a table among blocks, half of the time with a depth map of steps and holes."""
    T = from_xyz_rpy((*rng.uniform((0.4, -0.1), (0.5, 0.1)), rng.uniform(0.0, 0.12)), rng.uniform(-np.pi, np.pi, 3))
    sizes, places = rng.uniform(0.01, 0.06, (3, 3)), T[:3, 3] + rng.normal(size=(3, 3)) * 0.06
    blocks = tuple(Block(f"block {k}", sizes[k], from_xyz_rpy(places[k], rng.uniform(-3, 3, 3))) for k in range(3))
    field = None
    if rng.random() < 0.5:
        top = np.zeros((120, 120))
        for j, i in rng.integers(0, 100, (3, 2)):
            top[j : j + 15, i : i + 20] = rng.uniform(0.01, 0.15)
        top[rng.integers(0, 120, 5), rng.integers(0, 120, 5)] = np.nan
        field = HeightField(top, 0.002, from_xyz_rpy((T[0, 3] - 0.12, T[1, 3] - 0.12, 0.0), (0, 0, rng.uniform(-0.3, 0.3))))
    return GraspEnd(World(ROBOT, blocks=blocks, terrain=field, parts=(PlacedPart("part#1", part, T),)), T)


def gap(end, T_world_hand, opening, allowed=()):
    """Distance [m] of the hand to everything, by the exact collision model; 0 where it meets something."""
    model = collision_model(end.world)
    bodies = model.bodies(None, hand_only=True)
    poses = np.zeros((model.arm.n + 1, 4, 4))
    poses[-1] = T_world_hand @ inverse(model.arm.T_last_hand)
    placing = bodies.place(poses, opening)
    return least_clearance(bodies.shapes, placing.corners, model.scene(None, allowed), 1e3)[0]


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_every_angle_that_is_left_is_free_and_what_is_forbidden_is_near_something(seed):
    """Oracle: the collision model at many angles and openings. Margins are square at the hand's corners and a step wide for columns."""
    rng = np.random.default_rng(seed)
    part = LIBRARY.part(str(rng.choice(sorted(LIBRARY.part_files()))))
    ends = draw_end(rng, part), draw_end(rng, part)
    groups, _ = grasp_groups(part, HAND)
    group = groups[rng.integers(len(groups))]
    width, opening = group.grasp_class.width, group.opening(HAND)
    rotations = legal_rotations(group, *ends)
    for name, end in zip(("pickup", "putdown"), ends, strict=True):
        free, slack = rotations.ranges(name), 0.0008 + (0.005 if end.world.terrain else 0.0)
        for angle in np.linspace(rotations.low, rotations.high, 9):
            T = end.hand_pose(group, angle)
            between = min(gap(end, T, apart, TOUCHED) for apart in np.linspace(width, opening, 4))
            if any(low <= angle <= high for low, high in free):
                assert gap(end, T, opening) >= HAND_MARGIN_M - 1e-9 and between > 0
                assert contact_area(group.grasp_class, HAND, group.point, angle) >= 0.99 * HAND.min_contact_area
            elif contact_area(group.grasp_class, HAND, group.point, angle) > 1.2 * HAND.min_contact_area:
                assert min(between, gap(end, T, opening)) < HAND_MARGIN_M + slack
                assert rotations.bodies_at(angle, name)


def test_carrying_the_putdown_into_the_pickups_frame_is_the_same():
    """§5.1, Figure 8: a putdown's wall, carried through the inverse of the part's motion, forbids the same angles at the pickup."""
    part = LIBRARY.part("brick")
    start, goal = from_xyz_rpy((0.48, 0.0, 0.3)), from_xyz_rpy((0.40, 0.25, 0.30), (0, 0.4, 0.7))
    wall = Block("wall", np.array((0.05, 0.05, 0.10)), from_xyz_rpy((0.44, 0.27, 0.33)))
    carried = Block("wall", wall.size, start @ inverse(goal) @ wall.T_world_block)
    there, here = (GraspEnd(World(ROBOT, blocks=(b,), parts=(PlacedPart("b", part, T),)), T) for b, T in ((wall, goal), (carried, start)))
    seen = 0
    for group in grasp_groups(part, HAND)[0]:
        rotations = legal_rotations(group, here, there)
        ranges = [[(f.low, f.high) for f in rotations.forbidden if f.end == end and f.body == "wall"] for end in ("pickup", "putdown")]
        assert np.allclose(*ranges, atol=1e-9) if ranges[0] else not ranges[1]
        seen += len(ranges[0])
    assert seen > 5


def test_a_wall_forbids_one_side_and_the_hand_goes_to_the_other():
    part, T = LIBRARY.part("brick"), from_xyz_rpy((0.48, 0.0, 0.015))
    group = upright_group(part, T)
    free = GraspEnd(World(ROBOT, parts=(PlacedPart("b", part, T),)), T)
    assert np.isclose(legal_rotations(group, free, free).best(1)[0], group.angle) and legal_rotations(group, free, free).fault() is None
    across = T[:3, :3] @ group.grasp_class.T_part_plane[:3, :3] @ (0.0, -np.sin(group.angle), np.cos(group.angle))
    wall = Block("wall", np.array((0.2, 0.2, 0.3)), from_xyz_rpy((*(T[:3, 3] + 0.118 * across)[:2], 0.15)))
    walled = GraspEnd(World(ROBOT, blocks=(wall,), parts=(PlacedPart("b", part, T),)), T)
    rotations = legal_rotations(group, walled, free)
    assert rotations.ranges() == rotations.ranges("pickup") != rotations.ranges("putdown")
    tilted = {f.body for f in rotations.forbidden if f.end == "pickup"}
    assert "wall" in tilted
    (chosen,) = rotations.best(1)
    off = hand_in_plane(group.point, chosen, 1)[1:3, 2] @ (-np.sin(group.angle), np.cos(group.angle))
    assert off >= 0, "the hand, which is behind the fingers, leans away from the wall"


def upright_group(part, T):
    groups, _ = grasp_groups(part, HAND)
    return min(groups, key=lambda g: (T @ g.grasp_class.T_part_plane @ hand_in_plane(g.point, g.angle, 1))[2, 2])


@pytest.mark.parametrize(("walled", "words"), [((1, 0), "at the pickup"), ((0, 1), "at the putdown"), ((1, 1), "at the pickup")])
def test_a_group_that_falls_says_which_end_forbids_it_and_by_what(walled, words):
    part, T = LIBRARY.part("brick"), from_xyz_rpy((0.48, 0.0, 0.015))
    top = np.full((100, 100), 0.2)
    top[35:65, 30:70] = 0.0
    field = HeightField(top, 0.002, from_xyz_rpy((0.38, -0.1, 0.0)))
    ends = [GraspEnd(World(ROBOT, terrain=field if wall else None, parts=(PlacedPart("b", part, T),)), T) for wall in walled]
    rotations = legal_rotations(upright_group(part, T), *ends)
    fault = rotations.fault()
    assert not rotations.legal and rotations.best(3) == [] and fault is not None
    assert fault.reason == f"the hand collides at every angle {words}" and "depth map" in fault.bodies
    assert fault.value >= fault.limit - 1e-6 and words.endswith(fault.end)
    assert "depth map" in rotations.bodies_at(fault.angle, fault.end)


def test_ends_that_leave_no_angle_in_common_say_so():
    part, T = LIBRARY.part("brick"), from_xyz_rpy((0.48, 0.0, 0.015))
    group = upright_group(part, T)
    across = T[:3, :3] @ group.grasp_class.T_part_plane[:3, :3] @ (0.0, -np.sin(group.angle), np.cos(group.angle))
    ends = []
    for side in (-1, 1):
        wall = Block("wall", np.array((0.2, 0.2, 0.3)), from_xyz_rpy((*(T[:3, 3] + side * 0.113 * across)[:2], 0.15)))
        ends.append(GraspEnd(World(ROBOT, blocks=(wall,), parts=(PlacedPart("b", part, T),)), T))
    rotations = legal_rotations(group, *ends)
    assert rotations.ranges("pickup") and rotations.ranges("putdown") and not rotations.legal
    fault = rotations.fault()
    assert fault is not None and fault.reason == "no hand angle is legal at pickup and putdown together"
    assert fault.bodies == ("wall",)
