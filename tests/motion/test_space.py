"""The distance field, the balls and the configuration space: what is called free is free."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from handey_studio.geometry import box
from handey_studio.geometry.transforms import inverse, transform
from handey_studio.motion import configuration_space as configuration_space_module
from handey_studio.motion.certificate import Mover, mover
from handey_studio.motion.configuration_space import ConfigurationSpace, configuration_space, extent_around
from handey_studio.motion.distance_field import clearance_at, column_distances, distance_field, faces_by_direction
from handey_studio.motion.regions import free_regions, nearest_cells, region_distances
from handey_studio.motion.search import find_cells
from handey_studio.motion.wrist_box import link_balls, wrist_box
from handey_studio.world import Held, Part, PlacedPart, arm_of
from handey_studio.world.collision import collision_model
from handey_studio.world.collision_bodies import held_pieces, robot_pieces
from handey_studio.world.gjk import distance
from tests.motion.oracle import ROBOT, scene

HELD = Held("brick#1", Part("brick", box([0.04, 0.09, 0.05])), transform(None, [0.0, 0.01, -0.01]))
WRISTS = np.array([ROBOT.home[3:], ROBOT.home[3:] + np.array([0.4, -0.5, 0.9])])
OWN = {body.name for body in arm_of(ROBOT).bodies} | {"mount", "crosspiece", "finger_left", "finger_right", "brick#1"}


def space_of(mine: Mover, wrists: np.ndarray, step_deg: float, around: np.ndarray | None = None) -> ConfigurationSpace:
    """The space of the test arm while its wrist runs through some postures."""
    step = float(np.deg2rad(step_deg))
    return configuration_space(mine, wrists, extent_around(ROBOT, step, around))[0]


def test_column_distances_against_every_voxel():
    rng = np.random.default_rng(0)
    tops = np.where(rng.random((13, 9)) < 0.1, rng.integers(1, 8, (13, 9)), 0)
    found = column_distances(tops, 11, 0.02, 0.1)
    cells = np.argwhere(np.arange(11)[None, None] < tops[:, :, None])
    gaps = np.maximum(np.abs(np.argwhere(np.ones((13, 9, 11)))[:, None] - cells[None]) - 1, 0) * 0.02
    truth = np.minimum(np.linalg.norm(gaps, axis=2).min(axis=1), 0.1).reshape(found.shape)
    assert found == pytest.approx(truth, abs=1e-6)


def test_faces_fall_into_orthogonal_groups():
    cuboid = np.array(box([0.1, 0.2, 0.3]).vertices)
    planes, groups = faces_by_direction(cuboid)
    assert planes.shape == (6, 4) and list(groups) == [0, 2, 4, 6]
    angles = np.arange(7) * 2 * np.pi / 7
    prism = np.concatenate([np.column_stack([np.cos(angles), np.sin(angles), np.full(7, z)]) for z in (0.0, 1.0)])
    planes, groups = faces_by_direction(prism)
    assert len(planes) == 9 and sorted(np.diff(groups)) == [2, 7]


def test_the_field_never_exceeds_the_distance_to_the_scene():
    world, rng = scene(4), np.random.default_rng(1)
    model, field = collision_model(world), distance_field(world, 1.5)
    slack = []
    for point in rng.uniform([-0.3, -0.7, 0.0], [0.9, 0.7, 0.8], (300, 3)):
        corner = np.ascontiguousarray(point[None])
        truth = min(
            distance(corner, 0, 1, fixed.corners, fixed.first[k], fixed.first[k + 1], np.inf)
            for fixed in (model.solids, model.terrain)
            for k in range(len(fixed.name))
        )
        bound = clearance_at(field, *point)
        assert bound <= truth + 1e-6
        slack.append(min(truth, field.clip) - bound)
    assert np.median(slack) < 0.03


def test_balls_enclose_the_arm_and_all_that_the_wrist_carries():
    carried, arm, rng = wrist_box(ROBOT, WRISTS, 0.06, HELD), arm_of(ROBOT), np.random.default_rng(2)
    centres, radii, links = link_balls(ROBOT)
    for share in rng.random(25):
        poses = arm.link_poses(np.r_[0.0, 0.0, 0.0, WRISTS[0] + share * (WRISTS[1] - WRISTS[0])])
        for piece in robot_pieces(ROBOT) + held_pieces(ROBOT, HELD):
            if piece.link == 0:
                continue
            points = rng.dirichlet(np.full(len(piece.corners), 0.3), 40) @ piece.corners + piece.slide * 0.06
            T = inverse(poses[min(piece.link, 3)]) @ poses[piece.link]
            points = points @ T[:3, :3].T + T[:3, 3]
            around = (centres[links == piece.link], radii[links == piece.link]) if piece.link <= 3 else (carried.centres, carried.radii)
            gaps = np.linalg.norm(points[:, None] - around[0][None], axis=2) - around[1]
            assert gaps.min(axis=1).max() <= 1e-9
            if piece.link > 3:
                low, high = carried.corners.min(axis=0), carried.corners.max(axis=0)
                assert (points >= low - 1e-9).all() and (points <= high + 1e-9).all()


@pytest.mark.parametrize(("held", "step_deg", "seed"), [(None, 5.0, 3), (HELD, 5.0, 1), (HELD, 2.5, 2)])
def test_a_free_cell_is_free_all_over(held, step_deg, seed):
    """The naive oracle: exact collision somewhere in the cell, at some place of the wrist's way."""
    rng = np.random.default_rng(4)
    stands = PlacedPart("stands", Part("stands", box([0.06, 0.06, 0.3])), transform(None, [0.35, 0.15, 0.15]))
    mine = mover(replace(scene(seed), parts=(stands,)), 0.05, held)
    space = space_of(mine, WRISTS, step_deg, np.array([ROBOT.home]))
    free = np.argwhere(~space.blocked)
    assert 0.02 < len(free) / space.blocked.size < 0.7
    for cell in free[rng.integers(len(free), size=400)]:
        q = np.empty(6)
        q[:3] = space.centre(cell) + rng.uniform(-0.5, 0.5, 3) * space.extent.step
        q[3:] = WRISTS[0] + rng.random() * (WRISTS[1] - WRISTS[0])
        clearance = mine.clearance(q)
        assert clearance.keeps(mine.margin) or set(clearance.bodies) <= OWN, clearance


