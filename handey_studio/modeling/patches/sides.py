"""The sides of a patch's outline: what lies beyond each, and where exactly it runs.

Where two planes meet, their intersection is the side; where the object ends, the contour is, with what the sensor loses there added back.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply, rotate
from handey_studio.modeling.patches.patch import SUPPORT, Border
from handey_studio.sensing.depth_view import DepthView

FAR_PX = 45  # beyond a contour the next reading is looked for so far: shadows are wide
SAME_SURFACE_SIGMAS = 6.0
NEAR_CREASE_PX = 5.0  # a crease that the planes put farther from the contour is not used
PARALLEL_RAD = np.deg2rad(12.0)
MOST_LOST_M = 0.0025  # depth cameras lose 3 to 5 mm; what is measured beyond comes from other things beside the outlines
SCATTER = np.sqrt(3.0)  # deviations between the mean of what is spread evenly and its end
DRIFTS = 5.0  # a rim that drifts by so much [px] is lost by up to so many times as much
DRIFT_PX, MOST_OFF_PX, LEAST_RIM_PX = 2, 3.0, 16  # pixels so far apart drift alike but err each for itself; on a rim so long
CHANCE_PX2 = 0.1  # px²: that much they have in common by whole pixels and chance
MOST_SLANT = 1.3  # surfaces seen flatly lose more of their rims, up to so many times as much
LOST_UNSURE, LEAST_UNSURE_PX = 0.35, 0.1  # what a sensor loses at rims is known to so much of it, and to so much at best
LEAST_OFF_PX, ALIKE_PX = 0.3, 6.0  # a contour's pixels err by so much at least, and so many neighbours alike
NAMES = {"r": "rim", "k": "cut", "i": "image"}


class Seen(NamedTuple):
    """What outlines are made from.

    `view`; `labels` (H, W), each reading's patch, -2 for the support and -1 for none; `planes` (n, 4) of the patches in the view's world,
    unit normal and offset [m]; `sigma` (H, W) [m], one reading's noise. `lost_m` [m], at most: how far the true outline lies outside the
    middles of the outermost readings, see `lost_at_rims`. `drift_px`: how far several pixels of a rim together wander from a straight line.
    """

    view: DepthView
    labels: NDArray
    planes: NDArray
    sigma: NDArray
    lost_m: float
    drift_px: float = 0.0


class Side(NamedTuple):
    """One side: what it is, its line in the image as a point and a unit direction [px], the direction (2,) out of the patch, by how much
    `off` [px] its contour wanders about a straight line, and how far [m] it moves on the plane when its image moves by a pixel."""

    border: Border
    middle: NDArray
    along: NDArray
    outward: NDArray
    off: float
    per_px: float


def lost_at_rims(view: DepthView) -> float:
    """How far [m] the true outline lies outside the middles of the outermost readings: half a pixel, and what depth cameras lose."""
    depth = view.depth[np.isfinite(view.depth)]
    pixel = 1.0 / float(view.projection.pixels_per_metre(float(np.median(depth)) if len(depth) else 1.0))
    return 0.5 * pixel + float(np.clip(view.outline_error - pixel, 0.0, MOST_LOST_M))


def beyond_of(seen: Seen, number: int, contour: NDArray) -> tuple[NDArray, NDArray]:
    """What lies up to `FAR_PX` beyond each contour pixel (n, 2), u and v, of patch `number`: a kind (n,), and a patch (n,) or -1.

    Kinds are letters: "c" a patch that goes on at this depth (a crease), "f" the support at this depth (a foot), "u" readings of no patch
    at this depth, "r" something farther (a rim), "k" something nearer (a cut), "i" no reading at all, or the image's edge.
    """
    height, width = seen.labels.shape
    ahead = np.roll(contour, -3, axis=0) - np.roll(contour, 3, axis=0)
    outward = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    size = np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    outward = outward / size
    probe = np.rint(contour + 2.0 * outward).astype(int)
    inside = (probe >= 0).all(axis=1) & (probe < (width, height)).all(axis=1)
    on = np.zeros(len(contour), dtype=bool)
    on[inside] = seen.labels[probe[inside, 1], probe[inside, 0]] == number
    if on.mean() > 0.5:
        outward = -outward
    kinds, others = np.full(len(contour), "i"), np.full(len(contour), -1)
    steps = np.arange(1, FAR_PX + 1)
    path = np.rint(contour[:, None] + steps[:, None] * outward[:, None]).astype(int)
    valid = (path >= 0).all(axis=2) & (path < (width, height)).all(axis=2)
    u, v = np.where(valid, path[..., 0], 0), np.where(valid, path[..., 1], 0)
    read = valid & np.isfinite(seen.view.depth[v, u]) & (seen.labels[v, u] != number)
    found = read.any(axis=1)
    first = np.argmax(read, axis=1)
    rows = np.nonzero(found)[0]
    uu, vv = u[rows, first[rows]], v[rows, first[rows]]
    expected = _depth_on(seen, number, np.stack([uu, vv], axis=1).astype(float))
    edge = _depth_on(seen, number, contour[rows])
    depth, sigma = seen.view.depth[vv, uu], seen.sigma[vv, uu]
    pixel = 1.0 / seen.view.projection.pixels_per_metre(edge)
    slope = SAME_SURFACE_SIGMAS * sigma + 2.5 * pixel * (first[rows] + 1)
    label = seen.labels[vv, uu]
    near = np.abs(depth - edge) < np.maximum(slope, SAME_SURFACE_SIGMAS * sigma + np.abs(expected - edge))
    kind = np.where(near, np.where(label == SUPPORT, "f", np.where(label >= 0, "c", "u")), np.where(depth > edge, "r", "k"))
    kinds[rows], others[rows] = kind, np.where(label >= 0, label, -1)
    return kinds, others


def side_of(seen: Seen, number: int, contour: NDArray, kinds: NDArray, others: NDArray) -> Side:
    """What one side of a patch's outline is, from its contour pixels (n, 2) and what lies beyond each; rims are not yet moved out."""
    middle, along, off = _line(contour)
    outward = np.array([along[1], -along[0]])
    outward = outward * _outward_sign(seen, number, middle, outward)
    per_px = _metres_across(seen, number, middle, along, outward)
    kind = max("rcfkiu", key=lambda k: (kinds == k).sum())
    if kind in "cf":
        other = int(np.bincount(others[kinds == "c"]).argmax()) if kind == "c" else SUPPORT
        crease = _crease(seen, number, other, middle, along)
        if crease is not None:
            return Side(Border("crease" if kind == "c" else "foot", other), *crease, outward, off, per_px)
    beyond = others[kinds == kind]
    other = int(np.bincount(beyond[beyond >= 0]).argmax()) if kind in "rk" and (beyond >= 0).mean() > 0.5 else -1
    sigma_px = max(off, LEAST_OFF_PX) / np.sqrt(max(len(contour) / ALIKE_PX, 1.0))
    return Side(Border(NAMES.get(kind, "rim"), other, sigma_px * per_px), middle, along, outward, off, per_px)


