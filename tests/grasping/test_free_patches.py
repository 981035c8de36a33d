import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry import HeightField, box
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse
from handey_studio.grasping import PatchOptions, Wanted, free_patches, grasp_placement_table, stable_placements
from handey_studio.grasping.solid_heights import body_cells, body_planes, solid_heights
from handey_studio.world import Block, Library, Part, PlacedPart, World
from handey_studio.world.collision import collision_model
from handey_studio.world.support import neighbours

LIBRARY = Library.choose()
ROBOT = LIBRARY.robot("ur5")
L_BLOCK = LIBRARY.part("l_block")
FLAT = stable_placements(L_BLOCK)[0][0].T_plane_part
TOP = stable_placements(LIBRARY.part("brick"))[0][0].T_plane_part
T_RANGE = from_xyz_rpy((0.25, -0.25, 0.0))
CELL = 0.005


def field(top):
    return HeightField(top, CELL, T_RANGE)


def scattered(seed, count=14):
    rng = np.random.default_rng(seed)
    top = rng.normal(0.0, 0.0003, (100, 100))
    for _ in range(count):
        (i, k), (a, b) = rng.integers(0, 90, 2), rng.integers(4, 15, 2)
        top[i : i + a, k : k + b] = rng.uniform(0.01, 0.10)
    return field(top)


def first_grasp(row=0):
    table = grasp_placement_table(L_BLOCK, ROBOT.hand)
    column = int(np.argmin(np.where(table.legal[row], table.tilts[row], np.inf)))
    return Wanted(table.Ts_part_hand[column], float(table.openings[column]))


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10**6))
def test_the_part_stands_free_and_the_hand_fits_around_it_and_reaches_it(seed):
    """Oracle: the exact collision model, of which the search knows nothing."""
    world, want = World(ROBOT, terrain=scattered(seed)), first_grasp()
    options = PatchOptions()
    found, _ = free_patches(world, L_BLOCK, FLAT, (want,), np.array([0.5, 0.0]), options)
    assert len(found) == options.count
    for k, patch in enumerate(found):
        placed = PlacedPart("l_block#1", L_BLOCK, patch.T_world_part)
        assert {n.name for n in neighbours(world, placed, 0.004)} <= {"table", "depth map"}
        assert all(n.gap > -0.0012 for n in neighbours(world, placed, 0.004))
        above = placed.corners_world[:, 2].min()
        assert abs(above) < 1e-9
        clear = collision_model(world.with_part(placed)).hand_contact(patch.T_world_part @ want.T_part_hand, want.opening)
        assert clear.distance > 0.0015
        gaps = [np.linalg.norm(patch.T_world_part[:2, 3] - other.T_world_part[:2, 3]) for other in found[:k]]
        assert min(gaps, default=1.0) >= options.spacing


def test_where_nothing_was_read_nothing_is_put():
    top = np.full((100, 100), 0.3)
    world = World(ROBOT, terrain=field(top), free_space=np.array([[0.25, -0.25, -0.2], [0.75, 0.25, 1.6]]))
    found, entries = free_patches(world, L_BLOCK, FLAT)
    assert not found and any(entry.reason == "it is no table there, or not level" for entry in entries)
    unseen = top.copy()
    unseen[40:60, 40:60] = np.inf
    assert not free_patches(World(ROBOT, terrain=field(unseen), free_space=world.free_space), L_BLOCK, FLAT)[0]
    hole = top.copy()
    hole[39:61, 39:61] = 0.0
    open_there = World(ROBOT, terrain=field(hole), free_space=world.free_space)
    found, _ = free_patches(open_there, L_BLOCK, FLAT)
    assert found
    for patch in found:
        corners = apply(patch.T_world_part, L_BLOCK.solid.vertices)[:, :2]
        assert (corners > (0.445, -0.055)).all() and (corners < (0.555, 0.055)).all()
    assert not free_patches(open_there, L_BLOCK, FLAT, (first_grasp(),))[0], "between the walls the hand has no room"


