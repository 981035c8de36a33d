"""Regions of readings that share a plane: each grows from the flattest spot that is left, and its plane follows it."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.modeling.patches.windows import Field, plane_of_sums
from handey_studio.sensing.drawing import Camera

ON_SIGMAS = 3.5  # a reading so near lies on the plane
BULGE_SIGMAS = 1.0  # cartons bulge, sensors warp: so much more, along the plane's normal
STEEPEST = 0.2  # cosine between ray and normal below which nothing more is granted
ALIKE_RAD = np.deg2rad(25.0)  # a spot's plane and its region's
SEED_SIGMAS = 1.6  # a spot that is rougher starts no region
REFIT_GROWTH = 1.25  # a region's plane is fitted anew when it has grown by so much
REACH_PX = 2  # over single lost readings
LEAST_READINGS = 30
SAME_RAD, SAME_RMS = np.deg2rad(8.0), 1.15  # two regions are one plane if their normals agree and the rms hardly grows
SMALL_SHARE, SMALL_SIGMAS = 0.12, 2.5  # a region with so few of its neighbour's readings, so near to its plane, is its rounded edge


def grown(field: Field, camera: Camera) -> tuple[NDArray, NDArray]:
    """Labels (H, W), -1 for none, and the planes (n, 3) of regions: value at pixel (0, 0), changes along u and v."""
    seeds = np.nonzero(field.flat[..., 3].ravel() < SEED_SIGMAS)[0]
    seeds = seeds[np.argsort(field.flat[..., 3].ravel()[seeds], kind="stable")]
    labels, count = _grow(field.value, field.sigma, field.flat, seeds, np.array(camera))
    labels = _merged(field, labels, count, camera)
    count = int(labels.max()) + 1
    for _ in range(2):
        planes = planes_of(field, labels, count)
        labels = _claimed(field.value, field.sigma, labels, planes)
    return labels, planes_of(field, labels, count)


def planes_of(field: Field, labels: NDArray, count: int) -> NDArray:
    """Least-squares planes (count, 3) of labelled readings; NaN where there are fewer than three."""
    return _solved(_moments(field.value, labels, count))


def normals_of(planes: NDArray, camera: Camera) -> NDArray:
    """Unit normals (n, 3) in the sensor's frame, towards the sensor, of planes (n, 3)."""
    parallel, sx, sy, cx, cy = camera
    constant = planes[:, 0] + planes[:, 1] * cx + planes[:, 2] * cy
    if parallel:
        away = np.stack([planes[:, 1] * sx, planes[:, 2] * sy, -np.ones(len(planes))], axis=1)
    else:
        away = -np.stack([planes[:, 1] * sx, planes[:, 2] * sy, constant], axis=1)
    return away / np.linalg.norm(away, axis=1, keepdims=True)


@njit(cache=True, error_model="numpy")
def _normal(c0, cu, cv, camera):
    x, y = cu * camera[1], cv * camera[2]
    z = -1.0 if camera[0] > 0.5 else -(c0 + cu * camera[3] + cv * camera[4])
    if camera[0] < 0.5:
        x, y = -x, -y
    size = np.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


@njit(cache=True, error_model="numpy")
def _add(s, i, j, q):
    s[0] += 1.0
    s[1] += i
    s[2] += j
    s[3] += i * i
    s[4] += i * j
    s[5] += j * j
    s[6] += q
    s[7] += q * i
    s[8] += q * j
    s[9] += q * q


@njit(cache=True, error_model="numpy")
def _reach(i, j, normal, camera):
    """How many deviations off a plane a reading may be: the ray's angle to the plane makes bulges deeper."""
    if camera[0] > 0.5:
        cosine = abs(normal[2])
    else:
        x, y = (i - camera[3]) / camera[1], (j - camera[4]) / camera[2]
        cosine = abs(normal[0] * x + normal[1] * y + normal[2]) / np.sqrt(x * x + y * y + 1.0)
    return ON_SIGMAS + BULGE_SIGMAS / max(cosine, STEEPEST)


