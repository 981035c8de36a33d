"""The grasp approach planner (Handey 1987 §5.2, Figures 9 and 10): the hand moves in the grasp plane, led by bump lines.

As in the paper: bump lines at two distances around the hand, checked each iteration against the filled cells; bump vectors and the free
motion vector on a unit circle, each bump vector scaled by its multiplier; motion along the free motion vector as far as the scaled bump
vectors allow, and along the non-zero bump vector closest to it if that is nothing; the colliding lines' summed torque; a threshold to
stop at and a limit of iterations. The test at the end, whether finger and face overlap sufficiently, is made where the face is known:
in `grasp_motion`.

Where it differs, and why:
- The mount between crosspiece and arm has bump lines of its own; the paper's hand has none, ours would hit with it.
- A step must leave the hand itself clear of filled cells, which bump lines alone, being lines, do not warrant: the turn is given up
  first, then the step along the free vector, then the stairstep. A turn on the spot is tried last. The paper does not say.
- The torque's lever and gain are ours, and a turn is at most `max_turn` an iteration.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.grasping.bump_run import BumpIterations, BumpRun, FoundBy, Status
from handey_studio.grasping.grasp_plane import Filled, GraspPlane
from handey_studio.grasping.hand_outline import VOLUMES, Outline, meets, rectangle_meets

LEVER_M = 0.06  # torques are measured against a lever about as long as a finger
TOWARDS = 0.05  # a bump vector counts as open towards the goal if it has at least this much of the free motion vector
SCALED, STAIRSTEP, TURN = 0, 1, 2


@dataclass(frozen=True)
class BumpOptions:
    """Distances in metres, angles in radians. Two rings of bump lines: `near` ones stop a motion, `far` ones slow it down.

    A near line's multiplier is 1, and 0 when it collides; the far line's beside it is `far_multiplier`, and 1 when it collides. Along their
    bump vector the hand may move by `step` times both.
    """

    step: float = 0.002
    near: float = 0.002
    far: float = 0.010
    far_multiplier: float = 3.0
    turn_gain: float = 8.0
    max_turn: float = float(np.deg2rad(2.0))
    threshold: float = 0.0015
    max_iterations: int = 250


@dataclass(frozen=True, eq=False)
class BumpLines(Value):
    """Bump lines in the hand's own frame: `ends` (m, 2, 2) [m] (across, along the fingers), outward unit `vectors` (m, 2)."""

    ends: NDArray
    vectors: NDArray
    volumes: tuple[str, ...]
    far: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "ends", frozen_array(self.ends))
        object.__setattr__(self, "vectors", frozen_array(self.vectors))
        object.__setattr__(self, "far", frozen_array(self.far, bool))


class _Rules(NamedTuple):
    """The options as numbers, and the torque [m] of each bump line (m,): the turn that moves its centre away from what it bumps into."""

    step: float
    far_multiplier: float
    turn_per_torque: float
    max_turn: float
    threshold: float
    max_iterations: int
    torques: NDArray


class _Lines(NamedTuple):
    """`BumpLines` with the numbers of their volumes (m,)."""

    ends: NDArray
    vectors: NDArray
    volumes: NDArray


def bump_lines(outline: Outline, options: BumpOptions) -> BumpLines:
    """Front, sides and back of each of the hand's rectangles, and of one around what it holds, at both distances: four near ones, then the
    far ones beside them."""
    ends, vectors, volumes, far = [], [], [], []
    for volume, (left, right, low, high) in _rectangles(outline):
        for d in (options.near, options.far):
            lines = (
                ([[left - d, high + d], [right + d, high + d]], [0.0, 1.0]),
                ([[right + d, low], [right + d, high + d]], [1.0, 0.0]),
                ([[left - d, low], [left - d, high + d]], [-1.0, 0.0]),
                ([[left - d, low - d], [right + d, low - d]], [0.0, -1.0]),
            )
            for line, vector in lines:
                ends.append(line)
                vectors.append(vector)
                volumes.append(VOLUMES[volume])
                far.append(d == options.far)
    return BumpLines(np.array(ends), np.array(vectors), tuple(volumes), np.array(far))


def _rectangles(outline: Outline) -> list[tuple[int, NDArray]]:
    """(volume, bounds) of the hand's rectangles, and of the one around all that is held."""
    held = outline.volumes == VOLUMES.index("held")
    found = [(int(volume), bounds) for volume, bounds in zip(outline.volumes[~held], outline.bounds[~held], strict=True)]
    if held.any():
        low, high = outline.bounds[held].min(axis=0), outline.bounds[held].max(axis=0)
        found.append((VOLUMES.index("held"), np.array([low[0], high[1], low[2], high[3]])))
    return found


