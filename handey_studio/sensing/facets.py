"""Facets: small flat spots all over a depth image, and the planes that many of them share."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.windows import fit_windows, window_corners, window_planes

FACETS = 1500
SIDE_PX, SMALL_SIDE_PX, SMALL_VIEW_PX = 11, 7, 200  # a facet's side; the smaller one in images below the third
FLAT_SIGMAS = 2.5  # a facet whose readings scatter more than the noise holds an edge
CANDIDATES = 300  # facets whose planes are tried
ROUGH_SLOPE = 0.015  # a facet's plane is so far off, by the distance from the facet, before it is refined
ALIKE_RAD = np.deg2rad(12.0)  # normals of facets on one plane
MOST_PLANES = 10
REFINEMENTS = 4
ON_SIGMAS = 3.0  # a reading so near to a plane lies on it
MIN_PLANE_SHARE = 0.01  # of the facets
ROOM_M = 0.5  # what is lower by more is the room's floor, where no parts lie


class Facets(NamedTuple):
    """`middle` (n, 3), `normal` (n, 3), `offset`, `sigma` (n,) [m] of all windows with readings; `flat` (n,) tells which are facets."""

    middle: NDArray
    normal: NDArray
    offset: NDArray
    sigma: NDArray
    flat: NDArray


class FacetPlane(NamedTuple):
    """A plane with the facets on it and how many windows lie below it, and are of the room's floor or not."""

    normal: NDArray
    offset: float
    on: NDArray
    below: int


def facets_of(view: DepthView) -> Facets:
    side = SIDE_PX if min(view.depth.shape) >= SMALL_VIEW_PX else SMALL_SIDE_PX
    tops, lefts = window_corners(view.depth.shape, side, FACETS, side // 2)
    found = fit_windows(np.array(view.depth), tops, lefts, side, isinstance(view.projection, Pinhole), 0.5)
    top, left = (corner.ravel() for corner in np.meshgrid(tops, lefts, indexing="ij"))
    middles = np.stack([left, top], axis=1) + 0.5 * (side - 1)
    known = found[:, 1] >= 0.0
    found, middles = found[known], middles[known]
    normals, offsets = window_planes(found, middles, view.projection)
    sigma = sigma_at(view, found[:, 0])
    return Facets(view.projection.unproject(middles, found[:, 0]), normals, offsets, sigma, found[:, 1] <= FLAT_SIGMAS * sigma)


def sigma_at(view: DepthView, depth: NDArray) -> NDArray:
    """The noise [m] at depths: a triangulating sensor's grows with their square; nearer than the middle it is taken as there."""
    if not isinstance(view.projection, Pinhole):
        return np.full(depth.shape, view.noise)
    middle = float(np.median(depth)) if len(depth) else 1.0
    return view.noise * np.maximum(1.0, (depth / middle) ** 2)


def planes_of(facets: Facets, rng: np.random.Generator) -> list[FacetPlane]:
    """The planes with most facets, each facet on one of them."""
    free = facets.flat.copy()
    least = max(4, MIN_PLANE_SHARE * len(facets.flat))
    planes: list[FacetPlane] = []
    while len(planes) < MOST_PLANES and free.sum() >= least:
        flat = np.nonzero(free)[0]
        tried = flat if len(flat) <= CANDIDATES else np.sort(rng.choice(flat, CANDIDATES, replace=False))
        votes = _votes_for(facets, flat, tried)
        best = tried[int(np.argmax(votes))]
        plane = _refined(facets, free, facets.normal[best], float(facets.offset[best]), facets.middle[best])
        free[best] = False
        free &= ~plane.on
        if plane.on.sum() >= least:
            planes.append(plane)
        elif votes.max() < least:
            break
    return planes


def _votes_for(facets: Facets, flat: NDArray, tried: NDArray) -> NDArray:
    """How many of the facets `flat` lie on the plane of each facet `tried`."""
    middle, normal, reach = facets.middle[flat], facets.normal[flat], ON_SIGMAS * facets.sigma[flat]
    return _count_on(middle, normal, reach, facets.middle[tried], facets.normal[tried], float(np.cos(ALIKE_RAD)), ROUGH_SLOPE)


@njit(cache=True)
def _count_on(middle: NDArray, normal: NDArray, reach: NDArray, at: NDArray, along: NDArray, alike: float, slope: float) -> NDArray:
    votes = np.zeros(len(at), dtype=np.int64)
    for k in range(len(at)):
        for n in range(len(middle)):
            if normal[n, 0] * along[k, 0] + normal[n, 1] * along[k, 1] + normal[n, 2] * along[k, 2] < alike:
                continue
            x, y, z = middle[n, 0] - at[k, 0], middle[n, 1] - at[k, 1], middle[n, 2] - at[k, 2]
            off = abs(x * along[k, 0] + y * along[k, 1] + z * along[k, 2])
            if off < reach[n] + slope * np.sqrt(x * x + y * y + z * z):
                votes[k] += 1
    return votes


def _refined(facets: Facets, free: NDArray, normal: NDArray, offset: float, middle: NDArray) -> FacetPlane:
    """The plane through the free facets around it, nearer ones at every round."""
    on = np.zeros(len(free), dtype=bool)
    alike = free & (facets.normal @ normal > np.cos(ALIKE_RAD))
    slope = ROUGH_SLOPE
    for _ in range(REFINEMENTS):
        reach = ON_SIGMAS * facets.sigma + slope * np.linalg.norm(facets.middle - middle, axis=1)
        on = alike & (np.abs(facets.middle @ normal - offset) < reach)
        if on.sum() < 3:
            break
        normal, offset = least_squares_plane(facets.middle[on], facets.sigma[on], normal)
        middle, slope = facets.middle[on].mean(axis=0), 0.3 * slope
    lower = offset - facets.middle @ normal
    below = (lower > 2.0 * ON_SIGMAS * facets.sigma) & (lower < ROOM_M)
    return FacetPlane(normal, offset, on, int(below.sum()))


def least_squares_plane(points: NDArray, sigma: NDArray, towards: NDArray) -> tuple[NDArray, float]:
    """Unit normal, on the side of `towards`, and offset of the plane through points (n, 3) with standard deviations (n,)."""
    weights = 1.0 / sigma**2
    centre = weights @ points / weights.sum()
    spread = points - centre
    normal = np.linalg.eigh((spread * weights[:, None]).T @ spread)[1][:, 0]
    normal = normal if normal @ towards > 0 else -normal
    return normal, float(normal @ centre)
