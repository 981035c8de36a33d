"""What the screen needs to know of a model in the making: where its scans stand, what can be clicked, how assumed faces are hatched."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import frozen_array
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, transform
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.patches.patch import Patches
from handey_studio.modeling.picking.snapping import Pickable, pickable
from handey_studio.modeling.replay import Built, replay
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting.suggestion import Alignment

GAP_M = 0.03  # between a scan that is not aligned yet and those beside it
AROUND_M = 0.05  # so much of the support is shown around what stands on it
FLOOR_NOISES = 4.0
COMPANY_STEPS = 8.0  # spacings of readings by which neighbours on one surface may differ in depth
HATCH_M = 0.004
ASSUMED = "assumed"


@lru_cache(maxsize=32)
def built_of(draft: Draft, steps: int) -> Built:
    """What the first so many steps of a draft make."""
    return replay(Draft(draft.name, draft.scans, draft.operations[:steps]))


@lru_cache(maxsize=16)
def shown_poses(draft: Draft, alignment: Alignment | None, alternative: int) -> tuple[NDArray, ...]:
    """T_model_scan (4, 4) at which each scan is shown: where it is aligned, else as proposed, else beside the others."""
    known = built_of(draft, len(draft.operations)).Ts_model_scan
    poses: list[NDArray] = []
    for number, scan in enumerate(draft.scans):
        pose = known.get(scan.name)
        if pose is None:
            proposed = proposals(alignment)
            pose = proposed[alternative % len(proposed)] if proposed else _beside(draft.scans[:number], poses, scan)
        poses.append(pose)
    return tuple(poses)


def proposals(alignment: Alignment | None) -> tuple[NDArray, ...]:
    """The poses that an alignment offers, best first; none when nothing fits."""
    if alignment is None or alignment.T_model_scan is None:
        return ()
    return (alignment.T_model_scan, *(pose for pose, _ in alignment.others))


def unaligned(draft: Draft) -> Scan | None:
    """The first scan whose pose no step tells yet."""
    known = built_of(draft, len(draft.operations)).Ts_model_scan
    return next((scan for scan in draft.scans if scan.name not in known), None)


@lru_cache(maxsize=4)
def clickable(scans: tuple[Scan, ...], poses: tuple[bytes, ...], patches: tuple[Patches | None, ...], solid: Polyhedron | None) -> Pickable:
    """Everything that a click can meet; `poses` are the bytes of T_model_scan."""
    return pickable(scans, tuple(np.frombuffer(pose).reshape(4, 4) for pose in poses), patches, solid)


def points_of(scan: Scan, T_model_scan: NDArray) -> NDArray:
    """A scan's readings (n, 3) [m] above its support, in the model's frame."""
    readings = _readings(scan)
    return apply(T_model_scan, readings[readings[:, 2] > _floor(scan)])


def ground_of(scan: Scan) -> NDArray:
    """A scan's readings (n, 3) [m] of its support around what stands on it, in the scan's own world."""
    readings = _readings(scan)
    above = readings[:, 2] > _floor(scan)
    if not above.any():
        return readings
    low, high = np.percentile(readings[above, :2], (1.0, 99.0), axis=0)
    near = ((readings[:, :2] > low - AROUND_M) & (readings[:, :2] < high + AROUND_M)).all(axis=1)
    return readings[~above & near]


@lru_cache(maxsize=16)
def spacing_of(scan: Scan) -> float:
    """How far apart [m] neighbouring readings are, across the view."""
    depth = float(np.nanmedian(scan.view.depth))
    return 1.0 / float(scan.view.projection.pixels_per_metre(depth))


@lru_cache(maxsize=16)
def hatching(solid: Polyhedron, faces: tuple[int, ...], spacing: float = HATCH_M) -> NDArray:
    """Slanting lines (n, 2, 3) [m] across faces of a solid."""
    lines = [_hatched(solid, face, spacing) for face in faces]
    return frozen_array(np.concatenate(lines) if lines else np.empty((0, 2, 3)))


def assumed_faces(sources: Sequence[str]) -> tuple[int, ...]:
    """Numbers of the faces that no scan has shown."""
    return tuple(number for number, source in enumerate(sources) if source.startswith(ASSUMED))


def _hatched(solid: Polyhedron, face: int, spacing: float) -> NDArray:
    T = solid.face_frame(face)
    slant = transform([[1, -1, 0], [1, 1, 0], [0, 0, np.sqrt(2)]] / np.sqrt(2.0))
    T = T @ slant
    polygon = solid.face_polygon(face, T)
    x0, y0, x1, y1 = polygon.bounds
    rows = np.arange(np.ceil(y0 / spacing) * spacing, y1, spacing)
    long = shapely.linestrings(np.stack([np.c_[np.full_like(rows, x0 - 1.0), rows], np.c_[np.full_like(rows, x1 + 1.0), rows]], axis=1))
    pieces = [piece for piece in shapely.get_parts(shapely.intersection(long, polygon)) if piece.geom_type == "LineString"]
    ends = np.array([shapely.get_coordinates(piece)[[0, -1]] for piece in pieces if not piece.is_empty]).reshape(-1, 2, 2)
    return T[:3, 3] + ends @ T[:3, :2].T


def _floor(scan: Scan) -> float:
    """The height [m] above which a reading is no longer the support's."""
    return max(1e-3, FLOOR_NOISES * scan.view.noise)


def _beside(scans: Sequence[Scan], poses: Sequence[NDArray], scan: Scan) -> NDArray:
    """What it shows stands beside what all others show along x, level with it along y, so that points can be picked on both."""
    here, there = points_of(scan, np.eye(4)), [points_of(other, pose) for other, pose in zip(scans, poses, strict=False)]
    there = [points for points in there if len(points)]
    if not len(here) or not there:
        return np.eye(4)
    low, _ = np.percentile(here, (1.0, 99.0), axis=0)
    ends = [np.percentile(points, (1.0, 99.0), axis=0) for points in there]
    right = max(float(high[0]) for _, high in ends)
    across = np.median(there[0][:, 1]) - np.median(here[:, 1])
    return frozen_array(transform(None, (right + GAP_M - float(low[0]), float(across), 0.0)))


@lru_cache(maxsize=16)
def _readings(scan: Scan) -> NDArray:
    """Readings (n, 3) [m] in the scan's own world, without those that stand alone in the air: near the eye they would hide the object."""
    points = apply(scan.view.T_world_sensor, scan.view.points_sensor())
    return frozen_array(points[np.isfinite(points[..., 2]) & _in_company(scan.view.depth, COMPANY_STEPS * spacing_of(scan))])


def _in_company(depth: NDArray, step: float) -> NDArray:
    """Which readings (H, W) have at least two neighbours that are no farther or nearer than `step` [m]."""
    wide = np.pad(depth, 1, constant_values=np.nan)
    height, width = depth.shape
    beside = [wide[1 + j : 1 + j + height, 1 + i : 1 + i + width] for j in (-1, 0, 1) for i in (-1, 0, 1) if (j, i) != (0, 0)]
    return np.sum([np.abs(other - depth) < step for other in beside], axis=0) >= 2
