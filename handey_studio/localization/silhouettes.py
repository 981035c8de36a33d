"""A silhouette lies between the last reading on the nearer surface and the first one beyond, and on the nearer surface's plane."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.localization.flanks import Seen, flank, w_of, w_sigma
from handey_studio.localization.lines import Line, across_run, deeper, line_of, no_line, off_line, sigmas_of
from handey_studio.localization.runs import MIN_PLACES, STEP_SIGMA, outline, own_level, pixel_variances, rough_plane, straight_run
from handey_studio.localization.surface import reading_sigma

WILD = 4.0  # sigmas that pixels may lie off a silhouette, rms, besides two pixels and the outline error: else they are no line


@njit(cache=True)
def silhouette(seen: Seen, outward: NDArray, u: NDArray, v: NDArray) -> Line:
    """The line of a jump's pixels, on the plane of the nearer surface."""
    x, y, tells, systematic = outline(seen, outward, u, v)
    run, keep, rms = straight_run(x, y, tells, MIN_PLACES)
    if run.half < 1.0:
        return no_line()
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
    ends, normals, inward, metres = line_of(run, level, planes, sides, flanks, seen.camera)
    direction = (ends[1] - ends[0]) / (2.0 * run.half * metres)
    pixels = int(keep.sum())
    sigma_depth = reading_sigma(w_of(level[0], seen.camera), seen.camera, seen.noise)
    at_middle, tilt = pixel_variances(run, rms, pixels, systematic, STEP_SIGMA)
    moves = np.zeros((2, 3))
    put(across_run(run, plane, direction, seen.camera), moves[0])
    put(deeper(run, level, direction, seen.camera), moves[1])
    offset, angle = sigmas_of(moves, np.array([at_middle, covariance[0, 0]]), np.array([tilt, covariance[1, 1]]), metres)
    off = off_line(seen, run, rms, level, u, v, keep, metres)
    if off > WILD * sigma_depth + 2.0 * metres + seen.outline:
        return no_line()
    return Line(pixels, ends, normals, inward, flanks, off, offset, angle)
