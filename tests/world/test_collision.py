"""Exact collision: the fast queries against naive ones, and the traps: hollow meshes, hulls of concave parts, thin contacts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from handey_studio.geometry import box, prism
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.world import FINGERS, Block, Held, Part, PlacedPart, World, arm_of
from handey_studio.world.collision import always_touching, collision_model
from handey_studio.world.gjk import distance
from handey_studio.world.overlap import column_depths, column_distances, depth, directions_of
from tests.motion.oracle import DOWN, ROBOT, Judge, scene

CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
L_BLOCK = Part("l", prism([(0, 0), (0.06, 0), (0.06, 0.03), (0.03, 0.03), (0.03, 0.06), (0, 0.06)], 0.03))


def naive_distance(one: np.ndarray, other: np.ndarray) -> float:
    """Least distance of two hulls as a non-negative least squares problem over their corners' weights."""
    heavy = 1e3
    a, b = len(one), len(other)
    rows = np.block([[one.T, -other.T], [heavy * np.ones((1, a)), np.zeros((1, b))], [np.zeros((1, a)), heavy * np.ones((1, b))]])
    weights, _ = nnls(rows, np.array([0, 0, 0, heavy, heavy]), maxiter=10_000)
    u, v = weights[:a] / weights[:a].sum(), weights[a:] / weights[a:].sum()
    return float(np.linalg.norm(one.T @ u - other.T @ v))


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans())
def test_distance_is_exact_and_never_too_large(seed, aligned, on_grid):
    rng = np.random.default_rng(seed)
    hulls = [hull for body in arm_of(ROBOT).bodies for hull in body.hulls]
    one = CUBE * rng.uniform(0.005, 0.5, 3) if rng.random() < 0.5 else np.array(hulls[rng.integers(len(hulls))])
    other = CUBE * rng.uniform(0.005, 0.5, 3) if rng.random() < 0.5 else np.array(hulls[rng.integers(len(hulls))])
    R = np.eye(3) if aligned else Rotation.random(rng=rng).as_matrix()
    shift = rng.uniform(-0.6, 0.6, 3)
    other = other @ R.T + (np.round(shift, 1) if on_grid else shift)
    found = distance(one, 0, len(one), other, 0, len(other), np.inf)
    truth = naive_distance(one, other)
    assert found <= truth + 1e-9
    assert found >= truth - 1e-6


def test_distance_stops_early_only_when_sure():
    one, other = CUBE.copy(), CUBE + np.array([2.0, 0.3, 0.1])
    assert distance(one, 0, 8, other, 0, 8, 0.5) >= 0.5
    assert distance(one, 0, 8, other, 0, 8, 1.5) == pytest.approx(1.0, abs=1e-8)


@settings(max_examples=60)
@given(seed=st.integers(0, 10_000))
def test_how_deep_two_bodies_overlap_is_the_depth_of_their_minkowski_difference(seed):
    rng = np.random.default_rng(seed)
    corners = [rng.uniform(-0.05, 0.05, (rng.integers(4, 9), 3)) for _ in range(2)]
    turns = [Rotation.random(rng=rng).as_matrix() for _ in range(2)]
    one, other = corners[0] @ turns[0].T, corners[1] @ turns[1].T + rng.uniform(-0.04, 0.04, 3)
    found = depth(one, directions_of(corners[0]), turns[0], other, directions_of(corners[1]), turns[1])
    assert found == pytest.approx(max(0.0, -ConvexHull((one[:, None] - other[None]).reshape(-1, 3)).equations[:, 3].max()), abs=1e-9)


