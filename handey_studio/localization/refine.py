"""Refine: faces to readings, point to plane, and outlines to edge pixels, by robust Gauss–Newton steps.

From straight above a flat-lying part shows only its top, so nothing but the outline fixes it sideways. A sensor loses a
margin at each silhouette: half a pixel by its grid alone, several millimetres with depth cameras. That margin is one
more unknown of the fit, so that it does not push the part when only one of two opposite sides is seen.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.localization.edges import JUMP
from handey_studio.localization.evidence import KIND, Evidence, Limits, X, Y, Z, ray_at
from handey_studio.localization.posed import GRAZING, ON, facing, placed, reading_at, turned
from handey_studio.localization.predicted_edges import edge_state
from handey_studio.localization.samples import ALONG, INTO_LEFT, INTO_RIGHT, PartSamples
from handey_studio.localization.shares import shared
from handey_studio.localization.verify import LEAST_POSES
from handey_studio.sensing.depth_view import DepthView

TAPERING = 0.5  # limits shrink to this share over the iterations
MAX_TURN = 0.2  # rad in one step
STILL_RAD, STILL = 5e-4, 0.05  # a step that turns and shifts (in sigmas of a reading) by less is the last


class Refined(NamedTuple):
    """Poses `R` (n, 3, 3), `t` (n, 3) where the view agrees best; the `margin` (n,) [m] that the sensor lost at silhouettes;
    `rms` (n,) [m] of readings off their faces; `covariance` (n, 6, 6) of a small turn [rad]
    about the sensor's axes at the part's origin, and shift [m]."""

    R: NDArray
    t: NDArray
    margin: NDArray
    rms: NDArray
    covariance: NDArray

    def rows(self, chosen: NDArray) -> "Refined":
        """Some of the poses, by their numbers."""
        return Refined(*(array[chosen] for array in self))


class Weights(NamedTuple):
    """Standard deviations [m] of a reading off its face and an edge pixel off its outline; the margin's expected value and spread [m]."""

    face: float
    edge: float
    margin: float
    margin_spread: float


def weights_of(view: DepthView, pixel: float) -> Weights:
    """From the view's noise and outline error and the size of a pixel [m]."""
    return Weights(
        2.0 * view.noise, view.noise + 0.5 * view.outline_error, 0.5 * pixel + 0.2 * view.outline_error, 0.5 * view.outline_error
    )


def refine(R: NDArray, t: NDArray, samples: PartSamples, evidence: Evidence, limits: Limits, weights: Weights, iterations: int) -> Refined:
    """Poses R (n, 3, 3), t (n, 3) moved to where the view agrees best, each until it stands still or `iterations` are done."""
    n = len(t)
    refined = Refined(np.array(R), np.array(t), np.full(n, weights.margin), np.full(n, np.inf), np.zeros((n, 6, 6)))
    shared(lambda first, last: _refine(refined, samples, evidence, limits, weights, iterations, (first, last)), n, LEAST_POSES)
    return refined


@njit(cache=True, error_model="numpy")
def _add(A, g, row, residual, sigma):
    """One observation, weighted down the farther it is off (Cauchy), into the normal equations."""
    scaled = residual / sigma
    weight = 1.0 / (1.0 + scaled * scaled / 4.0) / (sigma * sigma)
    for r in range(7):
        g[r] += weight * row[r] * residual
        for c in range(r + 1):
            A[r, c] += weight * row[r] * row[c]


@njit(cache=True, error_model="numpy", inline="always")
def _row(row, mx, my, mz, px, py, pz):
    """Derivative of m · (turn × p + shift) by the turn and the shift."""
    row[0], row[1], row[2] = py * mz - pz * my, pz * mx - px * mz, px * my - py * mx
    row[3], row[4], row[5] = mx, my, mz
    row[6] = 0.0


@njit(cache=True, error_model="numpy")
def _faces(R, t, samples, evidence, limits, sigma, A, g):
    """Readings to the planes of the faces that they lie on; (sum of squares, count)."""
    row, normals = np.zeros(7), turned(R, samples.normal)
    points, faces, depth, camera = samples.face_point, samples.face, evidence.depth, evidence.camera
    squares, count = 0.0, 0
    for k in range(len(faces)):
        x, y, z = placed(R, t, points, k)
        face = faces[k]
        cosine = facing(normals[face, 0], normals[face, 1], normals[face, 2], x, y, z, camera)
        if cosine < GRAZING:
            continue
        seen, behind = reading_at(x, y, z, depth, camera, limits)
        if seen != ON:
            continue
        residual = -behind / ray_at(x, y, z, camera)[2] * cosine  # of the reading from the face, along its outward normal
        _row(row, normals[face, 0], normals[face, 1], normals[face, 2], x - t[0], y - t[1], z - t[2])
        _add(A, g, row, residual, sigma)
        squares += residual * residual
        count += 1
    return squares, count


