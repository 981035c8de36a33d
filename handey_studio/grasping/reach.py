"""IK branches and joint limits as further forbidden ranges of a group's hand angles (Handey 1987 §5.1)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.grasping.angle_ranges import Ranges, complement, joined
from handey_studio.grasping.rotations import ENDS, End, ForbiddenRange, GraspEnd, LegalRotations
from handey_studio.world import arm_of


@dataclass(frozen=True)
class ReachOptions:
    """Hand angles are looked at every `step` [rad]; a branch keeps `least_margin` [rad] to every joint limit, and is the same at two
    neighbouring angles if no joint turns by more than `most_turn` [rad] between them."""

    step: float = float(np.deg2rad(5.0))
    least_margin: float = float(np.deg2rad(3.0))
    most_turn: float = 0.6


@dataclass(frozen=True)
class BranchRange:
    """One IK branch at one end, for hand angles `low` to `high` [rad]; `side` ±1 tells which way round the hand is.

    `margin` [rad] is the least to any joint limit, `q_low` and `q_high` [rad] are the joint angles at both ends of the range.
    """

    low: float
    high: float
    end: End
    side: int
    margin: float
    q_low: tuple[float, ...]
    q_high: tuple[float, ...]


def branch_ranges(
    rotations: LegalRotations, end: GraspEnd, name: End, side: int, options: ReachOptions = ReachOptions()
) -> tuple[BranchRange, ...]:
    """Where each branch of the arm's IK serves the free angles of a group at one end, with that way round of the hand.

    The free ranges are sampled: between two angles a branch counts as there if it is there at both. The arm's collisions are not looked at.
    """
    found: list[BranchRange] = []
    for low, high in rotations.ranges():
        angles = np.linspace(low, high, 2 + int((high - low) / options.step))
        poses = [end.hand_pose(rotations.group, float(angle), side) for angle in angles]
        found += _tracked(end, name, side, angles, poses, options)
    return tuple(found)


def within_reach(
    rotations: LegalRotations, pickup: GraspEnd, putdown: GraspEnd, side: int, options: ReachOptions = ReachOptions()
) -> tuple[LegalRotations, tuple[BranchRange, ...]]:
    """The same rotations without the angles that no branch reaches at one end, and the branches that reach the others."""
    branches: list[BranchRange] = []
    forbidden = list(rotations.forbidden)
    for name, end in zip(ENDS, (pickup, putdown), strict=True):
        found = branch_ranges(rotations, end, name, side, options)
        reached = joined([(branch.low, branch.high) for branch in found])
        for low, high in rotations.ranges():
            beyond: Ranges = complement([span for span in reached if span[0] >= low and span[1] <= high], low, high)
            forbidden += [ForbiddenRange(*span, name, "", "reach") for span in beyond]
        branches += found
    return replace(rotations, forbidden=tuple(forbidden)), tuple(branches)


def _tracked(end: GraspEnd, name: End, side: int, angles: NDArray, poses: list[NDArray], options: ReachOptions) -> list[BranchRange]:
    """Branches followed from angle to angle."""
    arm, robot = arm_of(end.world.robot), end.world.robot
    open_tracks: list[BranchRange] = []
    done: list[BranchRange] = []
    for angle, pose in zip(angles, poses, strict=True):
        found = arm.nearest_turns(arm.ik(pose), robot.home).reshape(-1, len(robot.home))
        margins = robot.limit_margin(found)
        going: list[BranchRange] = []
        for q, margin in zip(found[margins >= options.least_margin], margins[margins >= options.least_margin], strict=True):
            before = _nearest(q, open_tracks, options.most_turn)
            if before is None:
                before = BranchRange(float(angle), float(angle), name, side, np.inf, _plain(q), _plain(q))
            going.append(replace(before, high=float(angle), margin=min(before.margin, float(margin)), q_high=_plain(q)))
        done += [track for track in open_tracks if all(track.low != new.low or track.q_low != new.q_low for new in going)]
        open_tracks = going
    return [track for track in (*done, *open_tracks) if track.high > track.low]


def _nearest(q: NDArray, tracks: list[BranchRange], most_turn: float) -> BranchRange | None:
    """The track that goes on at q, if one does."""
    turns = [float(np.abs(np.mod(q - track.q_high + np.pi, 2 * np.pi) - np.pi).max()) for track in tracks]
    return tracks[int(np.argmin(turns))] if turns and min(turns) <= most_turn else None


def _plain(q: NDArray) -> tuple[float, ...]:
    return tuple(q.tolist())