def test_a_grasp_from_below_the_table_finds_no_patch():
    want = first_grasp()
    from_below = Wanted(np.array(inverse(FLAT) @ np.diag([1.0, -1.0, -1.0, 1.0]) @ FLAT @ want.T_part_hand), want.opening)
    found, entries = free_patches(World(ROBOT), L_BLOCK, FLAT, (from_below,))
    assert not found and {entry.reason for entry in entries} == {"something stands where the hand would"}


@pytest.mark.parametrize("kind", ["depth map", "block", "part"])
def test_a_level_height_will_do_if_the_table_does_not(kind):
    sharp = np.full((100, 100), 0.01)
    sharp[::4] = 0.03
    free = np.array([[0.25, -0.25, -0.2], [0.75, 0.25, 1.6]])
    part, T = Part("slab", box((0.14, 0.14, 0.05))), from_xyz_rpy((0.5, 0.0, 0.03), (0.0, 0.0, 0.3))
    world = World(ROBOT, terrain=field(sharp), free_space=free)
    if kind == "depth map":
        raised = sharp + np.random.default_rng(0).normal(0.0, 0.0002, sharp.shape)
        raised[36:64, 36:64] = 0.055 + raised[36:64, 36:64] * 0.01
        world = World(ROBOT, terrain=field(raised), free_space=free)
    elif kind == "block":
        world = World(ROBOT, terrain=field(sharp), free_space=free, blocks=(Block("stand", (0.14, 0.14, 0.05), T),))
    else:
        world = world.with_part(PlacedPart("slab#1", part, T))
    assert not free_patches(world, L_BLOCK, FLAT)[0]
    found, _ = free_patches(world, L_BLOCK, FLAT, (first_grasp(),), options=PatchOptions(raised=True))
    assert found and len(free_patches(world, L_BLOCK, FLAT, options=PatchOptions(raised=True, count=1))[0]) == 1
    for patch in found:
        assert not patch.on_table and abs(patch.height - 0.055) < 0.002
        assert np.isclose(apply(patch.T_world_part, L_BLOCK.solid.vertices)[:, 2].min(), patch.height)
        corners = apply(patch.T_world_part, L_BLOCK.solid.vertices)[:, :2]
        assert np.linalg.norm(corners - (0.5, 0.0), axis=1).max() < 0.1


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_no_point_of_a_body_is_missed_by_its_cells(seed, upper):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(8, 3)) * 0.03
    lower, covered, limit = body_cells(corners, body_planes(corners), np.zeros(2), 0.005, upper)
    points = rng.dirichlet(np.full(8, 0.3), 2000) @ corners
    cells = np.floor(points[:, :2] / 0.005).astype(int) - lower
    assert covered[cells[:, 0], cells[:, 1]].all()
    beyond = points[:, 2] - limit[cells[:, 0], cells[:, 1]]
    assert ((beyond <= 1e-9) if upper else (beyond >= -1e-9)).all()


def test_heights_hold_all_that_stands_on_the_table():
    placed = PlacedPart("brick#1", LIBRARY.part("brick"), from_xyz_rpy((0.4, 0.1, 0.2)) @ TOP)
    world = World(ROBOT, parts=(placed,), terrain=scattered(5))
    ground = solid_heights(world, (-1.3, 1.3), (-0.5, 0.5), 0.01)
    assert np.isinf(ground.heights[:9]).all() and np.isfinite(ground.heights[15:-15]).all()
    at = np.floor((placed.corners_world[:, :2] - ground.origin) / ground.cell).astype(int)
    assert (ground.heights[at[:, 0], at[:, 1]] >= placed.corners_world[:, 2] - 1e-9).all()
    j, i = np.nonzero(world.terrain.top > 0.005)
    points = apply(T_RANGE, np.c_[(i + 0.5) * CELL, (j + 0.5) * CELL, world.terrain.top[j, i]])
    at = np.floor((points[:, :2] - ground.origin) / ground.cell).astype(int)
    assert (ground.heights[at[:, 0], at[:, 1]] >= points[:, 2] - 1e-9).all()
    assert ground.seen.any() and not ground.seen.all()