@njit(cache=True, error_model="numpy")
def _outlines(R, t, margin, samples, evidence, limits, sigma, A, g):
    """Edge pixels to the visible edges, across both the edge and the line of sight; silhouettes less the margin."""
    row, posed = np.zeros(7), turned(R, samples.directions)
    points, edge_of, concave = samples.edge_point, samples.edge, samples.concave
    depth, nearest, edges, camera, pixel = evidence
    for k in range(len(edge_of)):
        x, y, z = placed(R, t, points, k)
        e = edge_of[k]
        state, found, _, left, right = edge_state(x, y, z, posed, e, concave[e], depth, nearest, edges, camera, pixel, limits)
        if state != 1:
            continue
        rx, ry, rz = ray_at(x, y, z, camera)
        ax, ay, az = posed[e, ALONG, 0], posed[e, ALONG, 1], posed[e, ALONG, 2]
        mx, my, mz = ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx
        length = np.sqrt(mx * mx + my * my + mz * mz)
        if length < 0.2:
            continue
        into = INTO_LEFT if left else INTO_RIGHT
        outwards = -(mx * posed[e, into, 0] + my * posed[e, into, 1] + mz * posed[e, into, 2])
        sign = (1.0 if outwards > 0 else -1.0) / length
        mx, my, mz = sign * mx, sign * my, sign * mz
        qx, qy, qz = edges[found, X], edges[found, Y], edges[found, Z]
        share = z / qz if camera[0] < 0.5 else 1.0  # along the pixel's ray to the outline's depth
        residual = mx * (qx * share - x) + my * (qy * share - y)
        _row(row, mx, my, mz, x - t[0], y - t[1], z - t[2])
        if (left != right) and edges[found, KIND] == JUMP:
            residual += margin
            row[6] = -1.0
        _add(A, g, row, residual, sigma)


@njit(cache=True, error_model="numpy")
def _turned_by(R, w):
    """R after a small turn by the rotation vector w, exactly orthonormal (Rodrigues)."""
    angle = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    a = np.sin(angle) / angle if angle > 1e-9 else 1.0
    b = (1.0 - np.cos(angle)) / (angle * angle) if angle > 1e-9 else 0.5
    out = np.empty((3, 3))
    for c in range(3):
        x, y, z = R[0, c], R[1, c], R[2, c]
        kx, ky, kz = w[1] * z - w[2] * y, w[2] * x - w[0] * z, w[0] * y - w[1] * x
        out[0, c] = x + a * kx + b * (w[1] * kz - w[2] * ky)
        out[1, c] = y + a * ky + b * (w[2] * kx - w[0] * kz)
        out[2, c] = z + a * kz + b * (w[0] * ky - w[1] * kx)
    return out


@njit(cache=True, error_model="numpy")
def _factored(A):
    """The Cholesky factor L (n, n) of a positive definite matrix, of which the lower half is read."""
    L = np.zeros_like(A)
    for r in range(len(A)):
        for c in range(r + 1):
            rest = A[r, c]
            for k in range(c):
                rest -= L[r, k] * L[c, k]
            L[r, c] = np.sqrt(rest) if r == c else rest / L[c, c]
    return L


@njit(cache=True, error_model="numpy")
def _solved(L, g):
    """x with L Lᵀ x = g."""
    x = g.copy()
    for r in range(len(x)):
        for k in range(r):
            x[r] -= L[r, k] * x[k]
        x[r] /= L[r, r]
    for r in range(len(x) - 1, -1, -1):
        for k in range(r + 1, len(x)):
            x[r] -= L[k, r] * x[k]
        x[r] /= L[r, r]
    return x


@njit(cache=True, error_model="numpy")
def _normal_equations(R, t, margin, samples, evidence, limits, weights):
    """A (7, 7), g (7,) of one step, with the margin's expectation as an observation; sum of squares and count of the faces' readings."""
    A, g = np.zeros((7, 7)), np.zeros(7)
    squares, count = _faces(R, t, samples, evidence, limits, weights.face, A, g)
    _outlines(R, t, margin, samples, evidence, limits, weights.edge, A, g)
    strength = 40.0 / weights.margin_spread**2  # as good as a few dozen edge pixels
    A[6, 6] += strength
    g[6] += strength * (weights.margin - margin)
    for r in range(7):
        A[r, r] += 1e-6 * A[r, r] + 1e-3  # what nothing fixes stays where it is
    return A, g, squares, count


@njit(cache=True, nogil=True, error_model="numpy")
def _refine(refined, samples, evidence, limits, weights, iterations, poses):
    R, t, margins, rms, covariance = refined
    for n in range(poses[0], poses[1]):
        for step in range(iterations):
            share = 1.0 - (1.0 - TAPERING) * step / max(iterations - 1, 1)
            tight = Limits(limits.agree, limits.hide, limits.through * share, limits.edge * share, limits.edge_depth, limits.edge)
            A, g, squares, count = _normal_equations(R[n], t[n], margins[n], samples, evidence, tight, weights)
            if count < 6:
                break
            rms[n] = np.sqrt(squares / count)
            L = _factored(A)
            delta = _solved(L, g)
            turn = np.sqrt(delta[0] ** 2 + delta[1] ** 2 + delta[2] ** 2)
            shift = np.sqrt(delta[3] ** 2 + delta[4] ** 2 + delta[5] ** 2)
            still = step >= iterations // 2 and turn < STILL_RAD and shift < STILL * weights.face
            if step == iterations - 1 or still:
                for c in range(6):
                    put(_solved(L, np.eye(7)[c]), covariance[n, c])
                break
            if turn > MAX_TURN:
                delta *= MAX_TURN / turn
            R_next = _turned_by(R[n], delta[:3])
            for row in range(3):
                put(R_next[row], R[n, row])
                t[n, row] += delta[3 + row]
            margins[n] = max(margins[n] + delta[6], 0.0)
