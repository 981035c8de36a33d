"""Inverse kinematics of six joints in closed form, every branch, for the two layouts that most arms have.

Both are taken apart into subproblems as Elias & Wen ("IK-Geo", 2022) do. G is T_base_flange T₀⁻¹ = e₁ … e₆ (see `screws`). Axes and joints
have the numbers of the code, from 0.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.world.screws import Screws, screwed, swung
from handey_studio.world.subproblems import angle_onto, angles_to_distance, angles_to_plane
from handey_studio.world.vectors import Vector, across, dot, length, minus, placed_by, row, times, turned_back_by, turned_by

ALIGNED = 1e-7  # axes this near to parallel leave their share of the turn undetermined


@njit(cache=True)
def three_parallel(screws: Screws, G: NDArray, meet: Vector) -> tuple[NDArray, int]:
    """Branches (8, 6) [rad], and how many they are. Axes 1, 2 and 3 are parallel, 4 and 5 meet in `meet` [m]: Universal Robots' arms."""
    out, count = np.empty((8, 6)), 0
    w0, w1, w2 = row(screws.directions, 0), row(screws.directions, 1), row(screws.directions, 2)
    w3, w4, w5 = row(screws.directions, 3), row(screws.directions, 4), row(screws.directions, 5)
    p0, p1, p2, p3 = row(screws.points, 0), row(screws.points, 1), row(screws.points, 2), row(screws.points, 3)
    there, q0a, q0b = angles_to_plane(w1, times(-1.0, w0), minus(placed_by(G, meet), p0), dot(w1, minus(meet, p0)))
    if not there:
        return out, 0
    for q0 in (q0a, q0b):
        there, q4a, q4b = angles_to_plane(w1, w4, w5, dot(w1, swung(screws, 0, -q0, turned_by(G, w5))))
        if not there:
            continue
        for q4 in (q4a, q4b):
            level = swung(screws, 4, -q4, w1)
            q5 = angle_onto(times(-1.0, w5), level, turned_back_by(G, swung(screws, 0, q0, w1)))
            if length(across(w5, level)) < ALIGNED:
                q5 = _comfortable(screws, G, q0, q4)
            # Left is e₁e₂e₃: where it takes a point of axis 3, and how far it turns in all.
            hinge = placed_by(G, screwed(screws, 5, -q5, screwed(screws, 4, -q4, p3)))
            hinge = minus(screwed(screws, 0, -q0, hinge), p1)
            there, q2a, q2b = angles_to_distance(w2, minus(p3, p2), minus(p1, p2), length(hinge))
            if not there:
                continue
            side = turned_by(G, swung(screws, 5, -q5, swung(screws, 4, -q4, w0)))
            total = angle_onto(w1, w0, swung(screws, 0, -q0, side))
            for q2 in (q2a, q2b):
                q1 = angle_onto(w1, minus(screwed(screws, 2, q2, p3), p1), hinge)
                out[count, 0], out[count, 1], out[count, 2] = q0, q1, q2
                out[count, 3], out[count, 4], out[count, 5] = (total - q1 - q2 * dot(w1, w2)) * dot(w1, w3), q4, q5
                count += 1
    return out, count


@njit(cache=True)
def _comfortable(screws: Screws, G: NDArray, q0: float, q4: float) -> float:
    """Joint 5 where it turns about the same direction as joints 1, 2 and 3, so that any angle will do: the elbow as square as can be."""
    p1, p2, p3, p5 = row(screws.points, 1), row(screws.points, 2), row(screws.points, 3), row(screws.points, 5)
    shoulder = minus(screwed(screws, 0, q0, p1), (G[0, 3], G[1, 3], G[2, 3]))
    square = np.sqrt(dot(minus(p2, p1), minus(p2, p1)) + dot(minus(p3, p2), minus(p3, p2)))
    turn = times(-1.0, row(screws.directions, 5))
    _, q5, _ = angles_to_distance(turn, minus(screwed(screws, 4, -q4, p3), p5), minus(turned_back_by(G, shoulder), p5), square)
    return q5


@njit(cache=True)
def spherical_wrist(screws: Screws, G: NDArray, meet: Vector) -> tuple[NDArray, int]:
    """Branches (8, 6) [rad], and how many they are, where axes 1 and 2 are parallel and 3, 4 and 5 meet in `meet` [m], as in the Puma."""
    out, count = np.empty((8, 6)), 0
    w0, w1, w2 = row(screws.directions, 0), row(screws.directions, 1), row(screws.directions, 2)
    w3, w4, w5 = row(screws.directions, 3), row(screws.directions, 4), row(screws.directions, 5)
    p0, p1, p2 = row(screws.points, 0), row(screws.points, 1), row(screws.points, 2)
    wrist = placed_by(G, meet)
    there, q0a, q0b = angles_to_plane(w1, times(-1.0, w0), minus(wrist, p0), dot(w1, minus(meet, p0)))
    if not there:
        return out, 0
    for q0 in (q0a, q0b):
        lifted = minus(screwed(screws, 0, -q0, wrist), p1)
        there, q2a, q2b = angles_to_distance(w2, minus(meet, p2), minus(p1, p2), length(lifted))
        if not there:
            continue
        for q2 in (q2a, q2b):
            q1 = angle_onto(w1, minus(screwed(screws, 2, q2, meet), p1), lifted)
            aim = swung(screws, 2, -q2, swung(screws, 1, -q1, swung(screws, 0, -q0, turned_by(G, w5))))
            side = swung(screws, 2, -q2, swung(screws, 1, -q1, swung(screws, 0, -q0, turned_by(G, w4))))
            there, q3a, q3b = angles_to_plane(w4, times(-1.0, w3), aim, dot(w4, w5))
            if not there:
                continue
            for q3 in (q3a, q3b):
                q4 = angle_onto(w4, w5, swung(screws, 3, -q3, aim))
                q5 = angle_onto(w5, w4, swung(screws, 4, -q4, swung(screws, 3, -q3, side)))
                out[count, 0], out[count, 1], out[count, 2] = q0, q1, q2
                out[count, 3], out[count, 4], out[count, 5] = q3, q4, q5
                count += 1
    return out, count