def moved_out(seen: Seen, sides: Sequence[Side], pixels_per_m: float) -> list[Side]:
    """The sides with the rims where the object ends, as far out as the sensor lost it."""
    out = []
    for side in sides:
        if side.border.kind in ("rim", "image"):
            lost, unsure = _lost_px(seen, side, pixels_per_m)
            sigma = float(np.hypot(side.border.sigma, unsure * side.per_px))
            side = side._replace(middle=side.middle + lost * side.outward, border=replace(side.border, sigma=sigma))
        out.append(side)
    return out


def _lost_px(seen: Seen, side: Side, pixels_per_m: float) -> tuple[float, float]:
    """How far [px] a rim lies outside the mean of its outermost pixels, and how well that is known.

    Readings that are whole pixels, or are lost each by chance, spread evenly from the rim inwards: their deviation tells where they end.
    Sensors that match patches of a pattern lose a margin whose width drifts along the rim: the more it drifts, the wider it is.
    """
    scatter = np.sqrt(max(0.0, side.off**2 - seen.drift_px**2))
    by_chance = max(seen.view.rim_px, SCATTER * scatter - (0.5 - seen.view.rim_px))
    slant = float(np.clip(side.per_px * pixels_per_m, 1.0, MOST_SLANT))
    margin = min(max(0.0, seen.lost_m * pixels_per_m - 0.5), DRIFTS * seen.drift_px) * slant
    return by_chance + margin, float(np.hypot(LEAST_UNSURE_PX, LOST_UNSURE * margin))


def drift_of(rims: Sequence[NDArray]) -> float:
    """How much [px] rims, each the pixels (n, 2) along a straight one in order, drift about straight lines: the root of what errors of
    pixels a little apart have in common, over all rims; 0 where that is chance."""
    total = count = 0.0
    for pixels in rims:
        if len(pixels) < LEAST_RIM_PX:
            continue
        middle, along, _ = _line(pixels)
        off = (pixels - middle) @ np.array([-along[1], along[0]])
        off = off - off.mean()
        one, other = off[DRIFT_PX:], off[:-DRIFT_PX]
        both = (np.abs(one) < MOST_OFF_PX) & (np.abs(other) < MOST_OFF_PX)
        total, count = total + float((one * other)[both].sum()), count + int(both.sum())
    return float(np.sqrt(max(0.0, total / max(count, 1.0) - CHANCE_PX2)))


