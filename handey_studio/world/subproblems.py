"""The questions about single turns into which inverse kinematics is taken apart (Paden & Kahan 1985; Elias & Wen 2022).

Axes are of length one, angles in radians. Where any angle would do, zero is taken.
"""

import numpy as np
from numba import njit

from handey_studio.world.vectors import Vector, across, cross, dot, length

SLACK = 1e-9  # share by which rounding may carry a stretched arm beyond its reach
NOISE = 1e-12  # the same where what turns is about nothing: near singularities


@njit(cache=True)
def angle_onto(axis: Vector, p: Vector, q: Vector) -> float:
    """The angle about the axis that turns p onto q, or as near to it as any."""
    a, b = across(axis, p), across(axis, q)
    if length(a) < NOISE or length(b) < NOISE:
        return 0.0
    return np.arctan2(dot(axis, cross(a, b)), dot(a, b))


@njit(cache=True)
def angles_to_plane(h: Vector, axis: Vector, p: Vector, d: float) -> tuple[bool, float, float]:
    """Whether p turned about the axis comes to where h·p = d, and the two angles at which it does, or is nearest to it."""
    a, b = across(axis, p), across(axis, h)
    cosine, sine = dot(a, b), dot(b, cross(axis, a))
    size, wanted = np.hypot(cosine, sine), d - dot(h, axis) * dot(axis, p)
    there = abs(wanted) <= size * (1.0 + SLACK) + NOISE
    if size <= NOISE:
        return there, 0.0, 0.0
    middle, half = np.arctan2(sine, cosine), np.arccos(min(1.0, max(-1.0, wanted / size)))
    return there, middle - half, middle + half


@njit(cache=True)
def angles_to_distance(axis: Vector, p: Vector, q: Vector, d: float) -> tuple[bool, float, float]:
    """Whether p turned about the axis comes to the distance d of q, and the two angles, as in `angles_to_plane`."""
    return angles_to_plane(q, axis, p, (dot(p, p) + dot(q, q) - d * d) / 2.0)
