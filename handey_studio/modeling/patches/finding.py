"""From a scan to its patches: regions of readings on one plane, their outlines, and which of them belong to one body."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, distance_transform_edt, find_objects

from handey_studio.geometry.transforms import apply
from handey_studio.modeling.patches.bodies import bodies_of, creases_of
from handey_studio.modeling.patches.growing import grown, normals_of, planes_of
from handey_studio.modeling.patches.outlines import area_of, contours_of, outlines_of, rims_of
from handey_studio.modeling.patches.patch import SUPPORT, Border, Crease, Patch, Patches
from handey_studio.modeling.patches.sides import Seen, drift_of, lost_at_rims
from handey_studio.modeling.patches.windows import Field, field_of, noise_image
from handey_studio.modeling.scans import Scan
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.drawing import Camera, camera_of

ON_SUPPORT_SIGMAS = 4.5
INNER_PX = 3
INNER_SHARE = 0.25
PARTS = 6  # a patch is cut into so many along each way to see how it bends


@dataclass(frozen=True)
class PatchOptions:
    """`least_readings` of a patch, and `least_radius_px` of the largest circle in it: less is a rounded edge or chance."""

    least_readings: int = 40
    least_radius_px: float = 3.5


def patches_of(scan: Scan, options: PatchOptions = PatchOptions()) -> Patches:
    """The planar faces above the support that a scan shows; none in a view without readings above it."""
    view = scan.view
    sigma = noise_image(view)
    points = apply(view.T_world_sensor, view.points_sensor())
    height = points[..., 2]
    with np.errstate(invalid="ignore"):
        above, support = height > ON_SUPPORT_SIGMAS * sigma, np.abs(height) <= ON_SUPPORT_SIGMAS * sigma
    camera = camera_of(view.projection)
    field = field_of(view, above)
    labels, _ = grown(field, camera)
    labels = _without_slivers(labels, options)
    if labels.max() < 0:
        return Patches(np.where(support, SUPPORT, labels), (), ())
    planes = _world_planes(view, _inner_planes(field, labels), camera)
    labels = np.where((labels < 0) & support, SUPPORT, labels)
    creases = creases_of(view, points, labels, planes, sigma)
    return _told(view, labels, planes, sigma, points, creases)


def patch_at(patches: Patches, u: float, v: float, reach_px: int = 4) -> Patch | None:
    """The patch at or nearest to a pixel, up to `reach_px` away; None where there is none."""
    height, width = patches.labels.shape
    j, i = round(v), round(u)
    top, left = max(0, j - reach_px), max(0, i - reach_px)
    near = patches.labels[top : j + reach_px + 1, left : i + reach_px + 1] if j > -reach_px and i > -reach_px else np.empty((0, 0))
    rows, columns = np.nonzero(near >= 0)
    if not len(rows) or j >= height + reach_px or i >= width + reach_px:
        return None
    nearest = int(np.argmin((rows + top - v) ** 2 + (columns + left - u) ** 2))
    number = int(near[rows[nearest], columns[nearest]])
    return patches.patches[number]


def _without_slivers(labels: NDArray, options: PatchOptions) -> NDArray:
    """Labels of regions that are large and wide enough, numbered anew from 0, the largest first."""
    kept = []
    for k, part in enumerate(find_objects(labels + 1)):
        if part is None:
            continue
        inside = np.pad(labels[part] == k, 1)
        count = int(inside.sum())
        if count >= options.least_readings and np.asarray(distance_transform_edt(inside)).max() >= options.least_radius_px:
            kept.append((count, k))
    number = np.full(max(int(labels.max()) + 1, 1), -1, np.int32)
    for new, (_, k) in enumerate(sorted(kept, reverse=True)):
        number[k] = new
    return np.where(labels >= 0, number[labels], -1).astype(np.int32)


def _inner_planes(field: Field, labels: NDArray) -> NDArray:
    """Planes (n, 3) of the value through the readings that are not beside the region's end."""
    inner = np.full_like(labels, -1)
    for k, part in enumerate(find_objects(labels + 1)):
        inside = np.pad(labels[part] == k, 1)
        core = binary_erosion(inside, np.ones((3, 3)), INNER_PX)
        use = core if core.sum() > INNER_SHARE * inside.sum() else inside
        np.copyto(inner[part], k, where=use[1:-1, 1:-1])
    return planes_of(field, inner, int(labels.max()) + 1)


