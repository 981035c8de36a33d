"""The proof that there is no path, and the reasons when none was found."""

import numpy as np
import pytest

from handey_studio.geometry.transforms import transform
from handey_studio.motion import PathOptions, plan_path
from handey_studio.motion.apart import STEP_RAD, _whole_extent, surely_apart, wholly_blocked
from handey_studio.motion.query import query
from handey_studio.world import Block, World, arm_of
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


def test_a_wholly_blocked_cell_is_nowhere_free(parted):
    blocked, extent = wholly_blocked(parted), _whole_extent(ROBOT)
    cells, rng, model = np.argwhere(blocked), np.random.default_rng(3), collision_model(parted)
    assert 0.1 < blocked.mean() < 0.95
    for cell in cells[rng.integers(len(cells), size=300)]:
        q = np.concatenate([extent.lower + (cell + rng.random(3)) * STEP_RAD, rng.uniform(-3.0, 3.0, 3)])
        assert model.in_contact(q, 0.0) is not None
