"""Every grasp of two parallel faces that a dense sampling finds at both ends of a MOVE, by geometry that the planner does not use.

Points all over the part's surface, fingers from all around and at many depths, contact counted point by point, the hand's boxes against
every body by their separating axes, the arm's link meshes by FCL. What is left over when the planner refuses speaks against it.
"""

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.checker import CheckOptions
from handey_studio.cell.check.contacts import Sampled, contacts, true_scene
from handey_studio.cell.check.penetration import overlap, polytope, polytopes_of
from handey_studio.geometry.transforms import apply
from handey_studio.world import FINGERS, Part, Robot, arm_of

OPENED_M = 0.006  # beyond the part's width: the least that the planner opens the hand, and the margin that it keeps on each side
SPACING_M, PAD_M = 0.008, 0.002
AROUND = np.deg2rad(np.arange(0.0, 360.0, 15.0))
CLEAR_M, LIMIT_RAD = 0.0011, np.deg2rad(3.0)
PICK = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)


@dataclass(frozen=True)
class Ends:
    """A part's two places (4, 4) and what stands around it."""

    part: Part
    T_start: np.ndarray
    T_goal: np.ndarray
    bodies: tuple[SolidBody, ...]
    robot: Robot


def left_over(ends: Ends, enough: float = np.inf) -> Counter:
    """How many sampled grasps come through each test; `all` of them would serve both ends. It stops when there are `enough`."""
    counts: Counter = Counter()
    places = [(T, _around(ends, T)) for T in (ends.T_start, ends.T_goal)]
    for T_part_hand, width in _grasps(ends):
        if counts["all"] >= enough:
            break
        counts["grasps"] += 1
        free = [_hand_free(T @ T_part_hand, width, around, ends.robot.hand) for T, around in places]
        counts["free at the pickup"] += free[0]
        counts["free at the putdown"] += free[1]
        if all(free):
            counts["free at both"] += 1
            counts["all"] += all(_arm_free(ends, T, T_part_hand, width) for T in (ends.T_start, ends.T_goal))
    return counts


def _inside(part, points):
    """Which points (n, 3) of the part's frame lie in it."""
    axes = [(p.normals, (p.corners @ p.normals.T).min(axis=0), (p.corners @ p.normals.T).max(axis=0)) for p in map(polytope, part.pieces)]
    return np.any([((points @ n.T >= low) & (points @ n.T <= high)).all(axis=1) for n, low, high in axes], axis=0)


def _grasps(ends: Ends):
    """T_part_hand (4, 4) and the width [m] of grasps with enough contact, from all over the surface."""
    solid, hand = ends.part.solid, ends.robot.hand
    for f, normal in enumerate(solid.normals):
        across = [g for g, other in enumerate(solid.normals) if other @ normal < -0.9999 and g > f]
        T = solid.face_frame(f)
        for width in {round(float(solid.offsets[f] + solid.offsets[g]), 6) for g in across}:
            if 0 < width < hand.opening_max - 0.003:
                yield from _across(ends, T, normal, width)


def _across(ends, T, normal, width):
    """The grasps that close along the normal of a face, so wide."""
    hand, local = ends.robot.hand, (ends.part.solid.vertices - T[:3, 3]) @ T[:3, :2]
    low, high = local.min(axis=0), local.max(axis=0)
    flat = np.stack(np.meshgrid(*(np.arange(low[k] + PAD_M / 2, high[k], PAD_M) for k in (0, 1)), indexing="ij"), axis=-1).reshape(-1, 2)
    middle = T[:3, 3] - 0.5 * width * normal
    points = middle + flat @ T[:3, :2].T
    touched = np.ones(len(flat), dtype=bool)
    for side in (0.5, -0.5):
        surface = points + side * width * normal
        touched &= _inside(ends.part, surface - side * 2e-4 * normal) & ~_inside(ends.part, surface + side * 2e-4 * normal)
    touching = flat[touched]
    for at in np.stack(np.meshgrid(*(np.arange(low[k], high[k], SPACING_M) for k in (0, 1))), axis=-1).reshape(-1, 2):
        for angle in AROUND:
            along = np.array([np.cos(angle), np.sin(angle)])
            deep, aside = (touching - at) @ along, (touching - at) @ np.array([-along[1], along[0]])
            if (
                (deep <= 0) & (deep >= -hand.finger_length) & (np.abs(aside) <= hand.finger_width / 2)
            ).sum() * PAD_M**2 >= hand.min_contact_area:
                fingers = T[:3, :2] @ along
                T_part_hand = np.eye(4)
                T_part_hand[:3, :3] = np.stack([normal, np.cross(fingers, normal), fingers], axis=1)
                T_part_hand[:3, 3] = middle + T[:3, :2] @ at
                yield T_part_hand, width


@lru_cache(maxsize=64)
def _box(corners):
    return polytope(np.frombuffer(corners).reshape(8, 3))


def _around(ends, T):
    """What is solid at one end, the part too: pieces, their poses, how deep [m] the hand may be in them, and the boxes around them."""
    found = [(piece, body.T_world_body, -CLEAR_M) for body in ends.bodies for piece in polytopes_of(body)]
    found += [(polytope(piece), T, 1e-4) for piece in ends.part.pieces]
    corners = [apply(pose, piece.corners) for piece, pose, _ in found]
    return found, np.array([c.min(axis=0) for c in corners]) - CLEAR_M, np.array([c.max(axis=0) for c in corners]) + CLEAR_M


def _hand_free(T_world_hand, width, around, hand):
    """Whether the hand stands clear there, open around the part and closed on it."""
    found, lower, upper = around
    for opening, own in ((min(width + OPENED_M, hand.opening_max), 1e-4), (width, np.inf)):
        for low, high in hand.boxes(opening).values():
            corners = np.where(PICK, high, low).astype(float)
            there = apply(T_world_hand, corners)
            meet = ((lower <= there.max(axis=0)) & (upper >= there.min(axis=0))).all(axis=1)
            for k in np.nonzero(meet)[0]:
                piece, pose, limit = found[k]
                allowed = own if limit > 0 else limit if opening > width else -1e-4
                if np.isfinite(allowed) and overlap(_box(corners.tobytes()), T_world_hand, piece, pose) > allowed:
                    return False
    return True


def _arm_free(ends, T, T_part_hand, width):
    arm, opening = arm_of(ends.robot), min(width + OPENED_M, ends.robot.hand.opening_max)
    bodies = (*ends.bodies, SolidBody("part", ends.part.solid, T))
    scene = true_scene(ends.robot, bodies, {body.name: body.name for body in bodies})
    touching = frozenset(frozenset((finger, "part")) for finger in FINGERS)
    for turn in (np.eye(4), np.diag([-1.0, -1.0, 1.0, 1.0])):
        branches = arm.nearest_turns(arm.ik(T @ T_part_hand @ turn), ends.robot.home).reshape(-1, arm.n)
        for q in branches[ends.robot.limit_margin(branches) >= LIMIT_RAD]:
            if not contacts(scene, arm, Sampled(np.zeros(1), q[None], np.array([opening])), touching, CheckOptions()):
                return True
    return False
