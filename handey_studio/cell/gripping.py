"""Closing the fingers on true bodies, by geometry alone: what is between them, how far they close, how it aligns."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from handey_studio.cell.bodies import SolidBody
from handey_studio.geometry.transforms import apply, inverse, rotation_about, transform
from handey_studio.world.robot import Hand

ALIGN_RAD = np.deg2rad(5.0)  # faces further off the fingers than this stay as they are: the fingers touch an edge
SQUEEZE_M = 0.0005  # a commanded opening up to this much wider than the body still presses on it: the hand's own compliance


@dataclass(frozen=True)
class Grip:
    """Fingers closed to `opening` [m]; `held` names the body between them, at T_hand_body, or is None."""

    opening: float
    held: str | None
    T_hand_body: NDArray | None


def close_fingers(hand: Hand, T_world_hand: NDArray, bodies: Sequence[SolidBody], start: float, commanded: float) -> Grip:
    """Close from `start` to `commanded` [m], or onto what is between the fingers.

    Both fingers move alike and push a free body to the middle; its faces turn flat against them. When several bodies are
    between the fingers, the widest is held and the others only keep the fingers apart. Fixed bodies are never held.
    """
    T_hand_world = inverse(T_world_hand)
    spans: dict[str, tuple[float, float]] = {}
    for body in bodies:
        span = span_between(hand, T_hand_world @ body.T_world_body, body, start)
        if span is not None:
            spans[body.name] = span
    if not spans:
        return Grip(commanded, None, None)
    reach = max(high for _, high in spans.values()) - min(low for low, _ in spans.values())
    free = [body for body in bodies if not body.fixed and body.name in spans]
    if reach < commanded - SQUEEZE_M or not free:
        return Grip(max(commanded, reach), None, None)
    held = max(free, key=lambda body: spans[body.name][1] - spans[body.name][0])
    T_hand_body = _aligned(hand, T_hand_world @ held.T_world_body, held, start)
    span = span_between(hand, T_hand_body, held, hand.opening_max)
    width = span[1] - span[0] if span is not None and len(spans) == 1 else reach
    return Grip(max(width, hand.opening_min), held.name, T_hand_body)


def span_between(hand: Hand, T_hand_body: NDArray, body: SolidBody, opening: float) -> tuple[float, float] | None:
    """Least and greatest x [m] of the hand frame that a body reaches in the space between the fingers; None when it is not there."""
    bounds = [(-opening / 2, opening / 2), (-hand.finger_width / 2, hand.finger_width / 2), (-hand.finger_length, 0.0)]
    low, high = np.inf, -np.inf
    for piece in body.pieces:
        corners = apply(T_hand_body, piece)
        if any(corners[:, k].max() < bounds[k][0] or corners[:, k].min() > bounds[k][1] for k in range(3)):
            continue
        planes = ConvexHull(corners).equations
        ends = [linprog((sign, 0, 0), A_ub=planes[:, :3], b_ub=-planes[:, 3], bounds=bounds) for sign in (1.0, -1.0)]
        if all(end.status == 0 for end in ends):
            low, high = min(low, ends[0].fun), max(high, -ends[1].fun)
    return (low, high) if low <= high else None


def _aligned(hand: Hand, T_hand_body: NDArray, body: SolidBody, opening: float) -> NDArray:
    """The pose that the fingers push a body into: faces flat against them, in the middle between them."""
    normals = body.solid.normals @ T_hand_body[:3, :3].T
    best = normals[int(np.argmax(normals[:, 0]))]
    axis = np.cross(best, (1.0, 0.0, 0.0))
    angle = float(np.arctan2(np.linalg.norm(axis), best[0]))
    opposed = bool((normals @ best).min() < -np.cos(np.deg2rad(1.0)))
    T = T_hand_body
    if 1e-12 < angle <= ALIGN_RAD and opposed:
        pivot = T[:3, 3] + T[:3, :3] @ body.solid.volume_and_centroid[1]
        R = rotation_about(axis, angle)
        T = transform(R, pivot - R @ pivot) @ T
    span = span_between(hand, T, body, opening)
    return T if span is None else transform(None, (-(span[0] + span[1]) / 2, 0.0, 0.0)) @ T