def naive_clearance(world: World, q: np.ndarray, opening: float) -> float:
    """Every pair of bodies, one after the other, with poses from the arm's numpy kinematics; the depth map column by column."""
    model, arm = collision_model(world), arm_of(world.robot)
    poses = arm.link_poses(q)
    bodies = model.bodies(None)
    placed = [poses[piece.link][:3, :3] @ (piece.corners + piece.slide * opening).T + poses[piece.link][:3, 3:] for piece in model._pieces]
    placed = [np.ascontiguousarray(points.T) for points in placed]
    least = np.inf
    for fixed in (model.solids, model.terrain):
        for k in range(len(fixed.name)):
            theirs = fixed.corners[fixed.first[k] : fixed.first[k + 1]]
            least = min([least, *(distance(p, 0, len(p), theirs, 0, len(theirs), np.inf) for p in placed[1:])])
    for a, b in bodies.shapes.pairs:
        least = min(least, distance(placed[a], 0, len(placed[a]), placed[b], 0, len(placed[b]), np.inf))
    return least


def test_clearance_against_every_pair_one_by_one():
    world, rng = scene(1), np.random.default_rng(3)
    model = collision_model(world)
    for q in rng.uniform(-2.0, 2.0, (12, 6)):
        found, truth = model.clearance(q, 0.04), naive_clearance(world, q, 0.04)
        if truth > 0:
            assert found.distance == pytest.approx(truth, rel=1e-6)
        else:
            assert found.distance <= 0
        assert (model.in_contact(q, 0.04) is None) == (truth > 0)


def test_contact_agrees_with_fcl():
    world, rng = scene(2), np.random.default_rng(5)
    model, judge = collision_model(world), Judge(world, 0.05)
    postures = rng.uniform(-2.0, 2.0, (150, 6))
    free = 0
    for q in postures:
        mine = model.clearance(q, 0.05)
        if "outside" in mine.bodies or 0 < mine.distance < 0.004:
            continue  # the judge knows no outside, and its columns are not made coarser
        assert judge.meets(q) == (mine.distance <= 0), mine
        free += mine.distance > 0
    assert free > 10


def test_a_body_wholly_inside_another_collides():
    around = World(ROBOT, blocks=(Block("rock", [0.6, 0.6, 0.6], transform(None, [0.5, 0.0, 0.4])),))
    found = collision_model(around).hand_contact(transform(DOWN[:3, :3], [0.5, 0.0, 0.4]), 0.04)
    assert found.distance < -0.05
    assert "rock" in found.bodies


def test_the_notch_of_an_l_is_empty():
    """A concave part given as its hull would fill its notch."""
    placed = PlacedPart("l#1", L_BLOCK, np.eye(4))
    model = collision_model(World(ROBOT, table_z=-0.1, parts=(placed,)))
    tip = np.array([[0.04, 0.048, 0.01]])
    assert naive_distance(L_BLOCK.solid.vertices, tip) < 1e-6
    closed = model.hand_contact(transform(DOWN[:3, :3], tip[0]), 0.0)
    assert closed.distance == pytest.approx(0.04 - ROBOT.hand.finger_thickness - 0.03, abs=1e-6)


def test_held_part_and_allowed_pairs():
    part = Part("brick", box([0.04, 0.06, 0.05]))
    held = Held("brick#1", part, transform(None, [0.0, 0.0, -0.02]))
    hand = transform(DOWN[:3, :3], [0.45, 0.0, 0.0045])
    model = collision_model(World(ROBOT))
    assert model.hand_contact(hand, 0.04).bodies[0] in FINGERS
    sunk = model.hand_contact(hand, 0.04, held)
    assert sunk.bodies == ("brick#1", "table")
    assert sunk.distance == pytest.approx(-0.0005, abs=1e-6)
    allowed = model.hand_contact(hand, 0.04, held, [("table", "brick#1")])
    assert allowed.allowed_bodies == ("brick#1", "table")
    assert allowed.allowed_depth == pytest.approx(0.0005, abs=1e-6)
    assert allowed.keeps() and allowed.distance == pytest.approx(0.0045, abs=1e-6)
    deep = model.hand_contact(transform(DOWN[:3, :3], [0.45, 0.0, 0.0005]), 0.04, held, [frozenset(("table", "brick#1"))])
    assert deep.allowed_depth == pytest.approx(0.0045, abs=1e-6) and not deep.keeps()


