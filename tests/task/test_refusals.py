"""A MOVE that is refused cannot be done, and one that is planned can: held against every grasp of a dense sampling."""

import numpy as np
import pytest

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.penetration import overlap, polytope, polytopes_of
from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.grasping import stable_placements
from handey_studio.task import MoveCommand, MoveOptions, SearchOptions
from handey_studio.task.carrying import Start
from handey_studio.task.destination import format_pose
from handey_studio.task.move import plan_move
from handey_studio.world import Block, Library, PlacedPart, World
from tests.task.exhaustive import Ends, left_over

LIBRARY = Library.choose()
ROBOT = LIBRARY.robot("ur5")
NAMES = ("l_block", "t_block", "brick", "stairs", "bracket")


def crowded(seed, count=14):
    """A part, its two places, and the blocks that crowd both, as the planner knows them and as true bodies."""
    rng = np.random.default_rng(seed)
    part = LIBRARY.part(NAMES[seed % len(NAMES)])
    placements, _ = stable_placements(part)
    ends = [
        from_xyz_rpy((*xy, 0), (0, 0, rng.uniform(-3, 3))) @ placements[rng.integers(len(placements))].T_plane_part
        for xy in ((0.45, -0.2), (0.4, 0.22))
    ]
    blocks, bodies = [], [SolidBody("table", box((4.0, 4.0, 0.1)), from_xyz_rpy((0.0, 0.0, -0.05)), fixed=True)]
    for k in range(count):
        size = rng.uniform((0.02, 0.02, 0.03), (0.05, 0.05, 0.11))
        spot = ends[k % 2][:2, 3] + rng.normal(0, 0.055, 2)
        body = SolidBody(f"block{k}", box(size), from_xyz_rpy((*spot, size[2] / 2), (0, 0, rng.uniform(-3, 3))), fixed=True)
        pairs = [(polytope(p), T, q) for T in ends for p in part.pieces for q in polytopes_of(body)]
        if all(overlap(p, T, q, body.T_world_body) < -0.001 for p, T, q in pairs):
            blocks.append(Block(body.name, size, body.T_world_body))
            bodies.append(body)
    return part, ends, tuple(blocks), tuple(bodies)


@pytest.mark.parametrize(("seed", "planned"), [(3, False), (22, False), (45, True)])
def test_what_is_refused_has_no_grasp_at_both_ends(seed, planned):
    part, (T_start, T_goal), blocks, bodies = crowded(seed)
    world = World(ROBOT, 0.0, blocks, (PlacedPart("it#1", part, T_start),))
    start = Start(ROBOT.home, ROBOT.hand.opening_max, ROBOT.home)
    options = MoveOptions(search=SearchOptions(effort=8.0, regrasps=0))
    result = plan_move(world, MoveCommand("it#1", format_pose(T_goal)), {"it": part}, start, options)
    assert (result.status == "planned") == planned, result.reason
    found = left_over(Ends(part, T_start, T_goal, bodies, ROBOT), enough=1)
    assert found["grasps"] > 100 and (found["all"] > 0) == planned, dict(found)
