"""A certified path to a hand pose: every branch of the inverse kinematics is a goal, and the shortest path wins (Handey 1987 §4).

What is cheap is tried for all branches before anything dear is tried for one. A path is never shorter than the straight line, so branches
farther away than a path that was found are not asked.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Progress, Silent
from handey_studio.motion.path import plan_path
from handey_studio.motion.query import PathOptions
from handey_studio.motion.results import PathResult
from handey_studio.world import Held, World, arm_of
from handey_studio.world.collision import Pairs

STAGE = "reach"


def plan_reach(
    world: World,
    start: NDArray,
    T_world_hand: NDArray,
    opening: float,
    held: Held | None = None,
    allowed_start: Pairs = (),
    allowed_goal: Pairs = (),
    options: PathOptions | None = None,
    rng: np.random.Generator | None = None,
    progress: Progress | None = None,
) -> PathResult:
    """A certified path from `start` (joints,) [rad] to some configuration that puts the hand at a pose (4, 4); see `plan_path`.

    First the cheapest means for every branch: the widest cells and no random trees; then, if none found a path, all means, the nearest
    branch first. `entries` tell of each branch, and `needed` which one it was if not the nearest.
    """
    options, progress, rng = options or PathOptions(), progress or Silent(), rng or np.random.default_rng(0)
    goals, ledger = reachable(world, start, T_world_hand), Ledger()
    if not len(goals):
        reason = "no branch of the inverse kinematics reaches the hand's pose within the joint limits"
        ledger.add(STAGE, "branches", reason)
        return PathResult("none", reason, np.empty((0, len(world.robot.lower))), entries=ledger.entries)
    best, failed = None, None
    for means in (replace(options, steps_deg=options.steps_deg[:1], tree_growths=0), options):
        for k, goal in enumerate(goals):
            if progress.cancelled or (best is not None and np.linalg.norm(goal - start) >= length(best)):
                break
            found = plan_path(world, start, goal, opening, held, allowed_start, allowed_goal, means, rng, progress)
            entry = ledger.add(STAGE, f"branch {k + 1} of {len(goals)}", found.reason or None, bodies=found.separating[:2])
            ledger.adopt(found.entries, parent=entry)
            if not found.found:
                failed = failed or found
            elif best is None or length(found) < length(best):
                words = (f"branch {k + 1} of {len(goals)}" if k else "", found.needed)
                best = replace(found, needed=", ".join(word for word in words if word))
            if best is not None and means is options:
                break
        if best is not None:
            break
    result = best or failed or PathResult("none", "cancelled", np.empty((0, len(start))), cancelled=True)
    return replace(result, entries=ledger.entries)


def reachable(world: World, start: NDArray, T_world_hand: NDArray) -> NDArray:
    """The branches (k, joints) [rad] within the joint limits, each turned as near to `start` as these allow, the nearest one first."""
    arm = arm_of(world.robot)
    branches = arm.nearest_turns(arm.ik(T_world_hand), start)
    branches = branches[world.robot.limit_margin(branches) >= 0] if len(branches) else branches
    return branches[np.argsort(np.linalg.norm(branches - start, axis=1), kind="stable")] if len(branches) else branches


def length(path: PathResult) -> float:
    """Length [rad] of a path in joint space."""
    return float(np.linalg.norm(np.diff(path.q_rad, axis=0), axis=1).sum())
