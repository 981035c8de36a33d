"""Inverse kinematics of seven joints with joint 2 held, for arms whose axes 0, 1 and 2 meet in a shoulder and 4 and 5 in a wrist.

With joint 6 given all else has a closed form: the distance from shoulder to wrist bends joint 3 one way or the other, and the direction of
axis 5 tells how far the elbow is turned about the line between them, again in one of two ways. One equation is left: joint 2 is
where it is held. Taken for all four branches at once, as their product, and freed of the denominators Δ² and ∏M, it is a trigonometric
polynomial of degree eight in joint 6, real or not; its sixteen roots are found at once, and the real ones are polished.
Joints are numbered as in code, from 0.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.world.ik_newton import from_starts
from handey_studio.world.screws import Screws, screwed, swung
from handey_studio.world.subproblems import angle_onto, angles_to_distance, angles_to_plane
from handey_studio.world.vectors import Vector, across, cross, dot, length, minus, placed_by, plus, rotated, row, times, turned, turned_by

DEGREE, SAMPLES = 8, 32
SHIFTS = (0.3, -0.45, 0.7)  # imaginary parts of joint 6 where the polynomial is sampled: off the real angles, where denominators may vanish
CLEAN = 1e-9  # share of the largest coefficient that those beyond the degree may have from rounding
REAL = 1e-2  # a root this near to a real one is tried: where two roots all but meet rounding makes them complex
NEAR = 0.05  # a branch that misses the equation by more is another root's
ALIGNED = 1e-9  # vectors this near to parallel, or this short, leave a turn undetermined
FREE = np.array([0, 1, 3, 4, 5, 6])


def held_third(screws: Screws, T: NDArray, G: NDArray, shoulder: Vector, wrist: Vector, held: float, rounds: int) -> NDArray:
    """Configurations (k, 7) [rad], some of them more than once, that put the flange at T with joint 2 at `held`; G as in `ik_closed`."""
    trials = [_coefficients(screws, G, shoulder, wrist, held, SHIFTS[0])]
    while trials[-1][1] > CLEAN and len(trials) < len(SHIFTS):
        trials.append(_coefficients(screws, G, shoulder, wrist, held, SHIFTS[len(trials)]))
    coefficients = min(trials, key=lambda trial: trial[1])[0]
    roots = np.roots(coefficients)
    angles = np.angle(roots[np.abs(np.log(np.abs(roots) + 1e-300)) < REAL])
    seeds, count = _postures(screws, G, shoulder, wrist, held, angles)
    return from_starts(screws, T, seeds[:count], FREE, rounds)


def _coefficients(screws: Screws, G: NDArray, shoulder: Vector, wrist: Vector, held: float, shift: float) -> tuple[NDArray, float]:
    """The polynomial's coefficients (17,) in exp(iq₆), highest first, and how much of them lies beyond its degree."""
    samples = 2 * np.pi * np.arange(SAMPLES) / SAMPLES + 1j * shift
    values = np.fft.fft(_products(screws, G, shoulder, wrist, held, samples))
    powers = np.arange(-SAMPLES // 2, SAMPLES // 2)
    found = values[powers] * np.exp(shift * powers)
    inside = np.abs(powers) <= DEGREE
    most = np.abs(found[inside]).max()
    if not np.isfinite(most) or most == 0.0:
        return np.zeros(2 * DEGREE + 1), np.inf
    return found[inside][::-1] / most, float(np.abs(values[powers][~inside]).max() / np.abs(values).max())


@njit(cache=True)
def _products(screws: Screws, G: NDArray, shoulder: Vector, wrist: Vector, held: float, samples: NDArray) -> NDArray:
    """The polynomial (k,) at complex angles of joint 6."""
    out = np.empty(len(samples), np.complex128)
    w3, w4, w5, p3 = row(screws.directions, 3), row(screws.directions, 4), row(screws.directions, 5), row(screws.points, 3)
    p, t, share = across(w3, minus(wrist, p3)), minus(shoulder, p3), dot(w4, w5)
    cosine, sine = dot(t, p), dot(t, cross(w3, p))
    size = cosine * cosine + sine * sine
    fixed = dot(minus(wrist, p3), minus(wrist, p3)) / 2.0 + dot(t, t) / 2.0 - dot(t, w3) * dot(w3, minus(wrist, p3))
    for k in range(len(samples)):
        reach = minus(placed_by(G, screwed(screws, 6, -samples[k], wrist)), shoulder)
        aim = turned_by(G, swung(screws, 6, -samples[k], w5))
        far, along = dot(reach, reach), dot(reach, aim)
        wanted = fixed - far / 2.0
        bend = np.sqrt(size - wanted * wanted)
        value = 1.0 / (far - along * along) ** 2
        for way in (1.0, -1.0):
            c, s = (cosine * wanted - way * sine * bend) / size, (sine * wanted + way * cosine * bend) / size
            before = minus(plus(p3, rotated(w3, c, s, minus(wrist, p3))), shoulder)
            roll = rotated(w3, c, s, w4)
            value *= _both(screws, held, reach, aim, before, roll, share) / (far - dot(before, roll) ** 2)
        out[k] = value
    return out


@njit(cache=True)
def _both(screws: Screws, held: float, reach: Vector, aim: Vector, before: Vector, roll: Vector, share: float) -> complex:
    """The equation, times its denominators Δ and M, for one bend of joint 3, multiplied over both turns of the elbow."""
    w0, middle = row(screws.directions, 0), swung(screws, 2, -held, row(screws.directions, 1))
    far, along, own = dot(reach, reach), dot(reach, aim), dot(before, roll)
    delta, M = far - along * along, far - own * own
    n = cross(before, roll)
    fixed = delta * (dot(w0, reach) * dot(cross(roll, n), middle) - dot(w0, row(screws.directions, 1)) * M)
    size = np.sqrt(delta - own * own - share * share * far + 2.0 * own * share * along)
    level = plus(times(own - share * along, reach), times(share * far - own * along, aim))
    value = 1.0 + 0.0j
    for way in (1.0, -1.0):
        pointing = plus(level, times(way * size, cross(reach, aim)))
        value *= fixed + dot(w0, pointing) * dot(cross(n, before), middle) + dot(w0, cross(reach, pointing)) * dot(n, middle)
    return value


@njit(cache=True)
def _postures(screws: Screws, G: NDArray, shoulder: Vector, wrist: Vector, held: float, angles: NDArray) -> tuple[NDArray, int]:
    """The configurations (m, 7), how many they are: joint 6 at one of the angles (m,), joint 2 about where it is held."""
    out, count = np.empty((4 * len(angles), 7)), 0
    for q6 in angles:
        for branch in range(4):
            off, q3, to, pointing = _elbow(screws, G, shoulder, wrist, held, q6, branch)
            if abs(off) < NEAR:
                out[count] = _posture(screws, G, shoulder, wrist, held, q6, q3, to, pointing)
                count += 1
    return out, count


@njit(cache=True)
def _elbow(
    screws: Screws, G: NDArray, shoulder: Vector, wrist: Vector, held: float, q6: float, branch: int
) -> tuple[float, float, Vector, Vector]:
    """Branch 0–3 with joint 6 at q6, or what is nearest to it: by how much it misses the equation, and joint 3.

    Also the direction from the shoulder to the wrist, and where axis 4 points.
    """
    w3, w4, w5, p3 = row(screws.directions, 3), row(screws.directions, 4), row(screws.directions, 5), row(screws.points, 3)
    reach = minus(placed_by(G, screwed(screws, 6, -q6, wrist)), shoulder)
    aim = turned_by(G, swung(screws, 6, -q6, w5))
    far = max(length(reach), ALIGNED)
    _, a, b = angles_to_distance(w3, minus(wrist, p3), minus(shoulder, p3), far)
    q3, to = a if branch < 2 else b, times(1.0 / far, reach)
    along, roll = _forearm(screws, shoulder, wrist, q3)
    # Axis 4 keeps its angle to the line from the shoulder to the wrist, and its angle to axis 5: it turns about the line until it does.
    start, aside = across(to, aim), length(across(along, roll))
    start = plus(times(dot(along, roll), to), times(aside / max(length(start), ALIGNED), start))
    _, a, b = angles_to_plane(aim, to, start, dot(w4, w5))
    pointing = turned(to, a if branch % 2 == 0 else b, start)
    w0, w1 = row(screws.directions, 0), row(screws.directions, 1)
    middle = _carried(along, roll, to, pointing, swung(screws, 2, -held, w1))
    return dot(w0, middle) - dot(w0, w1), q3, to, pointing


@njit(cache=True)
def _forearm(screws: Screws, shoulder: Vector, wrist: Vector, q3: float) -> tuple[Vector, Vector]:
    """The direction from the shoulder to the wrist and that of axis 4, while the joints before joint 3 are at zero."""
    before = minus(screwed(screws, 3, q3, wrist), shoulder)
    return times(1.0 / max(length(before), ALIGNED), before), swung(screws, 3, q3, row(screws.directions, 4))


@njit(cache=True)
def _carried(x: Vector, y: Vector, x_to: Vector, y_to: Vector, v: Vector) -> Vector:
    """What v becomes by the rotation that takes the unit vector x to x_to, and y, which is not along it, to y_to."""
    n, n_to = cross(x, y), cross(x_to, y_to)
    n, n_to = times(1.0 / max(length(n), ALIGNED), n), times(1.0 / max(length(n_to), ALIGNED), n_to)
    return plus(plus(times(dot(x, v), x_to), times(dot(n, v), n_to)), times(dot(cross(x, n), v), cross(x_to, n_to)))


@njit(cache=True)
def _posture(
    screws: Screws, G: NDArray, shoulder: Vector, wrist: Vector, held: float, q6: float, q3: float, to: Vector, pointing: Vector
) -> NDArray:
    """The whole configuration (7,), exact where the equation holds."""
    w0, w1, w2 = row(screws.directions, 0), row(screws.directions, 1), row(screws.directions, 2)
    w4, w5 = row(screws.directions, 4), row(screws.directions, 5)
    along, roll = _forearm(screws, shoulder, wrist, q3)
    q0 = angle_onto(w0, w1, _carried(along, roll, to, pointing, swung(screws, 2, -held, w1)))
    q1 = angle_onto(w1, w2, swung(screws, 0, -q0, _carried(along, roll, to, pointing, w2)))
    # Back through joints 0 to 3: what the last joints still have to do with axes 5 and 4.
    aim = swung(screws, 3, -q3, _carried(to, pointing, along, roll, turned_by(G, swung(screws, 6, -q6, w5))))
    side = swung(screws, 3, -q3, _carried(to, pointing, along, roll, turned_by(G, swung(screws, 6, -q6, w4))))
    q4 = angle_onto(w4, w5, aim)
    return np.array([q0, q1, held, q3, q4, angle_onto(w5, w4, swung(screws, 4, -q4, side)), q6])
