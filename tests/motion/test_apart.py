"""The proof that there is no path, and the reasons when none was found."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import transform
from handey_studio.motion import PathOptions, plan_path
from handey_studio.motion.apart import STEP_RAD, _whole_extent, surely_apart, wholly_blocked
from handey_studio.motion.query import query
from handey_studio.world import Block, Library, World, arm_of
from handey_studio.world.collision import collision_model
from tests.motion.oracle import ROBOT

CEILING = Block("ceiling", [3.0, 3.0, 0.1], transform(None, [0.0, 0.0, 0.45]))
WALLS = tuple(Block(f"wall {side:+d}", [1.3, 0.04, 0.4], transform(None, [side * 0.85, 0.0, 0.2])) for side in (-1, 1))


def free_at(world: World, side: int) -> np.ndarray:
    """A free configuration with the elbow and the hand on one side of the walls."""
    rng, model, arm = np.random.default_rng(1), collision_model(world), arm_of(ROBOT)
    while True:
        q = rng.uniform([-3.0, -3.0, -2.8, -3, -3, -3], [3.0, 0.0, 2.8, 3, 3, 3])
        poses = arm.link_poses(q)
        if (side * poses[3:, 1, 3] > 0.1).all() and model.in_contact(q, 0.0, margin=0.002) is None:
            return q


@pytest.fixture(scope="module")
def parted() -> World:
    """Two walls up to a ceiling so low that the upper arm cannot stand up between them."""
    return World(ROBOT, blocks=(CEILING, *WALLS))


def test_ends_on_both_sides_of_walls_are_proved_apart(parted):
    start, goal = free_at(parted, -1), free_at(parted, 1)
    refused = plan_path(parted, start, goal, 0.0, options=PathOptions(steps_deg=(5.0,), tree_growths=20))
    assert refused.status == "none" and refused.proven and "wholly blocked" in refused.reason
    assert refused.separating and set(refused.separating) <= {"ceiling", "wall -1", "wall +1", "table"}
    fallen = [entry.reason for entry in refused.entries if entry.reason]
    assert any("mm apart" in reason or "in the way" in reason or "between them" in reason for reason in fallen), fallen


def test_nothing_is_proved_where_a_way_may_be(parted):
    start, goal = free_at(parted, -1), free_at(parted, 1)
    open_world = World(ROBOT, blocks=(CEILING, WALLS[0]))
    for world, ends in ((open_world, (start, goal)), (parted, (start, start + 0.01))):
        asked, reason, _ = query(world, *ends, 0.0, None, (), (), PathOptions())
        assert not reason and not surely_apart(asked)


def scanned() -> World:
    """The two walls as a depth map under the ceiling."""
    cell, x, y = 0.01, 1.2, 0.1
    along, across = (np.arange(round(2 * x / cell)) + 0.5) * cell - x, (np.arange(round(2 * y / cell)) + 0.5) * cell - y
    top = np.where((np.abs(along) > 0.2)[None] & (np.abs(across) < 0.02)[:, None], 0.4, 0.0)
    return World(ROBOT, blocks=(CEILING,), terrain=HeightField(top, cell, transform(None, [-x, -y, 0.0])))


def slit() -> World:
    """A Panda under a ceiling so low that its upper arm cannot stand up, and a wall on both sides through its own axis."""
    halves = [Block(f"half {side:+d}", [0.9, 0.04, 0.5], transform(None, [side * 0.57, 0.0, 0.25])) for side in (-1, 1)]
    return World(Library.choose().robot("panda"), blocks=(Block("ceiling", [3.0, 3.0, 0.1], transform(None, [0.0, 0.0, 0.56])), *halves))


def test_the_depth_map_sets_apart_as_known_walls_do():
    world = scanned()
    start, goal = free_at(world, -1), free_at(world, 1)
    asked, reason, _ = query(world, start, goal, 0.0, None, (), (), PathOptions())
    assert not reason and surely_apart(asked)
    lower = replace(world, terrain=replace(world.terrain, top=np.minimum(world.terrain.top, 0.1)))
    assert not surely_apart(replace(asked, world=lower))


def test_an_upper_arm_sets_apart_wherever_the_held_joint_stands():
    world, rng = slit(), np.random.default_rng(0)
    robot, model = world.robot, collision_model(world)
    sides: dict[bool, np.ndarray] = {}
    while len(sides) < 2:
        q = rng.uniform(robot.lower, robot.upper)
        places = arm_of(robot).link_poses(q)[4:, 1, 3]
        if (np.abs(places) > 0.05).all() and len(set(places > 0)) == 1 and model.in_contact(q, 0.0, margin=0.002) is None:
            sides.setdefault(bool(places[0] > 0), q)
    asked, reason, _ = query(world, sides[True], sides[False], 0.0, None, (), (), PathOptions())
    assert not reason and surely_apart(asked)
    assert not surely_apart(replace(asked, world=replace(world, blocks=world.blocks[1:])))


@pytest.mark.parametrize("make", [lambda: World(ROBOT, blocks=(CEILING, *WALLS)), scanned, slit], ids=["known", "scanned", "held joint"])
def test_a_wholly_blocked_cell_is_nowhere_free(make):
    world = make()
    robot = world.robot
    blocked, extent = wholly_blocked(world), _whole_extent(robot)
    cells, rng, model = np.argwhere(blocked), np.random.default_rng(3), collision_model(world)
    assert 0.1 < blocked.mean() < 0.95
    for cell in cells[rng.integers(len(cells), size=300)]:
        q = rng.uniform(robot.lower, robot.upper)
        q[robot.arm_index] = extent.lower + (cell + rng.random(3)) * STEP_RAD
        assert model.in_contact(q, 0.0) is not None
