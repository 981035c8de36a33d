"""Which pinhole saw an organised cloud: its pixels and its points tell, in whatever frame the points are."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.sensing.depth_view import Pinhole

MIN_READINGS = 100
PINHOLE_RMS_PX = 1.0  # an organised cloud whose points miss the best pinhole's pixels by more is no single image
SAMPLES = 40_000
MAX_SKEW = 0.01  # of the focal length; real pixels are no parallelograms


class Fit(NamedTuple):
    """A pinhole, where it stood in the cloud's frame (4, 4), and by how many pixels rms the points miss their pixels."""

    pinhole: Pinhole
    T_cloud_sensor: NDArray
    rms_px: float


def fit_pinhole(points: NDArray, viewpoint: NDArray | None = None) -> Fit | None:
    """The pinhole of an organised cloud (H, W, 3), NaN where no reading; None with fewer than 100 readings or where none exists.

    The best of: the cloud's frame is the sensor's; the sensor stood at `viewpoint` (4, 4); any frame, by the direct linear transform.
    One within `PINHOLE_RMS_PX` is taken as soon as it is found.
    """
    step = max(1, int(np.sqrt(points.shape[0] * points.shape[1] / SAMPLES)))
    some = np.asarray(points[::step, ::step], dtype=float)
    known = np.isfinite(some).all(axis=-1)
    if known.sum() < MIN_READINGS and step > 1:
        return fit_pinhole_to(*_pixels(np.asarray(points, dtype=float), 1), viewpoint)
    return fit_pinhole_to(*_pixels(some, step), viewpoint)


def _pixels(points: NDArray, step: int) -> tuple[NDArray, NDArray]:
    v, u = np.nonzero(np.isfinite(points).all(axis=-1))
    return np.stack([u, v], axis=1) * float(step), points[v, u]


def fit_pinhole_to(pixels: NDArray, points: NDArray, viewpoint: NDArray | None) -> Fit | None:
    """As `fit_pinhole`, from pixels (n, 2) and their points (n, 3)."""
    if len(points) < MIN_READINGS:
        return None
    best: Fit | None = None
    frames = [np.eye(4)] + ([viewpoint] if viewpoint is not None and not np.allclose(viewpoint, np.eye(4)) else [])
    for T_cloud_sensor in frames:
        found = _along_axes(pixels, apply(inverse(T_cloud_sensor), points), T_cloud_sensor)
        if found is not None and (best is None or found.rms_px < best.rms_px):
            best = found
        if best is not None and best.rms_px <= PINHOLE_RMS_PX:
            return best
    free = _anywhere(pixels, points)
    return free if free is not None and (best is None or free.rms_px < best.rms_px) else best


def _along_axes(pixels: NDArray, points: NDArray, T_cloud_sensor: NDArray) -> Fit | None:
    """By least squares, for a sensor at the origin that looks along z."""
    ahead = points[:, 2] > 0
    if ahead.sum() < MIN_READINGS or ahead.mean() < 0.5:
        return None
    x, y, z = points[ahead].T
    numbers, worst = [], 0.0
    for ratio, pixel in ((x / z, pixels[ahead, 0]), (y / z, pixels[ahead, 1])):
        (f, c), *_ = np.linalg.lstsq(np.c_[ratio, np.ones(len(ratio))], pixel, rcond=None)
        worst = max(worst, float(np.sqrt(np.mean((f * ratio + c - pixel) ** 2))))
        numbers += [float(f), float(c)]
    fx, cx, fy, cy = numbers
    return Fit(Pinhole(fx, fy, cx, cy), T_cloud_sensor, worst) if min(fx, fy) > 0 else None


def _anywhere(pixels: NDArray, points: NDArray) -> Fit | None:
    """By the direct linear transform: the 3 × 4 matrix that takes points to pixels, split into a pinhole and its place."""
    pick = np.linspace(0, len(points) - 1, min(len(points), 6000)).astype(int)
    centre, size = points[pick].mean(axis=0), float(points[pick].std()) + 1e-12
    middle, spread = pixels.mean(axis=0), float(pixels.std()) + 1e-12
    X = np.c_[(points[pick] - centre) / size, np.ones(len(pick))]
    u, v = ((pixels[pick] - middle) / spread).T
    zero = np.zeros_like(X)
    rows = np.concatenate([np.c_[X, zero, -u[:, None] * X], np.c_[zero, X, -v[:, None] * X]])
    values, vectors = np.linalg.eigh(rows.T @ rows)
    if values[1] < 1e-9 * values[-1]:
        return None  # the points lie in one plane: many pinholes see them so
    P = np.array([[spread, 0, middle[0]], [0, spread, middle[1]], [0, 0, 1]]) @ vectors[:, 0].reshape(3, 4)
    P = P @ np.block([[np.eye(3) / size, -centre[:, None] / size], [np.zeros((1, 3)), np.ones((1, 1))]])
    return _split(P * np.sign(np.median(points[pick] @ P[2, :3] + P[2, 3])), pixels, points)


def _split(P: NDArray, pixels: NDArray, points: NDArray) -> Fit | None:
    """The pinhole and its pose of a 3 × 4 camera matrix, None if no camera with upright square-cornered pixels has it."""
    if not np.isfinite(P).all() or abs(np.linalg.det(P[:, :3])) < 1e-300 or np.linalg.det(P[:, :3]) < 0:
        return None
    K, R = linalg.rq(P[:, :3])
    signs = np.diag(np.sign(np.diag(K)))
    K, R = K @ signs, signs @ R
    K = K / K[2, 2]
    if abs(K[0, 1]) > MAX_SKEW * K[0, 0] or np.linalg.det(R) < 0:
        return None
    pinhole = Pinhole(float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))
    place = -np.linalg.solve(P[:, :3], P[:, 3])
    T_cloud_sensor = transform(R.T, place)
    off = pinhole.project(apply(inverse(T_cloud_sensor), points)) - pixels
    rms = float(np.sqrt(np.mean(off**2, axis=0)).max())
    return Fit(pinhole, T_cloud_sensor, rms) if np.isfinite(rms) else None
