"""The corners and edges that a click may snap to: those of the solid, and those of the patches' outlines that are edges of the object."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply
from handey_studio.modeling.patches.patch import Patch, Patches
from handey_studio.modeling.picking.snap import MODEL, Ray
from handey_studio.modeling.scans import Scan

REAL_BORDERS = ("crease", "foot", "rim")  # where a patch is cut off by a nearer thing or by the image's end, the object has no edge
BEHIND_M = 1e-3  # nothing nearer to the eye is looked at


@dataclass(frozen=True, eq=False)
class Features(Value):
    """Segments from `starts` to `ends` (n, 3) [m] in the model frame, the same point twice for corners; `directions` (n, 3), unit or zero.

    `owners` (n,): a scan's number or `MODEL`; `numbers` (n,): the model's corner or edge, or the patch; `words` say what each is.
    """

    starts: NDArray
    ends: NDArray
    directions: NDArray
    owners: NDArray
    numbers: NDArray
    words: tuple[str, ...]

    def nearest(self, ray: Ray) -> tuple[NDArray, NDArray]:
        """The point (n, 3) [m] of each that the ray passes nearest, and how many pixels of the screen lie between (n,)."""
        along = self.ends - self.starts
        to_start = self.starts - ray.origin
        flat_along = along - np.outer(along @ ray.direction, ray.direction)
        flat_start = to_start - np.outer(to_start @ ray.direction, ray.direction)
        length = (flat_along**2).sum(axis=1)
        share = np.where(length > 1e-18, -(flat_along * flat_start).sum(axis=1) / np.maximum(length, 1e-18), 0.0)
        share = np.clip(share, 0.0, 1.0)[:, None]
        distance = (to_start + share * along) @ ray.direction
        off = np.linalg.norm(flat_start + share * flat_along, axis=1)
        away = np.where(distance > BEHIND_M, off / np.maximum(distance, BEHIND_M) / ray.pixel_rad, np.inf)
        return self.starts + share * along, away


@dataclass(frozen=True)
class _Row:
    start: NDArray
    end: NDArray
    owner: int
    number: int
    words: str


def corners_of(
    scans: tuple[Scan, ...], Ts_model_scan: tuple[NDArray, ...], patches: tuple[Patches | None, ...], solid: Polyhedron | None
) -> Features:
    """The solid's corners, and those of the patches' outlines between two real edges."""
    vertices = solid.vertices if solid is not None else ()
    rows = [_Row(vertex, vertex, MODEL, k, f"corner {k} of the model") for k, vertex in enumerate(vertices)]
    for k, scan, patch, T in _patches(scans, Ts_model_scan, patches):
        for ring, borders in zip(patch.rings, patch.borders, strict=True):
            real = [border.kind in REAL_BORDERS for border in borders]
            corners = apply(T, ring)
            words = f'corner of patch {patch.number} in scan "{scan.name}"'
            rows += [_Row(corners[c], corners[c], k, patch.number, words) for c in range(len(ring)) if real[c] and real[c - 1]]
    return _features(rows)


def edges_of(
    scans: tuple[Scan, ...], Ts_model_scan: tuple[NDArray, ...], patches: tuple[Patches | None, ...], solid: Polyhedron | None
) -> Features:
    """The solid's edges, and the sides of the patches' outlines that are edges of the object."""
    ends = [solid.vertices[[edge.start, edge.end]] for edge in solid.edges] if solid is not None else ()
    rows = [_Row(start, end, MODEL, number, f"edge {number} of the model") for number, (start, end) in enumerate(ends)]
    for k, scan, patch, T in _patches(scans, Ts_model_scan, patches):
        for ring, borders in zip(patch.rings, patch.borders, strict=True):
            corners = apply(T, ring)
            for c, border in enumerate(borders):
                if border.kind in REAL_BORDERS:
                    words = f'{border.kind} of patch {patch.number} in scan "{scan.name}"'
                    rows.append(_Row(corners[c], corners[(c + 1) % len(corners)], k, patch.number, words))
    return _features(rows)


def _patches(
    scans: tuple[Scan, ...], Ts: tuple[NDArray, ...], patches: tuple[Patches | None, ...]
) -> list[tuple[int, Scan, Patch, NDArray]]:
    every = enumerate(zip(scans, Ts, patches, strict=True))
    return [(k, scan, patch, T) for k, (scan, T, found) in every if found is not None for patch in found.patches]


def _features(rows: list[_Row]) -> Features:
    starts, ends = (np.array([getattr(row, end) for row in rows]).reshape(-1, 3) for end in ("start", "end"))
    along = ends - starts
    directions = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    owners, numbers = (np.array([getattr(row, key) for row in rows], dtype=int) for key in ("owner", "number"))
    return Features(starts, ends, directions, owners, numbers, tuple(row.words for row in rows))
