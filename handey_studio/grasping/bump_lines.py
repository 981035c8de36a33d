"""The grasp approach planner (Handey 1987 §5.2, Figures 9 and 10): the hand moves in the grasp plane, led by bump lines."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.grasping.grasp_plane import GraspPlane
from handey_studio.world import Hand

LEVER_M = 0.06  # torques are measured against a lever about as long as a finger


@dataclass(frozen=True)
class BumpOptions:
    """Distances in metres, angles in radians. Two rings of bump lines: `near` ones stop a motion, `far` ones slow it down."""

    step: float = 0.002
    near: float = 0.002
    far: float = 0.010
    far_multiplier: float = 3.0
    turn_gain: float = 8.0
    max_turn: float = np.deg2rad(2.0)
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


@dataclass(frozen=True, eq=False)
class BumpRun(Value):
    """One run of the planner. `path` (k, 3): fingertip point y, z [m] and angle [rad] in the grasp plane, start first.

    `status`: reached, stuck (no motion is left), iterations (the limit was hit), or blocked start. `distance` [m] is what remained, and
    `threshold` [m] what had to be come under.
    """

    plane: GraspPlane
    path: NDArray
    goal: NDArray
    status: Literal["reached", "stuck", "iterations", "blocked start"]
    distance: float
    threshold: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", frozen_array(self.path))
        object.__setattr__(self, "goal", frozen_array(self.goal))


def hand_rectangles(hand: Hand) -> list[tuple[str, float, float, float]]:
    """(volume, half width, from, to) [m]: the hand's outline in the grasp plane, along the fingers from their tips at 0."""
    back = -hand.finger_length - hand.crosspiece_height
    rectangles = [
        ("fingers", hand.finger_width / 2.0, -hand.finger_length, 0.0),
        ("crosspiece", hand.crosspiece_width / 2.0, back, -hand.finger_length),
    ]
    mount = -float(hand.T_flange_hand[2, 3])
    return [*rectangles, ("crosspiece", hand.mount_radius, mount, back)] if mount < back else rectangles


def bump_lines(hand: Hand, options: BumpOptions) -> BumpLines:
    """Front and both sides of each of the hand's rectangles, at both distances."""
    ends, vectors, volumes, far = [], [], [], []
    for volume, w, low, high in hand_rectangles(hand):
        for distance in (options.near, options.far):
            d = distance
            lines = (
                ([[-w - d, high + d], [w + d, high + d]], [0.0, 1.0]),
                ([[w + d, low], [w + d, high + d]], [1.0, 0.0]),
                ([[-w - d, low], [-w - d, high + d]], [-1.0, 0.0]),
            )
            for line, vector in lines:
                ends.append(line)
                vectors.append(vector)
                volumes.append(volume)
                far.append(distance == options.far)
    return BumpLines(np.array(ends), np.array(vectors), tuple(volumes), np.array(far))


def plan_approach(plane: GraspPlane, hand: Hand, start: NDArray, goal: NDArray, options: BumpOptions = BumpOptions()) -> BumpRun:
    """Bring the fingertips from `start` (y, z, angle) to the point `goal` (y, z) [m] without entering a filled cell."""
    lines = bump_lines(hand, options)
    pose, path = np.array(start, dtype=float), [np.array(start, dtype=float)]
    goal = np.asarray(goal, dtype=float)
    status: Literal["reached", "stuck", "iterations", "blocked start"] = "iterations"
    if overlaps(plane, hand, pose):
        return BumpRun(plane, np.array(path), goal, "blocked start", float(np.linalg.norm(goal - pose[:2])), options.threshold)
    for _ in range(options.max_iterations):
        left = goal - pose[:2]
        distance = float(np.linalg.norm(left))
        if distance <= options.threshold:
            status = "reached"
            break
        colliding = colliding_lines(plane, lines, pose)
        moved = _free_step(plane, hand, lines, colliding, pose, left, options)
        if moved is None:
            status = "stuck"
            break
        pose = moved
        path.append(pose)
    return BumpRun(plane, np.array(path), goal, status, float(np.linalg.norm(goal - pose[:2])), options.threshold)


def colliding_lines(plane: GraspPlane, lines: BumpLines, pose: NDArray) -> NDArray:
    """Which bump lines (m,) cross a filled cell when the hand is at a pose (y, z, angle)."""
    return np.array(
        [
            _meets_filled(_grid(plane, volume), plane.origin, plane.cell, pose, *ends.min(axis=0), *ends.max(axis=0))
            for volume, ends in zip(lines.volumes, lines.ends, strict=True)
        ]
    )


