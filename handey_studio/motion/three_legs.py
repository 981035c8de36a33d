"""The paper's path (Handey 1987 §4): to the nearest free cell with the wrist as it is at the start, through the free space while the
wrist turns, and from the free cell nearest the goal to the goal with the wrist as it is there."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Progress, Silent
from handey_studio.motion.certificate import Mover
from handey_studio.motion.layers import Layers
from handey_studio.motion.legs import End, leg_to_free, legs_to_free
from handey_studio.motion.query import Query
from handey_studio.motion.regions import nearest_cells, region_distances
from handey_studio.motion.results import CSpaceSummary
from handey_studio.motion.search import find_cells

NO_PLACE = 2  # cells around one in which the wrist does not turn at one place, where it hardly does either


@dataclass(frozen=True, eq=False)
class ThreeLegs:
    """What one stack of spaces gave: the path's points (n, joints) [rad] and the mover of each segment, empty when none; `reason` why, and
    the `bodies` in the way. `more` tells at which ends more than one leg was needed. `shut`: no cell is free with the wrist as it is at one
    of the ends, however it turns between them.
    """

    points: NDArray
    movers: list[Mover]
    reason: str
    space: CSpaceSummary
    bodies: tuple[str, ...] = ()
    more: str = ""
    shut: bool = False


def three_legs(query: Query, layers: Layers, rng: np.random.Generator | None = None, progress: Progress | None = None) -> ThreeLegs:
    """The three legs in a stack of spaces; with a generator more than one at an end that no straight one leaves."""
    regions = layers.common_regions(query.start, query.goal, query.options.regions)
    reason, bodies = ("", ()) if regions else apart(query, layers)
    ends = End("start", query.start, query.leaving, 0), End("goal", query.goal, query.arriving, len(layers.spaces) - 1)
    for region in regions:
        legs, more = [], []
        for end in ends:
            leg = leg_to_free(end, layers, region)
            if leg is None and rng is not None and query.options.leg_growths:
                leg = legs_to_free(query, end, layers, region, rng, progress or Silent())
                more.append(f"more legs at the {end.name}")
            if leg is None:
                reason, bodies = (reason, bodies) if reason else _unreached(end, layers, region)
                break
            legs.append(leg)
        if len(legs) < len(ends):
            continue
        first, last = legs
        between, cells = _free_leg(query, layers, first.cell, last.cell)
        if not len(between):
            reason = reason or "the whole arm fails in the cells that its model with the wrist box calls free"
            continue
        points = np.concatenate([first.points, between[1:], last.points[::-1][1:]])
        movers = [*first.movers, *[query.free] * (len(between) - 1), *last.movers[::-1]]
        return ThreeLegs(points, movers, "", summary(layers, cells), more=", ".join(more))
    shut = len(layers.spaces) > 1 and any(layers.spaces[end.layer].blocked.all() for end in ends)
    return ThreeLegs(np.empty((0, len(query.start))), [], reason, summary(layers, np.empty((0, 4))), bodies, shut=shut)


def _unreached(end: End, layers: Layers, region: int) -> tuple[str, tuple[str, ...]]:
    """Why no leg joins an end to a region, and the bodies in the way to its nearest cell."""
    space = layers.spaces[end.layer]
    cell = nearest_cells(layers.regions, end.layer, space.place(end.q), region, 1)[0]
    bodies = end.mover.obstacle(end.q, space.at(cell, end.q))
    between = f": {' and '.join(bodies)} are in the way" if bodies else ""
    return f"the {end.name} does not reach the free cells nearest to it{between}", bodies


def apart(query: Query, layers: Layers) -> tuple[str, tuple[str, ...]]:
    """Why no free region is near both ends: what stands between the region nearest to the start and the one nearest to the goal."""
    last = len(layers.spaces) - 1
    ends = [(0, query.start), (last, query.goal)]
    distances = [region_distances(layers.regions, layer, layers.spaces[layer].place(q)) for layer, q in ends]
    for (_, q), least, name in zip(ends, distances, ("start", "goal"), strict=True):
        if not np.isfinite(least).any():
            nearest = query.free.clearance(q)
            return f"no cell is wholly free with the wrist as it is at the {name}, where {nearest}", nearest.bodies
    regions = [int(np.argmin(least)) + 1 for least in distances]
    space = layers.spaces[last]
    goal = nearest_cells(layers.regions, last, space.place(query.goal), regions[1], 1)[0]
    start = nearest_cells(layers.regions, 0, goal, regions[0], 1)[0]
    bodies = query.free.obstacle(space.at(goal, query.goal), space.at(start, query.goal))
    between = f": {' and '.join(bodies)} are between them" if bodies else ""
    return f"start and goal lie in free regions {regions[0]} and {regions[1]} of {layers.regions.count}, which are apart{between}", bodies


def _free_leg(query: Query, layers: Layers, first: NDArray, last: NDArray) -> tuple[NDArray, NDArray]:
    """Points (n, joints) of the free leg, proved for the whole arm, and its cells (k, 4); both empty when there is none.

    The cells answer for the scene. Where the arm's own bodies come too close the cells are taken out and the way is searched anew; of
    the layer that is assumed to be free, the cells around them too.
    """
    blocked = layers.blocked
    for _ in range(query.options.repairs):
        cells = find_cells(blocked, first, last)
        if not len(cells):
            break
        corners = pulled(blocked, cells)
        points, owners = _with_wrist(query, layers, cells[corners])
        bad = [k for k, (a, b) in enumerate(pairwise(points)) if not query.free.moves(a, b)]
        if bad and len(corners) < len(cells):
            corners = np.arange(len(cells))
            points, owners = _with_wrist(query, layers, cells)
            bad = [k for k, (a, b) in enumerate(pairwise(points)) if not query.free.moves(a, b)]
        if not bad:
            return points, cells
        out = {tuple(cells[corners[owners[k + side]]].tolist()) for k in bad for side in (0, 1)}
        out -= {tuple(first.tolist()), tuple(last.tolist())}
        if not out:
            break
        blocked = np.array(blocked)
        for layer, i, j, m in out:
            wide = NO_PLACE if layer == layers.assumed else 0
            here = tuple(slice(max(k - wide, 0), k + wide + 1) for k in (i, j, m))
            blocked[layer][here] = True
    return np.empty((0, len(query.start))), np.empty((0, 4))


def pulled(blocked: NDArray, cells: NDArray) -> NDArray:
    """Numbers of the cells (k, 4) that are left as corners when the way is pulled straight through free cells of its layer."""
    corners = [0]
    while corners[-1] < len(cells) - 1:
        corners.append(int(_farthest(blocked, cells, corners[-1])))
    return np.array(corners)


@njit(cache=True)
def _farthest(blocked: NDArray, cells: NDArray, start: int) -> int:
    """The last cell up to which all are seen from cell `start`; at least the next one."""
    end = start + 1
    while end + 1 < len(cells) and cells[end + 1, 0] == cells[start, 0]:
        longest = 0.0
        for axis in range(1, 4):
            longest = max(longest, abs(float(cells[end + 1, axis] - cells[start, axis])))
        looks = 4 * int(longest)
        for look in range(1, looks):
            t = look / looks
            i = int(np.round(cells[start, 1] + t * (cells[end + 1, 1] - cells[start, 1])))
            j = int(np.round(cells[start, 2] + t * (cells[end + 1, 2] - cells[start, 2])))
            k = int(np.round(cells[start, 3] + t * (cells[end + 1, 3] - cells[start, 3])))
            if blocked[cells[start, 0], i, j, k]:
                return end
        end += 1
    return end


def _with_wrist(query: Query, layers: Layers, cells: NDArray) -> tuple[NDArray, NDArray]:
    """Points (n, joints) of arm and wrist along cells (k, 4), and the number (n,) of the cell at or before each.

    In each layer the wrist runs at an even pace through the layer's way.
    """
    robot, space = query.world.robot, layers.spaces[0]
    runs, owners = [], []
    for layer, box in enumerate(layers.boxes):
        mine = np.flatnonzero(cells[:, 0] == layer)
        arm, wrists = space.centre(cells[mine, 1:]), box.wrists
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(arm, axis=0), axis=1))])
        if along[-1] == 0.0 and len(wrists) > 1:
            arm, along, mine = np.repeat(arm[:1], 2, axis=0), np.array([0.0, 1.0]), np.repeat(mine[:1], 2)
        at_arm = along / along[-1] if along[-1] > 0 else np.zeros(len(arm))
        at_wrist = np.linspace(0.0, 1.0, len(wrists)) if len(wrists) > 1 else np.zeros(1)
        t = np.unique(np.concatenate([at_arm, at_wrist]))
        points = np.empty((len(t), len(query.start)))
        for k, joint in enumerate(robot.arm_index):
            points[:, joint] = np.interp(t, at_arm, arm[:, k])
        for k, joint in enumerate(robot.other_index):
            points[:, joint] = np.interp(t, at_wrist, wrists[:, k])
        runs.append(points)
        owners.append(mine[np.searchsorted(at_arm, t, side="right") - 1])
    points, owner = np.concatenate(runs), np.concatenate(owners)
    keep = np.r_[True, np.abs(np.diff(points, axis=0)).max(axis=1) > 0.0]
    return points[keep], owner[keep]


def summary(layers: Layers, cells: NDArray) -> CSpaceSummary:
    """The space as it is drawn: the layer in which the wrist turns farthest, and the cells in all layers."""
    turning = int(np.argmax([np.abs(np.diff(box.wrists, axis=0)).sum() for box in layers.boxes]))
    space, box = layers.spaces[turning], layers.boxes[turning]
    ends = [tuple(int(c) for c in cells[k][1:]) for k in (0, -1)] if len(cells) else [None, None]
    return CSpaceSummary(
        step_rad=space.extent.step,
        centres=space.extent.centres,
        blocked=space.blocked,
        path_cells=cells[:, 1:],
        start_cell=ends[0],
        goal_cell=ends[1],
        wrist_box=box.corners,
        wrist_box_link=box.carrier,
        regions=layers.regions.count,
        joints=tuple(int(joint) for joint in space.joints),
    )
