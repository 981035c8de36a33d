"""The planes that a mesh's triangles nearly lie in: which triangle belongs to which.

Regions grow from the flattest spots over neighbours that stay within a tolerance of the region's plane, which follows them. Regions that
fit one plane are merged, small ones given to their neighbours.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

SMOOTHINGS = 6  # how often a triangle's normal is averaged with its neighbours': scans are rough in the small
ALIKE = np.cos(np.deg2rad(40.0))  # a triangle's smoothed normal and its region's
REFIT_GROWTH = 1.3
SMALL = 5.0  # a region narrower than so many tolerances is an edge's roundness
PASSES = 6
STRIP = 1e-6  # members so much narrower than long are still a strip and have no plane
POWERS = 12
MOST_REGIONS = 2000  # more are no polyhedron's


def plane_clusters(corners: NDArray, triangles: NDArray, tolerance: float) -> NDArray:
    """The region (t,) of each triangle (t, 3) of a closed mesh over corners (n, 3) [m]; `tolerance` [m] from a region's plane."""
    beside = neighbours(triangles)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    vectors = np.cross(b - a, c - a)
    normals = _smoothed(vectors, beside)
    size = np.linalg.norm(normals, axis=1)
    order = np.argsort(-size / np.maximum(_smoothed(np.linalg.norm(vectors, axis=1)[:, None], beside)[:, 0], 1e-30), kind="stable")
    normals /= np.maximum(size, 1e-30)[:, None]
    regions = np.full(len(triangles), -1)
    _grow(np.ascontiguousarray(corners), triangles, beside, normals, order, tolerance, regions)
    areas = np.linalg.norm(vectors, axis=1) / 2.0
    regions = _without_small(corners, triangles, beside, areas, regions, tolerance)
    regions = _merged(corners, triangles, beside, regions, tolerance)
    regions = _without_small(corners, triangles, beside, areas, regions, tolerance)
    return _merged(corners, triangles, beside, regions, tolerance)