def overlaps(plane: GraspPlane, hand: Hand, pose: NDArray) -> bool:
    """Whether the hand itself lies in a filled cell at a pose (y, z, angle)."""
    return any(
        _meets_filled(_grid(plane, volume), plane.origin, plane.cell, pose, -w, low, w, high)
        for volume, w, low, high in hand_rectangles(hand)
    )


def _grid(plane: GraspPlane, volume: str) -> NDArray:
    return plane.fingers if volume == "fingers" else plane.crosspiece


@njit(cache=True)
def _meets_filled(grid: NDArray, origin: NDArray, cell: float, pose: NDArray, a0: float, b0: float, a1: float, b1: float) -> bool:
    """Whether a rectangle of the hand's frame, a0 ≤ across ≤ a1 and b0 ≤ along ≤ b1 (a line if flat), meets a filled cell or the border."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    columns, rows = 1 + int(np.ceil((a1 - a0) / cell)), 1 + int(np.ceil((b1 - b0) / cell))
    for k in range(columns):
        a = a0 + (a1 - a0) * k / max(columns - 1, 1)
        for m in range(rows):
            b = b0 + (b1 - b0) * m / max(rows - 1, 1)
            i = int(np.floor((pose[0] - s * a + c * b - origin[0]) / cell))
            j = int(np.floor((pose[1] + c * a + s * b - origin[1]) / cell))
            if i < 0 or j < 0 or i >= len(grid) or j >= len(grid) or grid[i, j]:
                return True
    return False


def _hand_axes(angle: float) -> NDArray:
    """Rows: the hand's across and along directions in the plane's y, z."""
    along = np.array([np.cos(angle), np.sin(angle)])
    return np.array([[-along[1], along[0]], along])


def _free_step(
    plane: GraspPlane, hand: Hand, lines: BumpLines, colliding: NDArray, pose: NDArray, left: NDArray, options: BumpOptions
) -> NDArray | None:
    """The next pose, or None when no motion is left.

    Move along the free motion vector as far as the scaled bump vectors allow; if they allow nothing, along the non-zero bump vector
    closest to it, which gives the stairstep motion that the paper speaks of.
    """
    vectors = lines.vectors @ _hand_axes(pose[2])
    multipliers = _multipliers(lines, colliding, options)
    distance = float(np.linalg.norm(left))
    free = left / distance
    turn = _turn(lines, colliding, options)
    towards = vectors @ free
    limits = np.where(towards > 1e-9, multipliers / np.maximum(towards, 1e-9), np.inf)
    advance = min(float(limits.min()) * options.step, distance)
    trials = [(advance * free, turn), (advance * free, 0.0)] if advance > 1e-6 else []
    open_vectors = (multipliers > 0) & (towards > 0.05)
    if open_vectors.any():
        side = vectors[np.argmax(np.where(open_vectors, towards, -np.inf))]
        trials += [(options.step * side, turn), (options.step * side, 0.0)]
    if turn != 0.0:
        trials.append((np.zeros(2), turn))
    for shift, angle in trials:
        candidate = pose + np.array([shift[0], shift[1], angle])
        if not overlaps(plane, hand, candidate):
            return candidate
    return None


def _multipliers(lines: BumpLines, colliding: NDArray, options: BumpOptions) -> NDArray:
    """0 where a near line collides, 1 where only the far one does, and the far multiplier where neither does."""
    near_hit, far_hit = colliding & ~lines.far, colliding & lines.far
    partner = np.where(lines.far, -3, 3) + np.arange(len(colliding))  # each near triple is followed by its far one
    near_hit, far_hit = near_hit | near_hit[partner], far_hit | far_hit[partner]
    return np.where(near_hit, 0.0, np.where(far_hit, 1.0, options.far_multiplier))


def _turn(lines: BumpLines, colliding: NDArray, options: BumpOptions) -> float:
    """Turn [rad] by the summed torques: bump vector × the arm from the grasp point to the bump line's centre, pushing away."""
    if not colliding.any():
        return 0.0
    centres = lines.ends.mean(axis=1)
    # (across, along) is a left-handed pair of axes, as a positive turn carries `along` towards `across`; hence minus vector × arm
    # is the turn that moves the line's centre away from what it bumps into.
    torque = lines.vectors[:, 1] * centres[:, 0] - lines.vectors[:, 0] * centres[:, 1]
    turn = options.turn_gain * float(torque[colliding].sum()) * options.step / LEVER_M
    return float(np.clip(turn, -options.max_turn, options.max_turn))