def _metres_across(seen: Seen, number: int, middle: NDArray, along: NDArray, outward: NDArray) -> float:
    """How far [m] a side moves on the patch's plane when its image moves by a pixel."""
    start, ahead, aside = lifted(seen, number, np.stack([middle, middle + along, middle + outward]))
    direction = (ahead - start) / max(float(np.linalg.norm(ahead - start)), 1e-12)
    across = aside - start - ((aside - start) @ direction) * direction
    return float(np.linalg.norm(across))


def _outward_sign(seen: Seen, number: int, middle: NDArray, outward: NDArray) -> float:
    """1 if `outward` leaves the patch there, else -1."""
    counts = []
    for sign in (1.0, -1.0):
        path = np.rint(middle + sign * np.arange(2, 7)[:, None] * outward).astype(int)
        path = path[(path >= 0).all(axis=1) & (path < seen.labels.shape[::-1]).all(axis=1)]
        counts.append((seen.labels[path[:, 1], path[:, 0]] == number).sum())
    return 1.0 if counts[0] <= counts[1] else -1.0


def _crease(seen: Seen, number: int, other: int, middle: NDArray, along: NDArray) -> tuple[NDArray, NDArray] | None:
    """The image of the line where two planes meet, if it passes near a side's own; None for planes that hardly differ."""
    plane = seen.planes[number]
    meets = np.array([0.0, 0.0, 1.0, 0.0]) if other == SUPPORT else seen.planes[other]
    direction = np.cross(plane[:3], meets[:3])
    if np.linalg.norm(direction) < np.sin(PARALLEL_RAD):
        return None
    direction /= np.linalg.norm(direction)
    near = lifted(seen, number, middle[None])[0]
    point = np.linalg.lstsq(np.stack([plane[:3], meets[:3], direction]), [plane[3], meets[3], direction @ near], rcond=None)[0]
    T = seen.view.T_world_sensor
    ends = (np.stack([point - 0.01 * direction, point + 0.01 * direction]) - T[:3, 3]) @ T[:3, :3]
    uv = seen.view.projection.project(ends)
    line = uv[1] - uv[0]
    if not np.isfinite(line).all() or np.linalg.norm(line) < 1e-6:
        return None
    line /= np.linalg.norm(line)
    away = uv.mean(axis=0) - middle
    far = abs(away[0] * line[1] - away[1] * line[0])
    limit = NEAR_CREASE_PX + (3.0 if other == SUPPORT else 0.0)
    turned = abs(line[0] * along[1] - line[1] * along[0])
    if far > limit or turned > np.sin(np.deg2rad(25.0)):
        return None
    return uv.mean(axis=0), line


def _line(points: NDArray) -> tuple[NDArray, NDArray, float]:
    """Middle, unit direction and rms [px] of the line through points (n, 2), those far off left out."""
    for _ in range(3):
        middle = points.mean(axis=0)
        axes = np.linalg.svd(points - middle, full_matrices=False)[2]
        off = (points - middle) @ np.array([-axes[0, 1], axes[0, 0]])
        keep = np.abs(off) <= max(2.5 * off.std(), 0.6)
        if keep.all() or keep.sum() < 3:
            break
        points = points[keep]
    return middle, axes[0], float(off.std())


def lifted(seen: Seen, number: int, uv: NDArray) -> NDArray:
    """Points (n, 3) [m] of the world where pixels (n, 2) look onto a patch's plane."""
    depth = _depth_on(seen, number, uv)
    return apply(seen.view.T_world_sensor, seen.view.projection.unproject(uv, depth))


def _depth_on(seen: Seen, number: int, uv: NDArray) -> NDArray:
    """Depth (n,) [m] at which pixels (n, 2) look onto a patch's plane."""
    T, plane = seen.view.T_world_sensor, seen.planes[number]
    start = apply(T, seen.view.projection.unproject(uv, np.zeros(len(uv))))
    step = rotate(T, seen.view.projection.unproject(uv, np.ones(len(uv))) - seen.view.projection.unproject(uv, np.zeros(len(uv))))
    with np.errstate(divide="ignore", invalid="ignore"):
        return (plane[3] - start @ plane[:3]) / (step @ plane[:3])


def scale_of(seen: Seen, contour: NDArray, number: int) -> float:
    """Pixels per metre across the view at a contour."""
    return float(seen.view.projection.pixels_per_metre(float(np.median(_depth_on(seen, number, contour)))))
