"""Outlines of patches: their contours as straight sides, each told by what lies beyond it.

Where two planes meet, their intersection is the side; where the object ends, the contour is, with what the sensor loses there added back.
"""

from typing import NamedTuple

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply, rotate
from handey_studio.modeling.patches import Border
from handey_studio.sensing.depth_view import DepthView

FAR_PX = 45  # beyond a contour the next reading is looked for so far: shadows are wide
LEAST_HOLE = 0.3  # of a hole's pixels must be seen on other things
LEAST_HOLE_PX = 40
SIMPLE_PX, RAGGED = 1.5, 1.2  # a contour's side may leave a straight line by so much, and by this share of the outline error
COARSER = (1.0, 1.6, 2.5)  # times as much where the sides would cross one another
SHORT = 3.5  # slacks: a shorter side may be a rounded corner
MEET_SLACKS, MEET_PX = 6.0, 8.0  # lines that meet farther from their corner do not make it
MOST_LOST_M = 0.0025  # depth cameras lose 3 to 5 mm; what is measured beyond comes from other things beside the outlines
MOST_SLANT = 2.0  # surfaces seen flatly lose more of their rims, up to so many times as much
LOST_UNSURE = 0.35  # what a sensor loses at rims is known to so much of it
TRIM = 0.12  # of a side at each end belongs to the corner
SAME_SURFACE_SIGMAS = 6.0
NEAR_CREASE_PX = 5.0  # a crease that the planes put farther from the contour is not used
PARALLEL_RAD = np.deg2rad(12.0)
SUPPORT = -2


class Seen(NamedTuple):
    """What outlines are made from: the view, `labels` (H, W) with -2 for the support, world planes (n, 4) as normal and offset, readings'
    `sigma` (H, W) [m], and how far the true outline lies outside the outermost readings [px at 1 m, or anywhere], as `lost_m`."""

    view: DepthView
    labels: NDArray
    planes: NDArray
    sigma: NDArray
    lost_m: float


class Outline(NamedTuple):
    """`ring` (n, 3) [m] in the world's frame and what its sides are."""

    ring: NDArray
    borders: tuple[Border, ...]


def lost_at_rims(view: DepthView) -> float:
    """How far [m] the true outline lies outside the middles of the outermost readings: half a pixel, and what depth cameras lose."""
    depth = view.depth[np.isfinite(view.depth)]
    pixel = 1.0 / float(view.projection.pixels_per_metre(float(np.median(depth)) if len(depth) else 1.0))
    return 0.5 * pixel + float(np.clip(view.outline_error - pixel, 0.0, MOST_LOST_M))


def outlines_of(seen: Seen, number: int) -> list[Outline]:
    """The outer outline of a patch, counter-clockwise seen from outside, and those of its holes, clockwise; empty when it has none."""
    rows, columns = np.nonzero(seen.labels == number)
    top, left = rows.min() - 1, columns.min() - 1
    mask = np.zeros((rows.max() - top + 2, columns.max() - left + 2), np.uint8)
    mask[rows - top, columns - left] = 1
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    mask[[0, -1]] = 0
    mask[:, [0, -1]] = 0
    contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return []
    outer = max((k for k in range(len(contours)) if tree[0][k][3] < 0), key=lambda k: cv2.contourArea(contours[k]))
    chosen = [outer, *(k for k in range(len(contours)) if tree[0][k][3] == outer and _is_hole(seen, contours[k], left, top))]
    found = [_outline(seen, number, contours[k][:, 0] + np.array([left, top], float), k != outer) for k in chosen]
    return [outline for outline in found if outline is not None] if found[0] is not None else []


