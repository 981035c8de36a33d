"""The paper's path (Handey 1987 §4): to the nearest free cell with the wrist as it is at the start, through the free space while the
wrist turns, and from the free cell nearest the goal to the goal with the wrist as it is there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.motion.certificate import Mover
from handey_studio.motion.configuration_space import ConfigurationSpace, configuration_space
from handey_studio.motion.legs import leg_to_free
from handey_studio.motion.query import Query
from handey_studio.motion.results import CSpaceSummary
from handey_studio.motion.search import find_cells, regions_by_distance
from handey_studio.motion.wrist_box import ArmSpheres, arm_spheres
from handey_studio.world import Robot


@dataclass(frozen=True, eq=False)
class ThreeLegs:
    """What one space gave: the path's points (n, joints) [rad] and the mover of each segment, empty when it gave none; `reason` why."""

    points: NDArray
    movers: list[Mover]
    reason: str
    space: CSpaceSummary


def three_legs(query: Query, wrists: NDArray, step: float, fine: bool) -> ThreeLegs:
    """The three legs in the space with cells `step` [rad] wide, while the joints other than the arm's run through `wrists`
    (m, joints − 3) [rad] from start to goal.

    `fine`: whether the finer grid is used near an end that no straight line leads away from.
    """
    spheres = arm_spheres(query.world.robot, wrists, query.opening, query.held)
    middle = wrists[len(wrists) // 2] if len(wrists) > 2 else wrists.mean(axis=0)
    space = configuration_space(query.free, spheres, middle, step, np.array([query.start, query.goal]))
    regions = regions_by_distance(space, query.start, query.goal, query.options.regions)
    reason = "no cell of the space is free" if not regions else ""
    expansions = query.options.fine_expansions if fine else 0
    for region in regions:
        first = leg_to_free(query.leaving, space, query.start, region, expansions)
        last = leg_to_free(query.arriving, space, query.goal, region, expansions) if first else None
        if first is None or last is None:
            reason = reason or f"the {'start' if first is None else 'goal'} does not reach the free cells nearest to it"
            continue
        between, cells = _free_leg(query, space, region, wrists, first[1], last[1])
        if not len(between):
            reason = reason or "the whole arm fails in the cells that its model with the wrist box calls free"
            continue
        points = np.concatenate([first[0], between[1:], last[0][::-1][1:]])
        movers = [query.leaving] * (len(first[0]) - 1) + [query.free] * (len(between) - 1) + [query.arriving] * (len(last[0]) - 1)
        return ThreeLegs(points, movers, "", summary(space, spheres, cells, first[1], last[1]))
    return ThreeLegs(np.empty((0, len(query.start))), [], reason, summary(space, spheres, np.empty((0, 3)), None, None))


def _free_leg(
    query: Query, space: ConfigurationSpace, region: int, wrists: NDArray, first: tuple[int, int, int], last: tuple[int, int, int]
) -> tuple[NDArray, NDArray]:
    """Points (n, joints) of the free leg, proved for the whole arm, and its cells (k, 3); both empty when there is none.

    The cells answer for the scene. Where the arm's own bodies come too close the cells are taken out and the way is searched anew.
    """
    blocked = space.regions != region
    for _ in range(query.options.repairs):
        cells = find_cells(blocked, first, last)
        if not len(cells):
            break
        points, owners = _with_wrist(query.world.robot, space.centre(cells), wrists)
        bad = [k for k in range(len(points) - 1) if not query.free.moves(points[k], points[k + 1])]
        if not bad:
            return points, cells
        out = {tuple(int(c) for c in cells[min(owners[k] + side, len(cells) - 1)]) for k in bad for side in (0, 1)} - {first, last}
        if not out:
            break
        for cell in out:
            blocked[cell] = True
    return np.empty((0, len(query.start))), np.empty((0, 3))


def _with_wrist(robot: Robot, arm: NDArray, wrists: NDArray) -> tuple[NDArray, NDArray]:
    """The arm's corners (k, 3) and the wrist's (m, joints − 3) run through together, each at an even pace: configurations (n, joints).

    Also the arm corner before each point.
    """
    arm = np.repeat(arm, 2, axis=0) if len(arm) == 1 else arm
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(arm, axis=0), axis=1))])
    at_arm = along / along[-1] if along[-1] > 0 else np.linspace(0.0, 1.0, len(arm))
    at_wrist = np.linspace(0.0, 1.0, len(wrists))
    t = np.unique(np.concatenate([at_arm, at_wrist]))
    points = np.empty((len(t), len(robot.joint_names)))
    points[:, robot.arm_index] = np.stack([np.interp(t, at_arm, column) for column in arm.T], axis=1)
    points[:, robot.other_index] = np.stack([np.interp(t, at_wrist, column) for column in wrists.T], axis=1)
    return points, np.searchsorted(at_arm, t, side="right") - 1


def summary(
    space: ConfigurationSpace, spheres: ArmSpheres, cells: NDArray, first: tuple[int, ...] | None, last: tuple[int, ...] | None
) -> CSpaceSummary:
    """The space as it is drawn."""
    joints = (int(space.joints[0]), int(space.joints[1]), int(space.joints[2]))
    regions = int(space.regions.max())
    return CSpaceSummary(space.step, space.centres, space.blocked, cells, first, last, spheres.box, spheres.carrier, regions, joints)
