"""The search in the grasp plane, and the ways in and out that it helps to find."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse
from handey_studio.grasping import (
    GraspPlane,
    SearchOptions,
    contact_area,
    fill_grasp_plane,
    grasp_groups,
    hand_in_plane,
    hand_outline,
    outline_with,
    plan_grasp_motion,
    plan_removal,
    plan_retreat,
    plane_space,
)
from handey_studio.grasping.grasp_plane import CELL_M, half_size
from handey_studio.grasping.hand_outline import VOLUMES, overlaps
from handey_studio.grasping.plane_search import BIN_M, beyond, way_out
from handey_studio.world import Block, Held, Library, PlacedPart, World
from handey_studio.world.collision import collision_model

LIBRARY = Library.choose()
ROBOT = LIBRARY.robot("ur5")
HAND = ROBOT.hand
HALF_SIZE_M = half_size(HAND)
BRICK = LIBRARY.part("brick")
GROUP = grasp_groups(BRICK, HAND)[0][0]
ALONG = np.array([np.cos(GROUP.angle), np.sin(GROUP.angle)])
ROOT = np.array([*GROUP.point, GROUP.angle])
SMALL = replace(HAND, finger_length=0.012, finger_width=0.008, crosspiece_height=0.006, crosspiece_width=0.014, mount_radius=0.0,
                T_flange_hand=from_xyz_rpy((0.0, 0.0, 0.018)))  # fmt: skip
COARSE = SearchOptions(step=0.003, turn=np.deg2rad(15.0), radius=0.02, reach=np.deg2rad(45.0), out=0.016)


def plane_of(fingers, crosspiece=None, origin=None, held=None):
    origin = GROUP.point - HALF_SIZE_M if origin is None else origin
    crosspiece = fingers if crosspiece is None else crosspiece
    extra = {} if held is None else {"held": held}
    return GraspPlane(np.eye(4), origin, CELL_M, fingers, crosspiece, **extra)


def empty():
    n = round(2 * HALF_SIZE_M / CELL_M)
    return np.zeros((n, n), dtype=bool)


def filled_at(*boxes):
    """A grid with boxes (from and to across the grasp's direction, from and to behind the grasp point) [m] filled."""
    grid = empty()
    i, k = np.indices(grid.shape)
    points = np.stack([i + 0.5, k + 0.5], axis=-1) * CELL_M - HALF_SIZE_M
    across, behind = points @ np.array([-ALONG[1], ALONG[0]]), -points @ ALONG
    for a0, a1, b0, b1 in boxes:
        grid |= (across >= a0) & (across <= a1) & (behind >= b0) & (behind <= b1)
    return grid


def outlines(hand, pose):
    """The hand's rectangles as polygons."""
    along = np.array([np.cos(pose[2]), np.sin(pose[2])])
    across = np.array([-along[1], along[0]])
    corners = [[(a0, b0), (a1, b0), (a1, b1), (a0, b1)] for a0, a1, b0, b1 in hand_outline(hand).bounds]
    return [shapely.Polygon([pose[:2] + a * across + b * along for a, b in four]) for four in corners]


def squares(grid, origin):
    cells = origin + np.argwhere(grid) * CELL_M
    return shapely.union_all([shapely.box(y, z, y + CELL_M, z + CELL_M) for y, z in cells])


def naive_reached(space, clearances, least):
    """Nodes that can be reached from the middle, by plain flooding, where the hand is at least so far from filled cells."""
    todo = [tuple(n // 2 for n in space.blocked.shape)]
    seen = {todo[0]} if clearances[todo[0]] >= least else set()
    todo = list(seen)
    while todo:
        k, i, j = todo.pop()
        near = [(k + 1, i, j), (k - 1, i, j)] + [(k, i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
        for other in near:
            if other in clearances and clearances[other] >= least and other not in seen:
                seen.add(other)
                todo.append(other)
    return seen


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10**6))
def test_the_search_agrees_with_an_exhaustive_one(seed):
    """Oracle: the exact distance from the hand to the filled cells at every pose of the lattice, flooded naively. What is out of reach with
    the least margin must be out of the search's reach; what can be reached with all its allowances must be in it."""
    rng = np.random.default_rng(seed)
    grid, origin = np.zeros((60, 60), dtype=bool), np.full(2, -0.06)
    for _ in range(5):
        (i, k), (a, b) = rng.integers(8, 52, 2), rng.integers(1, 10, 2)
        grid[i : i + a, k : k + b] = True
    root = np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    space = plane_space(plane_of(grid, origin=origin), hand_outline(SMALL), root, COARSE)
    solid = squares(grid, origin)
    nodes = [tuple(n) for n in np.argwhere(np.ones_like(space.blocked)) if np.hypot(*(n[1:] - space.blocked.shape[1] // 2)) <= 6]
    clearances = {n: min(solid.distance(p) for p in outlines(SMALL, space.poses(np.array(n)))) for n in nodes}
    margin = max(COARSE.margin, COARSE.step / 2)
    for node in nodes:
        if not space.blocked[node]:
            assert clearances[node] > margin - 1e-9
    tight = naive_reached(space, clearances, margin)
    wide = naive_reached(space, clearances, np.sqrt(2) * (margin + BIN_M + CELL_M))
    middle = np.array(space.blocked.shape) // 2
    found = way_out(space, middle[None], np.where(beyond(space, COARSE.out), 0.0, np.inf)[None])

    def leads_out(reached):
        return any(np.hypot(*(np.array(n)[1:] - middle[1:])) * COARSE.step >= COARSE.out for n in reached)

    assert len(found) or not leads_out(wide)
    assert leads_out(tight) or not len(found)
    for one, other in pairwise(found):  # also between its poses
        for share in np.linspace(0.0, 1.0, 5):
            pose = space.poses(one) * (1 - share) + space.poses(other) * share
            assert min(solid.distance(p) for p in outlines(SMALL, pose)) > 0.0


def never_overlaps(plane, path, margin=0.0):
    return not any(overlaps(plane, hand_outline(HAND), pose, margin) for pose in path)


def test_bump_lines_alone_where_the_way_is_free():
    run = plan_grasp_motion(plane_of(filled_at((0.03, 0.06, -0.05, 0.02))), HAND, GROUP, GROUP.angle)
    assert run.status == "reached" and run.found_by == "bump lines"
    record = run.iterations
    assert record is not None and len(record.colliding) == len(record.poses) == len(record.free) == len(record.rules)
    assert record.multipliers.shape == record.colliding.shape and np.allclose(np.linalg.norm(record.free, axis=1), 1.0)


POCKET = filled_at((-0.20, -0.014, -0.05, 0.012), (0.014, 0.20, -0.05, 0.012))  # around the fingertips, for the fingers


def test_another_start_escapes_a_bar_across_the_straight_way():
    plane = plane_of(empty(), filled_at((-0.2, 0.005, 0.16, 0.17)))
    run = plan_grasp_motion(plane, HAND, GROUP, GROUP.angle)
    assert run.status == "reached" and run.found_by == "another start" and never_overlaps(plane, run.path)


def test_the_search_leads_out_of_a_pocket_below_a_roof():
    """The fingertips stand in a pocket, and a roof hangs over the hand: a bit straight back, then aside below the roof."""
    plane = plane_of(POCKET, filled_at((-0.20, 0.20, 0.15, 0.16)))
    run = plan_grasp_motion(plane, HAND, GROUP, GROUP.angle)
    assert run.status == "reached" and run.found_by == "plane search"
    assert never_overlaps(plane, run.path) and np.allclose(run.path[-1], ROOT)
    out = plan_retreat(plane, HAND, ROOT)
    assert out.status == "reached" and np.allclose(out.path[0], ROOT) and never_overlaps(plane, out.path)


def test_walled_in_there_is_no_way_and_it_says_so():
    plane = plane_of(POCKET | filled_at((-0.2, 0.2, -0.05, -0.01)), filled_at((-0.2, 0.2, 0.125, 0.14)))
    assert plan_grasp_motion(plane, HAND, GROUP, GROUP.angle).status == "no way"
    assert plan_retreat(plane, HAND, ROOT).status == "no way"


def test_a_hand_that_stands_nearer_to_something_than_a_cell_gets_in_and_out():
    """Walls beside the fingers whose cells reach into the hand's outline, though the walls themselves may not."""
    plane = plane_of(filled_at((-0.20, -0.0095, -0.05, 0.03), (0.0095, 0.20, -0.05, 0.03)), empty())
    assert overlaps(plane, hand_outline(HAND), ROOT)
    run, out = plan_grasp_motion(plane, HAND, GROUP, GROUP.angle), plan_retreat(plane, HAND, ROOT)
    assert run.status == out.status == "reached" and run.found_by == out.found_by == "plane search"
    assert np.allclose(run.path[-1], ROOT) and np.allclose(out.path[0], ROOT)
    for path in (run.path, out.path):
        assert never_overlaps(plane, path, -CELL_M)
        tight = np.linalg.norm(path[:, :2] - ROOT[:2], axis=1) < 0.025
        assert np.allclose((path[tight, :2] - GROUP.point) @ np.array([-ALONG[1], ALONG[0]]), 0.0, atol=1e-3)


def test_a_way_ends_at_a_legal_angle_with_enough_contact():
    plane = plane_of(filled_at((0.012, 0.06, 0.02, 0.1)))
    for low, high in ((-0.05, 0.05), (-0.6, 0.6)):
        ranges = np.array([[GROUP.angle + low, GROUP.angle + high]])
        run = plan_grasp_motion(plane, HAND, GROUP, GROUP.angle, ranges)
        if run.status == "reached":
            assert GROUP.angle + low - 1e-6 <= run.path[-1, 2] <= GROUP.angle + high + 1e-6
            assert contact_area(GROUP.grasp_class, HAND, run.path[-1, :2], run.path[-1, 2]) >= HAND.min_contact_area
    assert plan_grasp_motion(plane_of(empty()), HAND, GROUP, GROUP.angle, np.array([[3.0, 3.1]])).status != "reached"


def test_free_ways_are_straight():
    plane = plane_of(empty())
    run, out = plan_grasp_motion(plane, HAND, GROUP, GROUP.angle), plan_retreat(plane, HAND, ROOT)
    assert out.found_by == "straight back" and np.allclose(out.path[-1, :2], GROUP.point - 0.08 * ALONG)
    for path in (run.path, out.path):
        assert np.allclose((path[:, :2] - GROUP.point) @ np.array([-ALONG[1], ALONG[0]]), 0.0, atol=2e-3)
        assert np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).max() <= 0.0021


BIT_M = 0.012  # the part in hand has been lifted by so much


def held_above(world, yaw=0.0):
    """A brick in the hand from above, a bit over the table: its grasp plane with both filled in, their outline, and the pose there."""
    T_world_part = from_xyz_rpy((0.5, 0.0, 0.015 + BIT_M), (0.0, 0.0, yaw))
    group = min(
        grasp_groups(BRICK, HAND)[0], key=lambda g: (T_world_part @ g.grasp_class.T_part_plane @ hand_in_plane(g.point, g.angle, 1))[2, 2]
    )
    held = Held("brick#1", BRICK, inverse(group.grasp_class.T_part_plane @ hand_in_plane(group.point, group.angle, 1)))
    outline, ends = outline_with(HAND, held)
    width = group.grasp_class.width
    plane = fill_grasp_plane(world, T_world_part @ group.grasp_class.T_part_plane, group.point, HAND, width, ends)
    return plane, outline, np.array([*group.point, group.angle]), held, width


def clearances(world, plane, path, held, width, up=0.0):
    """Oracle: how far hand and part are from everything by the exact collision model, so much higher."""
    hands = [plane.T_world_plane @ hand_in_plane(pose[:2], pose[2], 1) for pose in path]
    return [collision_model(world).hand_contact(from_xyz_rpy((0, 0, up)) @ hand, width, held, limit=0.01).distance for hand in hands]


def board(plane, low, high, z, name="board"):
    """A board over the plane, from low to high [m] along the plane's horizontal direction, with its underside at z."""
    level = plane.T_world_plane[:3, 1 + int(np.argmin(np.abs(plane.T_world_plane[2, 1:3])))]
    T = from_xyz_rpy((*((0.5, 0.0) + (low + high) / 2 * level[:2]), z + 0.005), (0.0, 0.0, np.arctan2(level[1], level[0])))
    return Block(name, np.array([high - low, 0.3, 0.01]), T)


@pytest.mark.parametrize(
    ("low", "high", "status"), [(0.2, 0.3, "reached"), (-0.3, 0.03, "reached"), (-0.12, 0.12, "reached"), (-0.6, 0.6, "no way")]
)
def test_a_part_in_hand_is_led_out_from_under_a_board(low, high, status):
    """Hand and part stay clear of all on the way, and at its end nothing is above them; under a board without end there is no way out."""
    above = board(held_above(World(ROBOT))[0], low, high, 0.20)
    world = World(ROBOT, blocks=(above,))
    plane, outline, pose, held, width = held_above(world)
    assert plane.held.any()
    run = plan_removal(plane, outline, pose)
    assert run.status == status
    if status == "reached":
        assert np.allclose(run.path[0], pose) and (low > 0.1) <= (run.found_by == "bump lines")
        assert min(clearances(world, plane, run.path, held, width)) > 0.0
        assert min(min(clearances(world, plane, run.path[-1:], held, width, up)) for up in np.arange(0.0, 0.4, 0.005)) > 0.0
        assert np.array_equal(run.reversed().path, run.path[::-1]) and np.array_equal(run.reversed().goal, pose[:2])


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10**6))
def test_a_removal_is_free_in_the_world_and_ends_in_the_open(seed):
    rng = np.random.default_rng(seed)
    blocks = tuple(
        Block(f"b{k}", rng.uniform(0.02, 0.09, 3), from_xyz_rpy((0.5 + x, y, rng.uniform(0.02, 0.24)), (0, 0, rng.uniform(-3, 3))))
        for k, (x, y) in enumerate(rng.uniform(-0.2, 0.2, (7, 2)))
    )
    world = World(ROBOT, blocks=blocks)
    plane, outline, pose, held, width = held_above(world, rng.uniform(-3, 3))
    if min(clearances(world, plane, pose[None], held, width)) < 0.006:
        return
    run = plan_removal(plane, outline, pose)
    assert run.status in ("reached", "no way")
    if run.status == "reached":
        assert min(clearances(world, plane, run.path, held, width)) > -0.0005
        assert min(min(clearances(world, plane, run.path[-1:], held, width, up)) for up in np.arange(0.0, 0.4, 0.005)) > -0.0005


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_strips_cover_what_is_held(seed):
    rng = np.random.default_rng(seed)
    part = LIBRARY.part(str(rng.choice(["l_block", "wedge", "t_block"])))
    group = grasp_groups(part, HAND)[0][int(rng.integers(10))]
    side = int(rng.choice([1, -1]))
    T_plane_hand = hand_in_plane(group.point, group.angle, side)
    held = Held("it", part, inverse(group.grasp_class.T_part_plane @ T_plane_hand))
    outline, (low, high) = outline_with(HAND, held, side)
    points = np.concatenate([rng.dirichlet(np.ones(len(piece)), 200) @ piece for piece in part.pieces])
    local = apply(inverse(group.grasp_class.T_part_plane), points)
    assert (local[:, 0] >= low - 1e-9).all() and (local[:, 0] <= high + 1e-9).all()
    along = np.array([np.cos(group.angle), np.sin(group.angle)])
    a, b = (local[:, 1:] - group.point) @ np.array([-along[1], along[0]]), (local[:, 1:] - group.point) @ along
    strips = outline.bounds[outline.volumes == VOLUMES.index("held")]
    beyond = np.maximum.reduce([strips[:, 0] - a[:, None], a[:, None] - strips[:, 1], strips[:, 2] - b[:, None], b[:, None] - strips[:, 3]])
    assert (beyond.min(axis=1) <= 1e-9).all()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_no_intrusion_of_a_solid_is_missed(seed):
    """Oracle: random points of random blocks, sorted into the volumes one by one."""
    rng = np.random.default_rng(seed)
    T_world_plane = from_xyz_rpy((0.5, 0.0, 0.1), rng.uniform(-np.pi, np.pi, 3))
    blocks = tuple(
        Block(f"b{k}", rng.uniform(0.01, 0.1, 3), T_world_plane @ from_xyz_rpy(rng.uniform(-0.12, 0.12, 3), rng.uniform(-3, 3, 3)))
        for k in range(3)
    )
    plane = fill_grasp_plane(World(ROBOT, table_z=0.0, blocks=blocks), T_world_plane, np.zeros(2), HAND, 0.05)
    points = np.concatenate([apply(block.T_world_block, rng.uniform(-0.5, 0.5, (400, 3)) * block.size) for block in blocks])
    local = apply(inverse(T_world_plane), points)
    local = local[(np.abs(local[:, 1:]) < HALF_SIZE_M).all(axis=1)]
    beside = (np.abs(local[:, 0]) >= 0.025) & (np.abs(local[:, 0]) <= 0.025 + HAND.finger_thickness)
    assert plane.is_filled("fingers", local[beside][:, 1:]).all()
    for volume, half in (("crosspiece", HAND.crosspiece_length / 2), ("mount", HAND.mount_radius)):
        assert plane.is_filled(volume, local[np.abs(local[:, 0]) <= half][:, 1:]).all()
    assert not (plane.mount & ~plane.crosspiece).any(), "the mount is narrower than the crosspiece"


def cluttered(seed):
    """A brick on the table, known blocks in the air and unknown ones standing around it."""
    rng = np.random.default_rng(seed)
    top, T_range = np.zeros((120, 120)), from_xyz_rpy((0.38, -0.12, 0.0))
    for x, y in rng.uniform(-0.1, 0.1, (8, 2)):
        if np.hypot(x, y) > 0.055:
            (j, i), (a, b) = np.array([(y + 0.12) / 0.002, (x + 0.12) / 0.002]).astype(int), rng.integers(2, 9, 2)
            top[j - a : j + a, i - b : i + b] = rng.uniform(0.02, 0.12)
    blocks = tuple(
        Block(f"b{k}", rng.uniform(0.01, 0.05, 3), from_xyz_rpy((0.5 + x, y, rng.uniform(0.02, 0.14)), rng.uniform(-3, 3, 3)))
        for k, (x, y) in enumerate(rng.uniform(-0.12, 0.12, (4, 2)))
        if np.hypot(x, y) > 0.06
    )
    placed = PlacedPart("brick#1", BRICK, from_xyz_rpy((0.5, 0.0, 0.015), (0.0, 0.0, rng.uniform(-3, 3))))
    return World(ROBOT, blocks=blocks, parts=(placed,), terrain=HeightField(top, 0.002, T_range)), placed


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10**6))
def test_a_way_in_the_plane_is_a_way_in_the_world(seed):
    """Oracle: the exact collision model. A bit of a column, whose edge a ray does not show, may be in the way."""
    world, placed = cluttered(seed)
    model, tried = collision_model(world), 0
    for group in grasp_groups(BRICK, HAND)[0]:
        opening, T_world_plane = group.opening(HAND), placed.T_world_part @ group.grasp_class.T_part_plane
        T_world_hand = T_world_plane @ hand_in_plane(group.point, group.angle, 1)
        if tried == 4 or T_world_hand[2, 2] > -0.3 or not model.hand_contact(T_world_hand, opening, limit=0.001).distance >= 0.001:
            continue
        tried += 1
        plane = fill_grasp_plane(world, T_world_plane, group.point, HAND, opening)
        run = plan_grasp_motion(plane, HAND, group, group.angle)
        assert run.status in ("reached", "no way")
        for pose in run.path[::3]:
            if run.status == "reached":
                assert model.hand_contact(T_world_plane @ hand_in_plane(pose[:2], pose[2], 1), opening, limit=0.002).distance > -0.0005