def _is_hole(seen: Seen, contour: NDArray, left: int, top: int) -> bool:
    """Whether other things are seen through it: lost readings make no hole."""
    if cv2.contourArea(contour) < LEAST_HOLE_PX:
        return False
    low, high = contour[:, 0].min(axis=0), contour[:, 0].max(axis=0)
    inside = np.zeros((high - low + 1)[::-1], np.uint8)
    cv2.drawContours(inside, [contour - low], 0, 1, -1)
    v, u = np.nonzero(inside)
    return bool(np.isfinite(seen.view.depth[v + low[1] + top, u + low[0] + left]).mean() > LEAST_HOLE)


def _outline(seen: Seen, number: int, contour: NDArray, hole: bool) -> Outline | None:
    """The outline with straight sides of a closed contour (n, 2) [px] of patch `number`; None if it cannot be had without crossings."""
    if len(contour) < 8:
        return None
    beyond = _beyond(seen, number, contour)
    pixels_per_m = _scale(seen, contour, number)
    slack = max(SIMPLE_PX, RAGGED * seen.view.outline_error * pixels_per_m)
    for coarser in COARSER:
        found = _polygon(seen, number, contour, beyond, slack * coarser, pixels_per_m)
        if found is not None and is_simple(found.ring, seen.planes[number, :3]):
            ring, borders = found
            if (_signed_area(ring, seen.planes[number, :3]) < 0) != hole:
                ring, borders = ring[::-1], (*borders[-2::-1], borders[-1])
            return Outline(ring, borders)
    return None


def _polygon(
    seen: Seen, number: int, contour: NDArray, beyond: tuple[NDArray, NDArray], slack: float, pixels_per_m: float
) -> Outline | None:
    """Straight sides that leave the contour by at most about `slack` [px]."""
    corners = _corner_numbers(contour, slack)
    if len(corners) < 3:
        return None
    lines, borders = [], []
    for a, b in zip(corners, np.roll(corners, -1), strict=True):
        inside = _trimmed(a, b, len(contour))
        border, line = _side(seen, number, contour[inside], beyond[0][inside], beyond[1][inside], pixels_per_m)
        lines.append(line)
        borders.append(border)
    places = contour[corners]
    while (short := _needless(lines, places, slack)) is not None:
        lines.pop(short)
        borders.pop(short)
        places = np.delete(places, short, axis=0)
    return Outline(_lifted(seen, number, _met(lines, places, slack)), tuple(borders)) if len(lines) > 2 else None


def _needless(lines: list[tuple[NDArray, NDArray]], places: NDArray, slack: float) -> int | None:
    """A short side whose neighbours meet near it: a corner that the sensor rounded."""
    n = len(lines)
    lengths = np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=1)
    for k in np.argsort(lengths):
        if n <= 3 or lengths[k] > SHORT * slack:
            return None
        meeting = _meeting(lines[k - 1], lines[(k + 1) % n])
        if meeting is not None and np.linalg.norm(meeting - 0.5 * (places[k] + places[(k + 1) % n])) < SHORT * slack:
            return int(k)
    return None


def _beyond(seen: Seen, number: int, contour: NDArray) -> tuple[NDArray, NDArray]:
    """What lies beyond each contour pixel: kinds "r", "c", "f", "k" (cut), "i" as characters, and the other patch's number or -1."""
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


def _side(
    seen: Seen, number: int, contour: NDArray, kinds: NDArray, others: NDArray, pixels_per_m: float
) -> tuple[Border, tuple[NDArray, NDArray]]:
    """What one side is, and its line in the image: a point and a unit direction [px]."""
    middle, along, off = _line(contour)
    outward = np.array([along[1], -along[0]])
    per_px = _metres_across(seen, number, middle, along, outward)
    sigma_px = max(off, 0.3) / np.sqrt(max(len(contour) / 6.0, 1.0))
    kind = max("rcfkiu", key=lambda k: (kinds == k).sum())
    if kind in "cf":
        other = int(np.bincount(others[kinds == "c"]).argmax()) if kind == "c" else SUPPORT
        crease = _crease(seen, number, other, middle, along)
        if crease is not None:
            return Border("crease" if kind == "c" else "foot", other), crease
        kind = "u"
    if kind in "riu":
        slant = float(np.clip(per_px * pixels_per_m, 1.0, MOST_SLANT))
        lost_px = 0.5 + max(0.0, seen.lost_m * pixels_per_m - 0.5) * slant
        middle = middle + outward * lost_px * _outward_sign(seen, number, middle, outward)
        sigma_px = float(np.hypot(sigma_px, LOST_UNSURE * lost_px))
    names = {"r": "rim", "k": "cut", "i": "image", "u": "rim"}
    beyond = others[kinds == kind]
    other = int(np.bincount(beyond[beyond >= 0]).argmax()) if kind in "rk" and (beyond >= 0).mean() > 0.5 else -1
    return Border(names.get(kind, "rim"), other, sigma_px * per_px), (middle, along)