def test_a_new_map_leaves_what_is_known_of_the_table():
    """The space after another look is that of a fresh process, though the table's cells are kept, at either step."""
    worlds = [replace(scene(2), terrain=scene(seed).terrain, parts=()) for seed in (2, 3)]
    configuration_space_module._scene_cells.cache_clear()  # other tests ask for these worlds too
    for step_deg in (5.0, 2.5):
        space_of(mover(worlds[0], 0.05), WRISTS, step_deg, np.array([ROBOT.home]))
        asked = configuration_space_module._scene_cells.cache_info().misses
        kept = space_of(mover(worlds[1], 0.05), WRISTS, step_deg, np.array([ROBOT.home]))
        assert configuration_space_module._scene_cells.cache_info().misses - asked == 1
        for cached in ("_scene_cells", "_link_cells"):
            getattr(configuration_space_module, cached).cache_clear()
        assert (space_of(mover(worlds[1], 0.05), WRISTS, step_deg, np.array([ROBOT.home])).blocked == kept.blocked).all()


def test_a_moved_part_costs_only_its_own():
    """The space after a part moved is that of a fresh process, though all that stays is kept; and both parts count, at either step."""
    brick = Part("brick", box([0.05, 0.08, 0.12]))
    here, there = (transform(None, [0.4, y, 0.06]) for y in (-0.1, 0.3))
    world = replace(scene(2), parts=(PlacedPart("brick#1", brick, here), PlacedPart("brick#2", brick, transform(None, [0.2, 0.4, 0.1]))))
    moved = world.with_part(PlacedPart("brick#1", brick, there))
    for step_deg in (5.0, 2.5):
        first = space_of(mover(world, 0.05), WRISTS, step_deg, np.array([ROBOT.home]))
        asked = configuration_space_module._scene_cells.cache_info().misses
        kept = space_of(mover(moved, 0.05), WRISTS, step_deg, np.array([ROBOT.home]))
        assert configuration_space_module._scene_cells.cache_info().misses - asked == 1
        for cached in ("_scene_cells", "_link_cells"):
            getattr(configuration_space_module, cached).cache_clear()
        assert (space_of(mover(moved, 0.05), WRISTS, step_deg, np.array([ROBOT.home])).blocked == kept.blocked).all()
        bare = space_of(mover(replace(world, parts=()), 0.05), WRISTS, step_deg, np.array([ROBOT.home]))
        assert (first.blocked & ~bare.blocked).any() and (kept.blocked & ~bare.blocked).any()
        assert not (bare.blocked & ~first.blocked).any() and (first.blocked != kept.blocked).any()


def test_blocked_cells_are_not_all_empty_air():
    """A space that blocks everything would be safe too: cells with plenty of room all around must be free."""
    rng, mine = np.random.default_rng(6), mover(scene(3), 0.05)
    space = space_of(mine, WRISTS[:1], 2.5, np.array([ROBOT.home]))
    roomy = blocked = 0
    for cell in (rng.random((400, 3)) * space.blocked.shape).astype(int):
        if mine.clearance(np.r_[space.centre(cell), WRISTS[0]]).distance > 0.0125:
            roomy += 1
            blocked += space.blocked[tuple(cell)]
    assert roomy > 50 and blocked < 0.7 * roomy


