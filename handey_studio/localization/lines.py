"""A run of edge pixels as a line in space: its ends, the surfaces beside it, and how well it is known."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.localization.flanks import Run, Seen, space_normal, space_point, w_of
from handey_studio.sensing.drawing import Camera


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
def across_run(run: Run, plane: NDArray, direction: NDArray, camera: Camera) -> NDArray:
    """How a place of the run moves in space (3,) [m/px] with c on a plane, across the line."""
    move = space_point(run, 0.0, 0.5, plane[0] + 0.5 * plane[2], camera) - space_point(run, 0.0, -0.5, plane[0] - 0.5 * plane[2], camera)
    return move - np.sum(move * direction) * direction


@njit(cache=True)
def deeper(run: Run, level: NDArray, direction: NDArray, camera: Camera) -> NDArray:
    """How the middle of the run moves in space (3,) with w, across the line [m per w]."""
    small = 1e-3 * level[0]
    move = (space_point(run, 0.0, 0.0, level[0] + small, camera) - space_point(run, 0.0, 0.0, level[0], camera)) / small
    return move - np.sum(move * direction) * direction


@njit(cache=True)
def line_of(
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
        across = sides[k] * across_run(run, planes[k], direction, camera)
        across -= np.sum(across * normals[k]) * normals[k]
        put(across / np.sqrt(np.sum(across * across)), inward[k])
    return ends, normals, inward, length / (2.0 * run.half)


@njit(cache=True)
def sigmas_of(moves: NDArray, offsets: NDArray, tilts: NDArray, metres: float) -> tuple[float, float]:
    """Standard deviations of the line's distance [m] and angle [rad] from independent errors, each of which moves it by `moves` (n, 3)
    [m] with the variances `offsets` at its middle and `tilts` per pixel along it."""
    offset = angle = 0.0
    for k in range(len(moves)):
        squared = np.sum(moves[k] * moves[k])
        offset += squared * offsets[k]
        angle += squared * tilts[k]
    return np.sqrt(offset), np.sqrt(angle) / metres


@njit(cache=True)
def no_line() -> Line:
    return Line(0, np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 3)), 0, 0.0, 0.0, 0.0)


@njit(cache=True)
def off_line(seen: Seen, run: Run, rms: float, level: NDArray, u: NDArray, v: NDArray, keep: NDArray, metres: float) -> float:
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
