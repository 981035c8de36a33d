"""What beyond the paper's three legs finds a path: turning at one place, tighter boxes, more legs, trees; each judged by the oracle."""

import numpy as np
import pytest

from handey_studio.base import Silent
from handey_studio.motion import PathOptions
from handey_studio.motion.layers import ROOMY, Layers, layers_of, turned_at_one_place
from handey_studio.motion.query import Query, query
from handey_studio.motion.random_trees import grow_trees
from handey_studio.motion.three_legs import three_legs
from handey_studio.motion.wrist_ways import wrist_parts, wrist_ways
from handey_studio.task.bench.motion.random_reaches import random_reaches
from handey_studio.world import Library
from handey_studio.world.collision import collision_model
from tests.motion.oracle import ROBOT, Judge, reach, scene

STEP = float(np.deg2rad(5.0))
OPENING = 0.05


@pytest.fixture(scope="module")
def asked() -> Query:
    world, rng = scene(1), np.random.default_rng(1)
    start, goal = (reach(collision_model(world), rng) for _ in range(2))
    return query(world, start, goal, OPENING, None, (), (), PathOptions(regions=1))[0]


@pytest.fixture(scope="module")
def way(asked) -> np.ndarray:
    return wrist_ways(asked, np.random.default_rng(0), 1)[0][1]


def test_a_wrist_turns_at_one_place_and_stands_as_at_an_end_elsewhere(asked, way):
    layers = turned_at_one_place(asked, way, STEP)
    found = three_legs(asked, layers)
    assert len(found.points), found.reason
    others = found.points[:, ROBOT.other_index]
    assert (others[0] == way[0]).all() and (others[-1] == way[-1]).all()
    arm = found.points[:, ROBOT.arm_index]
    turning = np.abs(np.diff(others, axis=0)).max(axis=1) > 1e-9
    assert turning.any() and np.abs(np.diff(arm, axis=0))[turning].max() <= STEP * (1 + 2 * ROOMY) + 1e-9
    assert Judge(asked.world, OPENING).first_meeting(found.points, 0.02) is None


def test_where_the_wrist_turns_both_ends_have_room(asked, way):
    layers = turned_at_one_place(asked, way, STEP)
    ends, assumed = layers.blocked[[0, 2]].any(axis=0), layers.blocked[1]
    for i, j, m in np.argwhere(~assumed)[:: max(1, (~assumed).sum() // 200)]:
        around = [slice(max(i - ROOMY, 0), i + ROOMY + 1), slice(max(j - ROOMY, 0), j + ROOMY + 1), slice(max(m - ROOMY, 0), m + ROOMY + 1)]
        assert not ends[tuple(around)].any()
    crowded = np.argwhere(assumed & ~ends)
    assert len(crowded) and layers.assumed == 1
    assert len(layers.places) == (~assumed).sum()


def test_a_place_that_does_not_serve_is_left_for_another(asked, way):
    """All room is called free: the arm must find out for itself where the wrist can turn."""
    good = turned_at_one_place(asked, way, STEP)
    nothing = np.zeros_like(good.spaces[1].blocked)
    reckless = Layers(
        good.boxes, (good.spaces[0], type(good.spaces[1])(good.spaces[1].extent, good.spaces[1].joints, nothing), good.spaces[2]), 1
    )
    found = three_legs(asked, reckless)
    assert not len(found.points) or Judge(asked.world, OPENING).first_meeting(found.points, 0.02) is None


def test_boxes_of_parts_of_the_range_are_tighter_and_leave_more_free(asked, way):
    whole, parts = layers_of(asked, [way], STEP), layers_of(asked, [way[:1], *wrist_parts(way), way[-1:]], STEP)
    size = [np.prod(np.ptp(box.corners, axis=0)) for box in (*whole.boxes, *parts.boxes)]
    assert max(size[1:]) < size[0]
    free = [float((~space.blocked).mean()) for space in (*whole.spaces, *parts.spaces)]
    assert min(free[1:]) > free[0]
    assert all((a.wrists[-1] == b.wrists[0]).all() for a, b in zip(parts.boxes[:-1], parts.boxes[1:], strict=True))
    found = three_legs(asked, parts)
    assert len(found.points) and Judge(asked.world, OPENING).first_meeting(found.points, 0.02) is None


def test_deep_in_a_bin_more_legs_lead_out():
    robot = Library.choose().robot("puma560")
    problem = next(random_reaches(robot, range(4, 5)))
    asked = query(problem.world, problem.start, problem.goal, problem.opening, problem.held, (), (), PathOptions())[0]
    layers = layers_of(asked, [np.array([asked.start, asked.goal])[:, robot.other_index]], STEP)
    assert "does not reach the free cells" in three_legs(asked, layers).reason
    found = three_legs(asked, layers, np.random.default_rng(0))
    assert found.more == "more legs at the goal" and len(found.points) > 4
    assert Judge(problem.world, problem.opening, problem.held).first_meeting(found.points, 0.02) is None


@pytest.mark.parametrize("seeded", [False, True])
def test_trees_keep_the_legs_at_their_roots_to_those_who_speak_for_them(asked, way, seeded):
    places = turned_at_one_place(asked, way, STEP).places if seeded else None
    points, movers, grown = grow_trees(asked, 2000, np.random.default_rng(0), Silent(), places)
    assert 0 < grown <= 2000 and (points[0] == asked.start).all() and (points[-1] == asked.goal).all()
    assert len(movers) == len(points) - 1 and movers[0] is asked.leaving and movers[-1] is asked.arriving
    assert Judge(asked.world, OPENING).first_meeting(points, 0.02) is None