def test_ranges_beyond_a_turn_repeat_and_keep_the_limits():
    mine = mover(scene(0), 0.05)
    space = space_of(mine, WRISTS, 5.0)
    assert space.blocked.shape == (144, 144, 72)
    assert (space.blocked[:72] == space.blocked[72:]).all() and (space.blocked[:, :72] == space.blocked[:, 72:]).all()
    assert 0.01 < 1 - space.blocked.mean() < 0.5
    for i, centres in enumerate(space.extent.centres):
        assert centres[0] - space.extent.step / 2 >= ROBOT.lower[i] - 1e-9 and centres[-1] + space.extent.step / 2 <= ROBOT.upper[i] + 1e-9
    near = space_of(mine, WRISTS, 5.0, np.array([ROBOT.home]))
    rng = np.random.default_rng(0)
    same = [
        near.blocked[near.cell(q)] == space.blocked[space.cell(q)]
        for q in rng.uniform(ROBOT.home[:3] - 3.0, np.minimum(ROBOT.home[:3] + 3.0, 3.1), (200, 3))
    ]
    assert np.mean(same) > 0.98  # strides begin elsewhere, and so a cell in doubt may fall otherwise


def test_shortest_way_against_dijkstra():
    rng = np.random.default_rng(8)
    for _ in range(10):
        blocked = rng.random((2, 7, 6, 5)) < 0.5
        blocked[0, 0, 0, 0] = blocked[1, 6, 5, 4] = False
        cells = np.argwhere(np.ones(blocked.shape))
        gaps = np.abs(cells[:, None] - cells[None])
        steps = (gaps[..., 0] == 0) & (gaps[..., 1:].max(axis=2) == 1) | (gaps[..., 0] == 1) & (gaps[..., 1:].max(axis=2) == 0)
        free = ~blocked.reshape(-1)
        steps &= free[:, None] & free[None]
        rows, columns = np.nonzero(steps)
        weights = np.linalg.norm((cells[rows] - cells[columns])[:, 1:], axis=1)
        truth = dijkstra(coo_array((weights + 1e-9, (rows, columns)), shape=(len(cells),) * 2).tocsr(), indices=0)[-1]
        way = find_cells(blocked, np.zeros(4), np.array([1, 6, 5, 4]))
        assert (len(way) == 0) == bool(np.isinf(truth))
        if np.isinf(truth):
            continue
        assert not blocked[tuple(way.T)].any() and (np.abs(np.diff(way, axis=0)).max(axis=1) == 1).all()
        assert np.linalg.norm(np.diff(way[:, 1:], axis=0), axis=1).sum() == pytest.approx(truth, rel=1e-5)
        greedy = find_cells(blocked, np.zeros(4), np.array([1, 6, 5, 4]), 1.5)
        assert np.linalg.norm(np.diff(greedy[:, 1:], axis=0), axis=1).sum() <= 1.5 * truth + 1e-5


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.2, 0.95))
def test_regions_against_labelling_every_cell(seed, density):
    blocked = np.random.default_rng(seed).random((2, 6, 7, 9)) < density
    regions = free_regions(blocked)
    structure = np.zeros((3, 3, 3, 3), bool)
    structure[1], structure[:, 1, 1, 1] = True, True
    truth, count = ndimage.label(~blocked, structure=structure)
    assert regions.count == count
    numbers = np.zeros(blocked.shape, int)
    for (layer, i, j), first, last, number in zip(regions.rows, regions.first, regions.last, regions.number, strict=True):
        numbers[layer, i, j, first:last] = number
    assert ((numbers > 0) == ~blocked).all()
    pairs = {(a, b) for a, b in zip(numbers[~blocked], truth[~blocked], strict=True)}
    assert len(pairs) == count


def test_nearest_cells_of_a_region():
    rng = np.random.default_rng(3)
    blocked = ndimage.gaussian_filter(rng.random((1, 20, 20, 20)), (0, 2, 2, 2)) < 0.5
    regions, place = free_regions(blocked), rng.uniform(0.0, 19.0, 3)
    region = int(np.argmin(region_distances(regions, 0, place))) + 1
    cells = nearest_cells(regions, 0, place, region, 20)
    assert not blocked[0][tuple(cells.T)].any()
    distances = np.linalg.norm(cells - place, axis=1)
    everywhere = np.linalg.norm(np.argwhere(~blocked[0]) - place, axis=1)
    assert distances[0] == pytest.approx(everywhere.min()) and (np.diff(distances) >= -1e-12).all()
    assert region_distances(regions, 0, place)[region - 1] == pytest.approx(everywhere.min())
