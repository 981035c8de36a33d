"""The distance field, the spheres and the configuration space: what is called free is free."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from handey_studio.geometry import box
from handey_studio.geometry.transforms import inverse, transform
from handey_studio.motion.certificate import mover
from handey_studio.motion.configuration_space import configuration_space
from handey_studio.motion.distance_field import box_distances, clearance_at, distance_field
from handey_studio.motion.search import find_cells, nearest_free, regions_by_distance
from handey_studio.motion.wrist_box import arm_spheres
from handey_studio.world import Held, Part, World, arm_of
from handey_studio.world.collision import collision_model
from handey_studio.world.collision_bodies import held_pieces, robot_pieces
from handey_studio.world.gjk import distance
from tests.motion.oracle import ROBOT, scene

HELD = Held("brick#1", Part("brick", box([0.04, 0.09, 0.05])), transform(None, [0.0, 0.01, -0.01]))
WRISTS = np.array([ROBOT.home[3:], ROBOT.home[3:] + np.array([0.4, -0.5, 0.9])])


def test_box_distances_against_every_voxel():
    rng = np.random.default_rng(0)
    taken = rng.random((13, 9, 11)) < 0.01
    taken[3, 4, 5] = True
    found = box_distances(taken, 0.02, 0.1)
    cells = np.argwhere(taken)
    gaps = np.maximum(np.abs(np.argwhere(np.ones(taken.shape))[:, None] - cells[None]) - 0.5, 0.0) * 0.02
    truth = np.minimum(np.linalg.norm(gaps, axis=2).min(axis=1), 0.1).reshape(taken.shape)
    truth[taken] = 0.0
    assert found == pytest.approx(truth, abs=1e-6)


def test_the_field_never_exceeds_the_distance_to_the_scene():
    world, rng = scene(4), np.random.default_rng(1)
    model, field = collision_model(world), distance_field(world)
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


def test_spheres_enclose_the_arm_and_all_that_the_wrist_carries():
    spheres, arm, rng = arm_spheres(ROBOT, WRISTS, 0.06, HELD), arm_of(ROBOT), np.random.default_rng(2)
    pieces = robot_pieces(ROBOT) + held_pieces(ROBOT, HELD)
    for share in rng.random(25):
        poses = arm.link_poses(np.r_[0.0, 0.0, 0.0, WRISTS[0] + share * (WRISTS[1] - WRISTS[0])])
        for piece in pieces:
            if piece.link == 0:
                continue
            link = min(piece.link, 3)
            weights = rng.dirichlet(np.full(len(piece.corners), 0.3), 40)
            points = weights @ piece.corners + piece.slide * 0.06
            T = inverse(poses[link]) @ poses[piece.link]
            points = points @ T[:3, :3].T + T[:3, 3]
            mine = spheres.links == link
            gaps = np.linalg.norm(points[:, None] - spheres.centres[mine][None], axis=2) - spheres.radii[mine]
            assert gaps.min(axis=1).max() <= 1e-9
            if piece.link > 3:
                assert (points >= spheres.box.min(axis=0) - 1e-9).all() and (points <= spheres.box.max(axis=0) + 1e-9).all()


@pytest.mark.parametrize("held", [None, HELD])
def test_a_free_cell_is_free_all_over(held):
    world, rng = scene(3), np.random.default_rng(4)
    mine = mover(world, 0.05, held)
    space = configuration_space(mine, arm_spheres(ROBOT, WRISTS, 0.05, held), WRISTS.mean(axis=0), np.deg2rad(5.0))
    free = np.argwhere(~space.blocked)
    assert 0.02 < len(free) / space.blocked.size < 0.5
    names = {body.name for body in arm_of(ROBOT).bodies} | {"mount", "crosspiece", "finger_left", "finger_right", "brick#1"}
    for cell in free[rng.integers(len(free), size=400)]:
        arm = space.centre(cell) + rng.uniform(-0.5, 0.5, 3) * space.step
        share = rng.random()
        clearance = mine.clearance(np.r_[arm, WRISTS[0] + share * (WRISTS[1] - WRISTS[0])])
        assert clearance.keeps(mine.margin) or set(clearance.bodies) <= names, clearance


def test_blocked_cells_are_not_all_empty_air():
    """A space that blocks everything would be safe too: cells with plenty of room all around must be free."""
    world, rng = scene(3), np.random.default_rng(6)
    mine = mover(world, 0.05)
    space = configuration_space(mine, arm_spheres(ROBOT, WRISTS[:1], 0.05, None), WRISTS[0], np.deg2rad(2.5))
    roomy = blocked = 0
    for cell in (rng.random((400, 3)) * space.blocked.shape).astype(int):
        if mine.clearance(np.r_[space.centre(cell), WRISTS[0]]).distance > 0.0125:
            roomy += 1
            blocked += space.blocked[tuple(cell)]
    assert roomy > 50 and blocked < 0.8 * roomy


def test_ranges_beyond_a_turn_repeat_and_keep_the_limits():
    space = configuration_space(mover(scene(0), 0.05), arm_spheres(ROBOT, WRISTS, 0.05, None), WRISTS[0], np.deg2rad(5.0))
    assert space.blocked.shape == (144, 144, 72)
    assert (space.blocked[:72] == space.blocked[72:]).all() and (space.blocked[:, :72] == space.blocked[:, 72:]).all()
    assert 0.01 < 1 - space.blocked.mean() < 0.5
    for i, centres in enumerate(space.centres):
        assert centres[0] - space.step / 2 >= ROBOT.lower[i] - 1e-9 and centres[-1] + space.step / 2 <= ROBOT.upper[i] + 1e-9
    near = configuration_space(
        mover(scene(0), 0.05), arm_spheres(ROBOT, WRISTS, 0.05, None), WRISTS[0], np.deg2rad(5.0), np.array([ROBOT.home])
    )
    for q in np.random.default_rng(0).uniform(ROBOT.home[:3] - 3.0, np.minimum(ROBOT.home[:3] + 3.0, 3.1), (50, 3)):
        assert near.blocked[near.cell(q)] == space.blocked[space.cell(q)]


def test_shortest_way_against_dijkstra():
    rng = np.random.default_rng(8)
    for _ in range(10):
        blocked = rng.random((7, 6, 5)) < 0.5
        blocked[0, 0, 0] = blocked[6, 5, 4] = False
        cells = np.argwhere(np.ones(blocked.shape))
        steps = np.abs(cells[:, None] - cells[None]).max(axis=2) == 1
        free = ~blocked.reshape(-1)
        steps &= free[:, None] & free[None]
        rows, columns = np.nonzero(steps)
        weights = np.linalg.norm(cells[rows] - cells[columns], axis=1)
        truth = dijkstra(coo_array((weights, (rows, columns)), shape=(len(cells),) * 2).tocsr(), indices=0)[-1]
        way = find_cells(blocked, (0, 0, 0), (6, 5, 4))
        if np.isinf(truth):
            assert len(way) == 0
            continue
        assert not blocked[tuple(way.T)].any() and (np.abs(np.diff(way, axis=0)).max(axis=1) == 1).all()
        assert np.linalg.norm(np.diff(way, axis=0), axis=1).sum() == pytest.approx(truth, rel=1e-5)


def test_nearest_cells_and_regions():
    world = World(ROBOT)
    space = configuration_space(mover(world, 0.05), arm_spheres(ROBOT, WRISTS, 0.05, None), WRISTS[0], np.deg2rad(5.0))
    region = regions_by_distance(space, ROBOT.home, ROBOT.home + 0.1, 1)[0]
    cells = nearest_free(space, ROBOT.home, region, 20)
    assert (space.regions[tuple(cells.T)] == region).all()
    distances = np.linalg.norm(space.centre(cells) - ROBOT.home[:3], axis=1)
    everywhere = np.linalg.norm(space.centre(np.argwhere(space.regions == region)) - ROBOT.home[:3], axis=1)
    assert distances[0] == pytest.approx(everywhere.min()) and (np.diff(distances) >= -1e-12).all()