def _world_planes(view: DepthView, planes: NDArray, camera: Camera) -> NDArray:
    """Normals and offsets (n, 4) in the world's frame of planes (n, 3) of the value."""
    normals = normals_of(planes, camera)
    constant = planes[:, 0] + planes[:, 1] * camera[3] + planes[:, 2] * camera[4]
    if camera[0]:
        away = np.stack([planes[:, 1] * camera[1], planes[:, 2] * camera[2], -np.ones(len(planes))], axis=1)
        offsets = -constant / np.linalg.norm(away, axis=1)
    else:
        away = np.stack([planes[:, 1] * camera[1], planes[:, 2] * camera[2], constant], axis=1)
        offsets = -1.0 / np.linalg.norm(away, axis=1)
    R, t = view.T_world_sensor[:3, :3], view.T_world_sensor[:3, 3]
    world = normals @ R.T
    return np.column_stack([world, offsets + world @ t])


def _told(view: DepthView, labels: NDArray, planes: NDArray, sigma: NDArray, points: NDArray, creases: tuple[Crease, ...]) -> Patches:
    """The patches with their outlines; regions without a simple outline stay readings that belong to no patch."""
    seen = Seen(view, labels, planes, sigma, lost_at_rims(view))
    parts = find_objects(labels + 1)
    contours = [contours_of(seen, k, parts[k]) for k in range(len(planes))]
    rims = [rim for k, found in enumerate(contours) for contour in found for rim in rims_of(seen, k, contour)]
    seen = seen._replace(drift_px=drift_of(rims))
    outlines = [outlines_of(seen, k, found) for k, found in enumerate(contours)]
    kept = [k for k, found in enumerate(outlines) if found]
    number = np.full(len(planes) + 2, -1)  # the last two for "none" and "support", -1 and -2
    number[kept] = np.arange(len(kept))
    number[SUPPORT] = SUPPORT
    labels = number[labels]
    creases = tuple(Crease(int(number[c.a]), int(number[c.b]), c.convex, c.readings) for c in creases if number[[c.a, c.b]].min() >= 0)
    patches = []
    for new, k in enumerate(kept):
        rings = tuple(outline.corners for outline in outlines[k])
        borders = tuple(tuple(Border(b.kind, int(number[b.other]), b.sigma) for b in outline.borders) for outline in outlines[k])
        on = points[parts[k]][labels[parts[k]] == new]
        rms, bend, tilt = _flatness(on, planes[k])
        area = area_of(list(rings), planes[k, :3])
        patches.append(Patch(new, planes[k, :3], float(planes[k, 3]), rings, borders, rms, area, len(on), bend, tilt, 0))
    objects = bodies_of(patches, creases, 3.0 * seen.lost_m)
    owner = {patch: k for k, members in enumerate(objects) for patch in members}
    return Patches(labels, tuple(replace(patch, object=owner[patch.number]) for patch in patches), objects, creases)


def _flatness(points: NDArray, plane: NDArray) -> tuple[float, float, float]:
    """The rms [m] of points (n, 3) off a plane, that of the means over its parts, and the tilt [rad] that such means may hide."""
    off = points @ plane[:3] - plane[3]
    middle = points.mean(axis=0)
    axes = np.linalg.svd((points - middle)[:: max(1, len(points) // 500)], full_matrices=False)[2]
    across = (points - middle) @ axes[:2].T
    low, size = across.min(axis=0), np.maximum(np.ptp(across, axis=0), 1e-9)
    part = np.minimum((across - low) / size * PARTS, PARTS - 1).astype(int) @ (PARTS, 1)
    count = np.bincount(part, minlength=PARTS**2)
    means = np.bincount(part, off, PARTS**2)[count > 0] / count[count > 0]
    rms, bend = float(np.sqrt(np.mean(off**2))), float(np.sqrt(np.average(means**2, weights=count[count > 0])))
    width = np.sqrt(12.0) * float(across[:, 1].std())
    return rms, bend, float(np.sqrt(12.0) * bend / max(width, 1e-6))
