"""A crease is the line in which the planes beside it meet, which is known far better than the thinned pixels."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.localization.flanks import Run, Seen, flank, space_normal
from handey_studio.localization.lines import Line, across_run, deeper, line_of, no_line, off_line, sigmas_of
from handey_studio.localization.runs import MIN_PIXELS, own_level, pixel_variances, rough_plane, straight_run

LEAST_TURN = np.deg2rad(10.0)  # between the planes beside a crease
PLAIN_TURN, SURE_TURN = np.deg2rad(25.0), 2.0  # a turn that is less plain than this must stand out by these sigmas
MAX_MEET = 4.0  # px that an intersection may lie off its pixels
THINNED = 0.3  # of the window's radius: how far thinned pixels may lie beside their crease


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
        return no_line()
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
            return no_line()
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
    ends, normals, inward, metres = line_of(run, planes[0], planes, sides, 2, seen.camera)
    direction = (ends[1] - ends[0]) / (2.0 * run.half * metres)
    moves, offsets, tilts = np.zeros((2, 3)), np.zeros(2), np.zeros(2)
    for k in range(2):  # an error of one plane moves the line along the other
        put(across_run(run, planes[1 - k], direction, seen.camera), moves[k])
        offsets[k] = covariances[k, 0, 0] / (steep * steep)
        tilts[k] = covariances[k, 1, 1] / (steep * steep)
    offset, angle = sigmas_of(moves, offsets, tilts, metres)
    across = (v[keep] - run.v) * run.du - (u[keep] - run.u) * run.dv
    rms = np.sqrt(np.mean(across * across))
    return Line(int(keep.sum()), ends, normals, inward, 2, off_line(seen, run, rms, planes[0], u, v, keep, metres), offset, angle)


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
    ends, normals, inward, metres = line_of(run, level, planes, sides, flanks, seen.camera)
    direction = (ends[1] - ends[0]) / (2.0 * run.half * metres)
    at_middle, tilt = pixel_variances(run, rms, int(keep.sum()), THINNED * seen.radius, 0.0)
    moves = np.zeros((2, 3))
    put(across_run(run, level, direction, seen.camera), moves[0])
    put(deeper(run, level, direction, seen.camera), moves[1])
    offset, angle = sigmas_of(moves, np.array([at_middle, covariance[0, 0]]), np.array([tilt, covariance[1, 1]]), metres)
    off = off_line(seen, run, rms, level, u, v, keep, metres)
    return Line(int(keep.sum()), ends, normals, inward, flanks, off, offset, angle)