def _metres_across(seen: Seen, number: int, middle: NDArray, along: NDArray, outward: NDArray) -> float:
    """How far [m] a side moves on the patch's plane when its image moves by a pixel."""
    start, ahead, aside = _lifted(seen, number, np.stack([middle, middle + along, middle + outward]))
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
    near = _lifted(seen, number, middle[None])[0]
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


def _corner_numbers(contour: NDArray, slack: float) -> NDArray:
    """Which contour pixels are corners of the polygon that leaves it by at most `slack` [px]."""
    polygon = cv2.approxPolyDP(np.rint(contour).astype(np.int32)[:, None], slack, True)[:, 0]
    place = {tuple(point): k for k, point in enumerate(np.rint(contour).astype(int).tolist())}
    numbers = sorted({place[tuple(point)] for point in polygon.tolist()})
    return np.array(numbers)


def _trimmed(a: int, b: int, n: int) -> NDArray:
    """Numbers of the contour's pixels from a to b, without those beside the corners."""
    length = (b - a) % n or n
    cut = int(TRIM * length)
    return np.arange(a + cut, a + length - cut + 1) % n


def _meeting(one: tuple[NDArray, NDArray], two: tuple[NDArray, NDArray]) -> NDArray | None:
    """Where two lines in the image meet; None for those that are about parallel."""
    (p, d), (q, e) = one, two
    cross = d[0] * e[1] - d[1] * e[0]
    if abs(cross) < np.sin(PARALLEL_RAD):
        return None
    return p + ((q[0] - p[0]) * e[1] - (q[1] - p[1]) * e[0]) / cross * d


def _met(lines: list[tuple[NDArray, NDArray]], corners: NDArray, slack: float) -> NDArray:
    """Corners (n, 2) [px] where neighbouring lines meet; where they hardly do, the middle of both lines' nearest points."""
    out = []
    for k, place in enumerate(corners):
        meeting = _meeting(lines[k - 1], lines[k])
        if meeting is None or np.linalg.norm(meeting - place) > MEET_SLACKS * slack + MEET_PX:
            meeting = np.mean([p + ((place - p) @ d) * d for p, d in (lines[k - 1], lines[k])], axis=0)
        out.append(meeting)
    return np.array(out)


def _lifted(seen: Seen, number: int, uv: NDArray) -> NDArray:
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


def _scale(seen: Seen, contour: NDArray, number: int) -> float:
    """Pixels per metre across the view at a contour."""
    return float(seen.view.projection.pixels_per_metre(float(np.median(_depth_on(seen, number, contour)))))


def _signed_area(ring: NDArray, normal: NDArray) -> float:
    return 0.5 * float(np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0) @ normal)


def area_of(rings: list[NDArray], normal: NDArray) -> float:
    """Area [m²] inside the outer ring and outside the holes."""
    return float(sum(_signed_area(ring, normal) for ring in rings))


def is_simple(ring: NDArray, normal: NDArray) -> bool:
    """Whether a ring does not cross itself."""
    x = np.linalg.svd(normal[None])[2][1]
    flat = ring @ np.stack([x, np.cross(normal, x)], axis=1)
    return bool(shapely.Polygon(flat).is_valid)