def plan_approach(plane: GraspPlane, outline: Outline, start: NDArray, goal: NDArray, options: BumpOptions = BumpOptions()) -> BumpRun:
    """Bring the fingertips of the hand, alone or with what it holds, from `start` (y, z, angle) to the point `goal` (y, z) [m] without
    entering a filled cell."""
    lines = bump_lines(outline, options)
    centres = lines.ends.mean(axis=1)
    # (across, along) is a left-handed pair of axes, as a positive turn carries `along` towards `across`; hence minus vector × arm
    # is the turn that moves the line's centre away from what it bumps into.
    torques = lines.vectors[:, 1] * centres[:, 0] - lines.vectors[:, 0] * centres[:, 1]
    rules = _Rules(options.step, options.far_multiplier, options.turn_gain * options.step / LEVER_M, options.max_turn,
                   options.threshold, options.max_iterations, torques)  # fmt: skip
    volumes = np.array([VOLUMES.index(volume) for volume in lines.volumes])
    goal = np.array(goal, dtype=float)
    poses, colliding, multipliers, free, moved_by, ended = _run(
        plane.filled, outline, _Lines(lines.ends.copy(), lines.vectors.copy(), volumes), rules, np.array(start, dtype=float), goal
    )
    status: Status = ("reached", "stuck", "iterations", "blocked start")[ended]
    distance = float(np.linalg.norm(goal - poses[-1, :2]))
    record = BumpIterations(poses[:-1], colliding, multipliers, free, moved_by)
    found_by: FoundBy = "bump lines" if status == "reached" else ""
    return BumpRun(plane, poses, goal, status, distance, options.threshold, found_by, record)


@njit(cache=True)
def _run(
    filled: Filled, outline: Outline, lines: _Lines, rules: _Rules, start: NDArray, goal: NDArray
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray, int]:
    """Poses (k + 1, 3), what `BumpIterations` tells of the k iterations, and how it ended: 0 reached, 1 stuck, 2 iterations, 3 blocked."""
    most, m = rules.max_iterations, len(lines.vectors)
    poses, colliding, free = np.empty((most + 1, 3)), np.zeros((most, m), np.bool_), np.empty((most, 2))
    multipliers, moved_by = np.empty((most, m)), np.empty(most, np.int64)
    poses[0, 0], poses[0, 1], poses[0, 2] = start
    k, ended = 0, 2
    if meets(filled, outline, start, 0.0):
        ended = 3
    while ended == 2:
        distance = np.sqrt((goal[0] - poses[k, 0]) ** 2 + (goal[1] - poses[k, 1]) ** 2)
        if distance <= rules.threshold:
            ended = 0
        if ended == 0 or k == most:
            break
        free[k, 0], free[k, 1] = (goal[0] - poses[k, 0]) / distance, (goal[1] - poses[k, 1]) / distance
        _collide(filled, lines, poses[k], colliding[k])
        _scale(colliding[k], rules.far_multiplier, multipliers[k])
        turn = 0.0
        for line in range(m):
            turn += rules.turn_per_torque * rules.torques[line] if colliding[k, line] else 0.0
        turn = max(-rules.max_turn, min(rules.max_turn, turn))
        moved_by[k] = _step(filled, outline, lines, rules.step, multipliers[k], free[k], distance, turn, poses[k : k + 2])
        if moved_by[k] < 0:
            ended = 1
        else:
            k += 1
    return poses[: k + 1], colliding[:k], multipliers[:k], free[:k], moved_by[:k], ended


@njit(cache=True)
def _collide(filled: Filled, lines: _Lines, pose: NDArray, colliding: NDArray) -> None:
    """Write which bump lines cross a filled cell."""
    for line in range(len(colliding)):
        a0, a1 = lines.ends[line, 0, 0], lines.ends[line, 1, 0]
        b0, b1 = lines.ends[line, 0, 1], lines.ends[line, 1, 1]
        colliding[line] = rectangle_meets(filled, lines.volumes[line], pose, min(a0, a1), max(a0, a1), min(b0, b1), max(b0, b1))


@njit(cache=True)
def _scale(colliding: NDArray, far_multiplier: float, multipliers: NDArray) -> None:
    """Write how many steps the hand may move along each bump vector; lines come in fours, near ones and then the far ones beside them."""
    for line in range(len(colliding)):
        near = line if line // 4 % 2 == 0 else line - 4
        multipliers[line] = 0.0 if colliding[near] else 1.0 if colliding[near + 4] else far_multiplier


@njit(cache=True)
def _step(
    filled: Filled,
    outline: Outline,
    lines: _Lines,
    step: float,
    multipliers: NDArray,
    free: NDArray,
    distance: float,
    turn: float,
    poses: NDArray,
) -> int:
    """Write the pose after the first of `poses` (2, 3) into the second; by which rule the hand moves, or -1 when no motion is left."""
    c, s = np.cos(poses[0, 2]), np.sin(poses[0, 2])
    allowed, best, side_y, side_z = np.inf, TOWARDS, 0.0, 0.0
    for line in range(len(multipliers)):
        a, b = lines.vectors[line, 0], lines.vectors[line, 1]
        y, z = c * b - s * a, s * b + c * a
        towards = y * free[0] + z * free[1]
        if towards > 1e-9:
            allowed = min(allowed, multipliers[line] / towards)
        if multipliers[line] > 0.0 and towards > best:
            best, side_y, side_z = towards, y, z
    advance = min(allowed * step, distance)
    for rule in range(3):
        along = advance if rule == SCALED and advance > 1e-6 else 0.0
        aside = step if rule == STAIRSTEP and best > TOWARDS else 0.0
        if rule != TURN and along + aside == 0.0:
            continue
        poses[1, 0], poses[1, 1] = poses[0, 0] + along * free[0] + aside * side_y, poses[0, 1] + along * free[1] + aside * side_z
        for angle in (turn, 0.0):
            poses[1, 2] = poses[0, 2] + angle
            if (rule != TURN or angle != 0.0) and not meets(filled, outline, poses[1], 0.0):
                return rule
    return -1
