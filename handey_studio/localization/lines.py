"""A run of edge pixels as a line in space: where two planes meet, or where one ends.

A crease is the intersection of the planes beside it, which is known far better than the thinned pixels. A silhouette lies
between the last reading on the nearer surface and the first one beyond, and on the nearer surface's plane.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.localization.flanks import Run, Seen, flank, space_normal, space_point, w_of, w_sigma
from handey_studio.localization.runs import (
    MIN_PIXELS,
    MIN_PLACES,
    STEP_SIGMA,
    outline,
    own_level,
    pixel_variances,
    rough_plane,
    straight_run,
)
from handey_studio.localization.surface import reading_sigma
from handey_studio.sensing.drawing import Camera

LEAST_TURN = np.deg2rad(10.0)  # between the planes beside a crease
PLAIN_TURN, SURE_TURN = np.deg2rad(25.0), 2.0  # a turn that is less plain than this must stand out by these sigmas
MAX_MEET = 4.0  # px that an intersection may lie off its pixels
WILD = 4.0  # sigmas that pixels may lie off a silhouette, rms, besides two pixels and the outline error: else they are no line
THINNED = 0.3  # of the window's radius: how far thinned pixels may lie beside their crease


class Line(NamedTuple):
    """`pixels` (0: too little stays on the line), `ends` (2, 3) [m], `normals` and `inward` (2, 3) of `flanks` surfaces, `rms`
    [m], `offset_sigma` [m], `angle_sigma` [rad]."""

    pixels: int
    ends: NDArray
    normals: NDArray
    inward: NDArray
    flanks: int
    rms: float
    offset_sigma: float
    angle_sigma: float


@njit(cache=True)
def _across(run: Run, plane: NDArray, direction: NDArray, camera: Camera) -> NDArray:
    """How a place of the run moves in space (3,) [m/px] with c on a plane, across the line."""
    move = space_point(run, 0.0, 0.5, plane[0] + 0.5 * plane[2], camera) - space_point(run, 0.0, -0.5, plane[0] - 0.5 * plane[2], camera)
    return move - np.sum(move * direction) * direction


@njit(cache=True)
def _line(
    run: Run, level: NDArray, planes: NDArray, sides: NDArray, flanks: int, camera: Camera
) -> tuple[NDArray, NDArray, NDArray, float]:
    """Ends (2, 3), normals and inward directions (2, 3) of a line at c = 0 and w = level, and how many metres a pixel of it is."""
    ends = np.empty((2, 3))
    put(space_point(run, -run.half, 0.0, level[0] - run.half * level[1], camera), ends[0])
    put(space_point(run, run.half, 0.0, level[0] + run.half * level[1], camera), ends[1])
    length = np.sqrt(np.sum((ends[1] - ends[0]) ** 2))
    direction = (ends[1] - ends[0]) / length
    normals, inward = np.zeros((2, 3)), np.zeros((2, 3))
    for k in range(flanks):
        normal = space_normal(run, planes[k], camera)
        normal -= np.sum(normal * direction) * direction  # the surface holds the edge
        put(normal / np.sqrt(np.sum(normal * normal)), normals[k])
        across = sides[k] * _across(run, planes[k], direction, camera)
        across -= np.sum(across * normals[k]) * normals[k]
        put(across / np.sqrt(np.sum(across * across)), inward[k])
    return ends, normals, inward, length / (2.0 * run.half)


@njit(cache=True)
def _sigmas(moves: NDArray, offsets: NDArray, tilts: NDArray, metres: float) -> tuple[float, float]:
    """Standard deviations of the line's distance [m] and angle [rad] from independent errors, each of which moves it by `moves` (n, 3)
    [m] with the variances `offsets` at its middle and `tilts` per pixel along it."""
    offset = angle = 0.0
    for k in range(len(moves)):
        squared = np.sum(moves[k] * moves[k])
        offset += squared * offsets[k]
        angle += squared * tilts[k]
    return np.sqrt(offset), np.sqrt(angle) / metres


@njit(cache=True)
def _empty() -> Line:
    return Line(0, np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 3)), 0, 0.0, 0.0, 0.0)


@njit(cache=True)
def _off(seen: Seen, run: Run, rms: float, level: NDArray, u: NDArray, v: NDArray, keep: NDArray, metres: float) -> float:
    """How far [m] kept pixels lie off the line, across the view and in depth, rms."""
    squares, n = 0.0, 0
    d = w_of(level[0], seen.camera)
    for i in range(len(u)):
        if keep[i]:
            s = (u[i] - run.u) * run.du + (v[i] - run.v) * run.dv
            off = w_of(level[0] + s * level[1], seen.camera) - seen.depth[int(v[i]), int(u[i])]
            if abs(off) < 0.05 * d:
                squares += off * off
                n += 1
    return np.sqrt(squares / max(n, 1) + (rms * metres) ** 2)


@njit(cache=True)
def silhouette(seen: Seen, outward: NDArray, u: NDArray, v: NDArray) -> Line:
    """The line of a jump's pixels, on the plane of the nearer surface."""
    x, y, tells, systematic = outline(seen, outward, u, v)
    run, keep, rms = straight_run(x, y, tells, MIN_PLACES)
    if run.half < 1.0:
        return _empty()
    inwards = 0.0
    for i in range(len(u)):
        inwards += run.dv * outward[int(v[i]), int(u[i]), 0] - run.du * outward[int(v[i]), int(u[i]), 1]
    side = 1.0 if inwards > 0 else -1.0
    level, covariance = own_level(seen, run, u, v, keep)
    n, plane, fitted = flank(seen, run, side, 0.0, 0.0)
    sigma = w_sigma(w_of(level[0], seen.camera), seen.camera, seen.noise)
    if n > 0 and abs(plane[0] - level[0] + plane[2] * 0.5 * side) < 4.0 * sigma + 2.0 * np.sqrt(covariance[0, 0]):
        level, covariance = plane, fitted
    else:
        n, plane = rough_plane(seen, run, u, v, keep, level, side)
    planes, sides = np.zeros((2, 3)), np.array([side, -side])
    put(plane, planes[0])
    flanks = 1 if n > 0 else 0
    ends, normals, inward, metres = _line(run, level, planes, sides, flanks, seen.camera)
    direction = (ends[1] - ends[0]) / (2.0 * run.half * metres)
    pixels = int(keep.sum())
    sigma_depth = reading_sigma(w_of(level[0], seen.camera), seen.camera, seen.noise)
    at_middle, tilt = pixel_variances(run, rms, pixels, systematic, STEP_SIGMA)
    moves = np.zeros((2, 3))
    put(_across(run, plane, direction, seen.camera), moves[0])
    put(_deeper(run, level, direction, seen.camera), moves[1])
    offset, angle = _sigmas(moves, np.array([at_middle, covariance[0, 0]]), np.array([tilt, covariance[1, 1]]), metres)
    off = _off(seen, run, rms, level, u, v, keep, metres)
    if off > WILD * sigma_depth + 2.0 * metres + seen.outline:
        return _empty()
    return Line(pixels, ends, normals, inward, flanks, off, offset, angle)