def neighbours(triangles: NDArray) -> NDArray:
    """The triangle (t, 3) on the other side of each side of a closed mesh, side k from corner k to the next."""
    span = int(triangles.max()) + 1
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    keys, other = start * span + end, end * span + start
    order = np.argsort(keys)
    return (order[np.searchsorted(keys, other, sorter=order)] // 3).reshape(-1, 3)


def region_planes(corners: NDArray, triangles: NDArray, regions: NDArray) -> NDArray:
    """Least-squares plane (r, 4), outward unit normal and offset [m], of each region's triangles by area."""
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    vectors = np.cross(b - a, c - a) / 2.0
    areas = np.linalg.norm(vectors, axis=1)
    count = int(regions.max()) + 1
    total = np.maximum(_summed(areas, regions, count), 1e-30)
    middles = _summed(((a + b + c) / 3.0) * areas[:, None], regions, count) / total[:, None]
    spread = np.zeros((count, 3, 3))
    for corner in (a, b, c):
        off = corner - middles[regions]
        spread += _summed((off[:, :, None] * off[:, None, :] * areas[:, None, None]).reshape(-1, 9), regions, count).reshape(-1, 3, 3)
    normals = np.linalg.eigh(spread)[1][:, :, 0]
    outward = _summed(vectors, regions, count)
    normals = np.where((normals * outward).sum(axis=1, keepdims=True) < 0, -normals, normals)
    return np.c_[normals, (normals * middles).sum(axis=1)]


def _summed(values: NDArray, groups: NDArray, count: int) -> NDArray:
    choose = csr_array((np.ones(len(groups)), (groups, np.arange(len(groups)))), shape=(count, len(groups)))
    return np.asarray(choose @ values)


def _smoothed(values: NDArray, beside: NDArray) -> NDArray:
    for _ in range(SMOOTHINGS):
        values = 0.25 * (values + values[beside].sum(axis=1))
    return values


def _merged(corners: NDArray, triangles: NDArray, beside: NDArray, regions: NDArray, tolerance: float) -> NDArray:
    """Neighbouring regions made one where a single plane fits both, those of the most alike planes first."""
    apart: set[tuple[int, int]] = set()  # pairs that were tried and have not changed since
    while int(regions.max()) < MOST_REGIONS:
        planes = region_planes(corners, triangles, regions)
        pairs = np.unique(np.sort(np.c_[np.repeat(regions, 3), regions[beside].ravel()], axis=1), axis=0)
        alike = (planes[pairs[:, 0], :3] * planes[pairs[:, 1], :3]).sum(axis=1)
        usable = (pairs[:, 0] != pairs[:, 1]) & (alike > ALIKE)
        becomes, taken = np.arange(len(planes)), set()
        for a, b in pairs[usable][np.argsort(-alike[usable], kind="stable")].tolist():
            if {a, b} & taken or (a, b) in apart:
                continue
            if _one_plane(corners, triangles[(regions == a) | (regions == b)], tolerance):
                becomes[b] = a
                taken |= {a, b}
            else:
                apart.add((a, b))
        if not taken:
            break
        apart = {pair for pair in apart if not set(pair) & taken}
        regions = becomes[regions]
    return np.unique(regions, return_inverse=True)[1]


def _one_plane(corners: NDArray, triangles: NDArray, tolerance: float) -> bool:
    points = corners[triangles].reshape(-1, 3)
    off = points - points.mean(axis=0)
    return bool(np.abs(off @ np.linalg.eigh(off.T @ off)[1][:, 0]).max() <= tolerance)


def _without_small(corners: NDArray, triangles: NDArray, beside: NDArray, areas: NDArray, regions: NDArray, tolerance: float) -> NDArray:
    """Small regions, and pieces cut off from their own, given to the neighbour whose plane is nearest; ragged borders smoothed."""
    for _ in range(PASSES):
        same = regions[beside] == regions[:, None]
        rows, side = np.nonzero(same)
        links = coo_array((np.ones(len(rows)), (rows, beside[rows, side])), shape=(len(regions),) * 2)
        piece = connected_components(links, directed=False)[1]
        piece_area = np.bincount(piece, weights=areas)
        largest = np.zeros(int(regions.max()) + 1)
        np.maximum.at(largest, regions, piece_area[piece])
        loose = (piece_area[piece] < largest[regions]) | (largest[regions] < (SMALL * tolerance) ** 2)
        if loose.all():
            return regions
        kept = np.unique(regions[~loose], return_inverse=True)[1]
        labels = np.full(len(regions), -1)
        labels[~loose] = kept
        planes = region_planes(corners, triangles[~loose], kept)
        middles = corners[triangles].mean(axis=1)
        _fill(middles, beside, planes, labels)
        for _ in range(2):
            labels = _straighter(middles, beside, planes, labels)
        if np.array_equal(labels, regions):
            break
        regions = labels
    return regions


def _straighter(middles: NDArray, beside: NDArray, planes: NDArray, labels: NDArray) -> NDArray:
    """Triangles at a border given to the side on which two of their neighbours are, or whose plane their middle is nearer to."""
    choices = np.c_[labels, labels[beside]]
    off = np.abs((planes[choices, :3] * middles[:, None]).sum(axis=2) - planes[choices, 3])
    votes = (choices[:, :, None] == choices[:, None, 1:]).sum(axis=2)
    return choices[np.arange(len(labels)), np.lexsort((off, -(votes >= 2).astype(int)), axis=1)[:, 0]]


@njit(cache=True)
def _fill(middles, beside, planes, labels):
    """Triangles without a label, each given its neighbours' nearest plane, from the borders inward."""
    left = True
    while left:
        left, given = False, False
        before = labels.copy()
        for t in range(len(labels)):
            if before[t] >= 0:
                continue
            left, best = True, np.inf
            for k in range(3):
                r = before[beside[t, k]]
                if r >= 0:
                    off = abs(middles[t, 0] * planes[r, 0] + middles[t, 1] * planes[r, 1] + middles[t, 2] * planes[r, 2] - planes[r, 3])
                    if off < best:
                        best, labels[t], given = off, r, True
        if not given:
            break


@njit(cache=True)
def _grow(corners, triangles, beside, normals, order, tolerance, regions):
    """Numbers regions from the flattest spots on."""
    count, plane = 0, np.empty(4)
    queue = np.empty(len(triangles), dtype=np.int64)
    for seed in order:
        if regions[seed] >= 0:
            continue
        plane[3], size = 0.0, 0
        for i in range(3):
            plane[i] = normals[seed, i]
            for k in range(3):
                plane[3] += corners[triangles[seed, k], i] * plane[i] / 3.0
        for _ in range(2):  # once to find the plane, once to follow it
            for i in range(size):
                regions[queue[i]] = -1
            size = _flood(corners, triangles, beside, normals, seed, plane, tolerance, regions, count, queue)
        count += 1


@njit(cache=True)
def _flood(corners, triangles, beside, normals, seed, plane, tolerance, regions, number, queue):
    """Spreads a region from its seed; the plane is fitted anew as it grows. How many triangles it has."""
    queue[0], regions[seed] = seed, number
    head, tail, fitted = 0, 1, 4
    while head < tail:
        t = queue[head]
        head += 1
        for k in range(3):
            s = beside[t, k]
            if regions[s] >= 0 or normals[s, 0] * plane[0] + normals[s, 1] * plane[1] + normals[s, 2] * plane[2] < ALIKE:
                continue
            most = 0.0
            for m in range(3):
                c = triangles[s, m]
                most = max(most, abs(corners[c, 0] * plane[0] + corners[c, 1] * plane[1] + corners[c, 2] * plane[2] - plane[3]))
            if most <= tolerance:
                regions[s] = number
                queue[tail] = s
                tail += 1
        if tail >= fitted * REFIT_GROWTH:
            fitted = tail
            _fit(corners, triangles, queue, tail, plane)
    if tail > 3:
        _fit(corners, triangles, queue, tail, plane)
    return tail


@njit(cache=True)
def _fit(corners, triangles, members, count, plane):
    """Sets `plane` to the least-squares plane through the first `count` members' corners, on the side that it had."""
    x, y, z, weight = 0.0, 0.0, 0.0, 1.0 / (3.0 * count)
    for m in range(count):
        for k in range(3):
            c = triangles[members[m], k]
            x, y, z = x + weight * corners[c, 0], y + weight * corners[c, 1], z + weight * corners[c, 2]
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for m in range(count):
        for k in range(3):
            c = triangles[members[m], k]
            u, v, w = corners[c, 0] - x, corners[c, 1] - y, corners[c, 2] - z
            xx, xy, xz, yy, yz, zz = xx + u * u, xy + u * v, xz + u * w, yy + v * v, yz + v * w, zz + w * w
    # the adjugate stretches most along the direction that the matrix stretches least
    a, b, c, d, e, f = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy, xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    if a + d + f < STRIP * (xx + yy + zz) ** 2:
        return
    u, v, w = plane[0], plane[1], plane[2]
    for _ in range(POWERS):
        u, v, w = a * u + b * v + c * w, b * u + d * v + e * w, c * u + e * v + f * w
        size = np.sqrt(u * u + v * v + w * w)
        u, v, w = u / size, v / size, w / size
    plane[0], plane[1], plane[2] = u, v, w
    plane[3] = u * x + v * y + w * z