def test_fingers_open():
    part = PlacedPart("brick#1", Part("brick", box([0.04, 0.03, 0.05])), transform(None, [0.45, 0.0, 0.025]))
    model = collision_model(World(ROBOT, parts=(part,)))
    hand = transform(DOWN[:3, :3], [0.45, 0.0, 0.02])
    for opening, gap in ((0.05, 0.005), (0.044, 0.002), (0.036, -0.002)):
        found = model.hand_contact(hand, opening)
        assert found.distance == pytest.approx(gap, abs=1e-6) and "brick#1" in found.bodies


def test_unread_columns_are_solid_to_the_ceiling():
    field = scene().terrain
    top = np.array(field.top)
    top[60:64, 60:64] = np.nan
    holed = type(field)(top, field.cell, field.T_world_range)
    hand = transform(DOWN[:3, :3], [*(field.T_world_range[:2, 3] + 62 * field.cell), 0.5])
    assert collision_model(World(ROBOT, terrain=field)).hand_contact(hand, 0.04).distance > 0.3
    assert collision_model(World(ROBOT, terrain=holed)).hand_contact(hand, 0.0).distance < 0


def test_no_pair_of_this_robot_always_touches_and_home_is_free():
    assert always_touching(ROBOT) == frozenset()
    assert collision_model(World(ROBOT)).clearance(ROBOT.home, ROBOT.hand.opening_max).keeps(0.01)


def test_a_turned_depth_map_stands_where_it_is():
    field = scene().terrain
    turned = type(field)(field.top, field.cell, from_xyz_rpy((0.5, 0.0, 0.0), (0.0, 0.0, 0.7)))
    j, i = np.unravel_index(np.argmax(field.top), field.top.shape)
    spot = turned.T_world_range @ [(i + 0.5) * field.cell, (j + 0.5) * field.cell, field.top[j, i] + 0.005, 1.0]
    found = collision_model(World(ROBOT, terrain=turned)).hand_contact(transform(DOWN[:3, :3], spot[:3]), 0.0)
    assert found.distance == pytest.approx(0.005, abs=5e-4) and found.bodies[1] == "depth map"


def test_faces_that_just_touch_are_not_deep():
    table = np.array([[x, y, z] for x in (-3.0, 3.0) for y in (-3.0, 3.0) for z in (-2.0, 0.0)])
    for yaw in np.linspace(0.0, 3.0, 13):
        brick = np.array([[x, y, z] for x in (-0.04, 0.04) for y in (-0.02, 0.02) for z in (-1e-5, 0.03)])
        c, s = np.cos(yaw), np.sin(yaw)
        brick = brick @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + (0.4, 0.3, 0.0)
        assert depth(brick, directions_of(brick), np.eye(3), table, directions_of(table), np.eye(3)) == pytest.approx(1e-5, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), sides=st.lists(st.floats(0.004, 0.08), min_size=3, max_size=3))
def test_a_bodys_depth_in_columns_is_that_of_the_minkowski_difference(seed, sides):
    """Boxes turned at random among columns: the origin's depth in the hull of all differences or the lift."""
    rng = np.random.default_rng(seed)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * sides - np.array(sides) / 2
    R, yaw = Rotation.random(rng=rng).as_matrix(), Rotation.from_euler("z", rng.uniform(0, 6)).as_matrix()
    body = corners @ R.T + rng.uniform(-0.02, 0.02, 3)
    low = np.c_[rng.uniform(-0.03, 0.03, (6, 2)), np.full(6, -0.5)]
    high = np.c_[low[:, :2] + 0.001, rng.uniform(-0.04, 0.04, 6)]
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    columns = np.where(pick[None], high[:, None], low[:, None]) @ yaw.T
    depths = column_depths(body, directions_of(corners), R, columns)
    gaps = column_distances(body, np.ascontiguousarray(columns), 1.0)
    for column, deep, gap in zip(columns, depths, gaps, strict=True):
        shift = -ConvexHull((body[:, None] - column[None]).reshape(-1, 3)).equations[:, 3].max()
        lift = column[:, 2].max() - body[:, 2].min()
        assert deep == pytest.approx(max(0.0, min(lift, shift)), abs=1e-7)
        assert gap == 0.0 or deep == 0.0