@njit(cache=True)
def _deeper(run: Run, level: NDArray, direction: NDArray, camera: Camera) -> NDArray:
    """How the middle of the run moves in space (3,) with w, across the line [m per w]."""
    small = 1e-3 * level[0]
    move = (space_point(run, 0.0, 0.0, level[0] + small, camera) - space_point(run, 0.0, 0.0, level[0], camera)) / small
    return move - np.sum(move * direction) * direction


@njit(cache=True)
def _met(run: Run, p: NDArray, q: NDArray) -> tuple[Run, bool]:
    """The run moved to where two planes beside it meet, and whether they do along it."""
    steep = p[2] - q[2]
    if abs(steep) < 1e-12:
        return run, False
    c, slope = -(p[0] - q[0]) / steep, -(p[1] - q[1]) / steep
    size = np.sqrt(1.0 + slope * slope)
    du, dv = (run.du - slope * run.dv) / size, (run.dv + slope * run.du) / size
    return Run(run.u - c * run.dv, run.v + c * run.du, du, dv, run.half), abs(c) + abs(slope) * run.half < MAX_MEET


@njit(cache=True)
def crease(seen: Seen, u: NDArray, v: NDArray) -> Line:
    """The line in which the planes beside a crease's pixels meet; through the pixels where there are no such planes; none where the planes
    are one."""
    everything = np.ones(len(u), dtype=np.bool_)
    run, keep, rms = straight_run(u, v, everything, MIN_PIXELS)
    if run.half < 1.0:
        return _empty()
    beside = max(seen.radius - 1.0, 2.0)
    planes, sides = np.zeros((2, 3)), np.array([1.0, -1.0])
    covariances = np.zeros((2, 3, 3))
    counts = np.zeros(2, dtype=np.int64)
    at = run
    for again in range(2):
        for k in range(2):
            counts[k], plane, covariance = flank(seen, at, sides[k], 2.0 - again, beside)
            put(plane, planes[k])
            for row in range(3):
                put(covariance[row], covariances[k, row])
        if counts[0] == 0 or counts[1] == 0:
            break
        if not _turns(space_normal(at, planes[0], seen.camera), space_normal(at, planes[1], seen.camera), planes, covariances):
            return _empty()
        moved, met = _met(at, planes[0], planes[1])
        if not met:
            break
        if again == 1:
            return _meeting(seen, at, planes, covariances, u, v, keep)
        at = moved
    return _ridge(seen, run, rms, u, v, keep, beside)