@njit(cache=True, error_model="numpy")
def _grow(value, sigma, flat, seeds, camera):
    height, width = value.shape
    labels = np.full((height, width), -1, dtype=np.int32)
    tried = np.zeros((height, width), dtype=np.int32)
    queue = np.empty(height * width, dtype=np.int64)
    s, count, attempt = np.empty(10), 0, 0
    alike = np.cos(ALIKE_RAD)
    for seed in seeds:
        j, i = seed // width, seed % width
        if labels[j, i] >= 0 or tried[j, i] != 0:
            continue
        attempt += 1
        c0, cu, cv = flat[j, i, 0], flat[j, i, 1], flat[j, i, 2]
        normal = _normal(c0, cu, cv, camera)
        s[:] = 0.0
        queue[0], first, last, refit = seed, 0, 1, 40.0
        tried[j, i] = attempt
        while first < last:
            j, i = queue[first] // width, queue[first] % width
            first += 1
            _add(s, i, j, value[j, i])
            if s[0] >= refit:
                c0, cu, cv, _ = plane_of_sums(s)
                normal = _normal(c0, cu, cv, camera)
                refit = REFIT_GROWTH * s[0]
            for y in range(max(0, j - REACH_PX), min(height, j + REACH_PX + 1)):
                for x in range(max(0, i - REACH_PX), min(width, i + REACH_PX + 1)):
                    if labels[y, x] >= 0 or tried[y, x] == attempt or not np.isfinite(flat[y, x, 3]):
                        continue
                    off = abs(value[y, x] - c0 - cu * x - cv * y) / sigma[y, x]
                    if off > _reach(x, y, normal, camera):
                        continue
                    spot = _normal(flat[y, x, 0], flat[y, x, 1], flat[y, x, 2], camera)
                    if spot[0] * normal[0] + spot[1] * normal[1] + spot[2] * normal[2] > alike:
                        tried[y, x] = attempt
                        queue[last] = y * width + x
                        last += 1
        if last < LEAST_READINGS:
            continue
        for k in range(last):
            labels[queue[k] // width, queue[k] % width] = count
        count += 1
    return labels, count


@njit(cache=True, error_model="numpy")
def _moments(value, labels, count):
    sums = np.zeros((count, 10))
    for j in range(value.shape[0]):
        for i in range(value.shape[1]):
            if labels[j, i] >= 0 and np.isfinite(value[j, i]):
                _add(sums[labels[j, i]], i, j, value[j, i])
    return sums


def _solved(sums: NDArray) -> NDArray:
    return np.array([plane_of_sums(s)[:3] if s[0] >= 3 else (np.nan,) * 3 for s in sums]).reshape(-1, 3)


def _rms(s: NDArray) -> float:
    """Of the value, off the plane through the readings that were summed."""
    c0, cu, cv, _ = plane_of_sums(s)
    return float(np.sqrt(max(0.0, s[9] - c0 * s[6] - cu * s[7] - cv * s[8]) / max(1.0, s[0] - 3.0)))


def _off(s: NDArray, plane: NDArray) -> float:
    """The rms of the value of summed readings off another plane."""
    c0, cu, cv = plane
    linear = s[9] - 2.0 * (c0 * s[6] + cu * s[7] + cv * s[8])
    squares = c0 * c0 * s[0] + cu * cu * s[3] + cv * cv * s[5] + 2.0 * (c0 * cu * s[1] + c0 * cv * s[2] + cu * cv * s[4])
    return float(np.sqrt(max(0.0, linear + squares) / s[0]))


def _likeness(sums: NDArray, planes: NDArray, normals: NDArray, a: int, b: int, sigma: float) -> float:
    """How badly two regions fit one plane: up to 1 if they are one."""
    if normals[a] @ normals[b] > np.cos(SAME_RAD):
        return _rms(sums[a] + sums[b]) / max(_rms(sums[a]), _rms(sums[b])) / SAME_RMS
    large, small = (a, b) if sums[a, 0] >= sums[b, 0] else (b, a)
    if sums[small, 0] > SMALL_SHARE * sums[large, 0]:
        return np.inf
    return 0.5 + 0.5 * _off(sums[small], planes[large]) / (SMALL_SIGMAS * sigma)


def _merged(field: Field, labels: NDArray, count: int, camera: Camera) -> NDArray:
    """Neighbouring regions of one plane made one, the best match first; numbered from 0 on."""
    if not count:
        return labels
    sums = _moments(field.value, labels, count)
    sigma = float(np.nanmedian(field.sigma))
    pairs = {(int(a), int(b)) for a, b in _neighbours(labels, REACH_PX + 1)}
    root, planes = np.arange(count), _solved(sums)
    normals = normals_of(planes, camera)
    likeness = {(a, b): _likeness(sums, planes, normals, a, b, sigma) for a, b in pairs}
    while likeness:
        a, b = min(likeness, key=lambda pair: likeness[pair])
        if likeness[a, b] > 1.0:
            break
        sums[a] += sums[b]
        root[root == b] = a
        planes[a] = plane_of_sums(sums[a])[:3]
        normals[a] = normals_of(planes[a : a + 1], camera)[0]
        touched = {x if y in (a, b) else y for x, y in likeness if (x in (a, b)) != (y in (a, b))}
        likeness = {pair: value for pair, value in likeness.items() if a not in pair and b not in pair}
        likeness |= {(min(a, k), max(a, k)): _likeness(sums, planes, normals, min(a, k), max(a, k), sigma) for k in touched}
    numbers = np.unique(root, return_inverse=True)[1]
    return np.where(labels >= 0, numbers.reshape(-1)[labels], -1).astype(np.int32)


def _neighbours(labels: NDArray, reach: int) -> NDArray:
    """Pairs (n, 2) of labels that occur within `reach` pixels in a row or column, the smaller first."""
    found = []
    for step in range(1, reach + 1):
        for a, b in ((labels[:, step:], labels[:, :-step]), (labels[step:], labels[:-step])):
            beside = (a >= 0) & (b >= 0) & (a != b)
            found.append(np.stack([np.minimum(a, b)[beside], np.maximum(a, b)[beside]], axis=1))
    return np.unique(np.concatenate(found), axis=0) if found else np.empty((0, 2), int)


@njit(cache=True, error_model="numpy")
def _claimed(value, sigma, labels, planes):
    """Readings given to the nearest plane of those that their neighbours are on, if they lie on any."""
    height, width = value.shape
    out = labels.copy()
    for j in range(height):
        for i in range(width):
            if not np.isfinite(value[j, i]):
                continue
            best, chosen = ON_SIGMAS, -1
            for y in range(max(0, j - REACH_PX), min(height, j + REACH_PX + 1)):
                for x in range(max(0, i - REACH_PX), min(width, i + REACH_PX + 1)):
                    k = labels[y, x]
                    if k >= 0 and k != chosen:
                        off = abs(value[j, i] - planes[k, 0] - planes[k, 1] * i - planes[k, 2] * j) / sigma[j, i]
                        if off < best:
                            best, chosen = off, k
            if chosen >= 0:
                out[j, i] = chosen
    return out