@njit(cache=True)
def _turns(a: NDArray, b: NDArray, planes: NDArray, covariances: NDArray) -> bool:
    """Whether the surface truly turns: noise alone makes slight creases in the windows' slopes, which wide planes do not bear out."""
    cosine = np.sum(a * b)
    sigma = np.sqrt(covariances[0, 2, 2] + covariances[1, 2, 2])
    sure = abs(planes[0, 2] - planes[1, 2]) > SURE_TURN * sigma
    return cosine < np.cos(LEAST_TURN) and (sure or cosine < np.cos(PLAIN_TURN))


@njit(cache=True)
def _turned(plane: NDArray, covariance: NDArray, c: float, slope: float) -> tuple[NDArray, NDArray]:
    """A plane and its covariance in the frame of a run moved by c and turned by a small slope."""
    size = np.sqrt(1.0 + slope * slope)
    J = np.array([[1.0, 0.0, c], [0.0, 1.0 / size, slope / size], [0.0, -slope / size, 1.0 / size]])
    return J @ plane, J @ covariance @ J.T


@njit(cache=True)
def _meeting(seen: Seen, at: Run, planes: NDArray, covariances: NDArray, u: NDArray, v: NDArray, keep: NDArray) -> Line:
    """The line in which two planes meet."""
    steep = planes[0, 2] - planes[1, 2]
    c, slope = -(planes[0, 0] - planes[1, 0]) / steep, -(planes[0, 1] - planes[1, 1]) / steep
    run, _ = _met(at, planes[0], planes[1])
    for k in range(2):
        plane, covariance = _turned(planes[k], covariances[k], c, slope)
        put(plane, planes[k])
        for row in range(3):
            put(covariance[row], covariances[k, row])
    steep = planes[0, 2] - planes[1, 2]
    sides = np.array([1.0, -1.0])
    ends, normals, inward, metres = _line(run, planes[0], planes, sides, 2, seen.camera)
    direction = (ends[1] - ends[0]) / (2.0 * run.half * metres)
    moves, offsets, tilts = np.zeros((2, 3)), np.zeros(2), np.zeros(2)
    for k in range(2):  # an error of one plane moves the line along the other
        put(_across(run, planes[1 - k], direction, seen.camera), moves[k])
        offsets[k] = covariances[k, 0, 0] / (steep * steep)
        tilts[k] = covariances[k, 1, 1] / (steep * steep)
    offset, angle = _sigmas(moves, offsets, tilts, metres)
    across = (v[keep] - run.v) * run.du - (u[keep] - run.u) * run.dv
    rms = np.sqrt(np.mean(across * across))
    return Line(int(keep.sum()), ends, normals, inward, 2, _off(seen, run, rms, planes[0], u, v, keep, metres), offset, angle)


@njit(cache=True)
def _ridge(seen: Seen, run: Run, rms: float, u: NDArray, v: NDArray, keep: NDArray, beside: float) -> Line:
    """The line through a crease's own pixels."""
    level, covariance = own_level(seen, run, u, v, keep)
    planes, sides, flanks = np.zeros((2, 3)), np.zeros(2), 0
    for side in (1.0, -1.0):
        n, plane = rough_plane(seen, run, u, v, keep, level, side * (beside + 2.0))
        if n > 0:
            put(plane, planes[flanks])
            sides[flanks] = side
            flanks += 1
    ends, normals, inward, metres = _line(run, level, planes, sides, flanks, seen.camera)
    direction = (ends[1] - ends[0]) / (2.0 * run.half * metres)
    at_middle, tilt = pixel_variances(run, rms, int(keep.sum()), THINNED * seen.radius, 0.0)
    moves = np.zeros((2, 3))
    put(_across(run, level, direction, seen.camera), moves[0])
    put(_deeper(run, level, direction, seen.camera), moves[1])
    offset, angle = _sigmas(moves, np.array([at_middle, covariance[0, 0]]), np.array([tilt, covariance[1, 1]]), metres)
    off = _off(seen, run, rms, level, u, v, keep, metres)
    return Line(int(keep.sum()), ends, normals, inward, flanks, off, offset, angle)
