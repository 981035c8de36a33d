"""Suggestions as the JSON that other programs read."""

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import entry_report
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.patches.finding import patch_at, patches_of
from handey_studio.modeling.patches.patch import Patches
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting.suggest import suggest_object
from handey_studio.modeling.suggesting.suggestion import Suggestion

SCHEMA = "handey/model-suggest/1"


def suggested(
    scan: Scan, at: tuple[float, float] | None, every: bool, reduced_by: int, timing: dict[str, float]
) -> tuple[dict[str, Any], list[Polyhedron], str]:
    """The report, its solids in the same order, and the reason when there is none.

    `at` (u, v) [px of the file] asks for one object, `every` for all; else the largest that can be closed. The scan has one pixel for
    `reduced_by` × `reduced_by` of the file's. `timing` [s] is added to.
    """
    begun = time.perf_counter()
    patches = patches_of(scan)
    timing = timing | {"patches": time.perf_counter() - begun}
    begun = time.perf_counter()
    found, reason = [], "nothing with a planar face stands above the support"
    for number in _asked(patches, at, reduced_by):
        suggestion = suggest_object([scan], [np.eye(4)], [patches], 0, number)
        found.append((number, suggestion))
        if suggestion.solid is not None and not every:
            break
    if at is not None and not found:
        reason = f"no planar face lies at {at[0]:g}, {at[1]:g} px"
    timing |= {"suggest": time.perf_counter() - begun}
    closed = sorted(((n, s, s.solid) for n, s in found if s.solid is not None), key=lambda f: -f[2].volume_and_centroid[0])
    refused = [(number, suggestion) for number, suggestion in found if suggestion.solid is None]
    T = scan.view.T_world_sensor
    report = {
        "schema": SCHEMA,
        "T_world_sensor": T.tolist(),
        "objects": [_object(*one, patches, reduced_by, T) for one in closed],
        "refused": [_tried(number, suggestion, patches, reduced_by) for number, suggestion in refused],
        "timing_s": timing,
    }
    return report, [solid for _, _, solid in closed], refused[0][1].reason if refused else reason


def _asked(patches: Patches, at: tuple[float, float] | None, reduced_by: int) -> list[int]:
    if at is None:
        return list(range(len(patches.objects)))
    u, v = ((value - 0.5 * (reduced_by - 1)) / reduced_by for value in at)
    patch = patch_at(patches, u, v)
    return [] if patch is None else [patch.object]


def _tried(number: int, suggestion: Suggestion, patches: Patches, reduced_by: int) -> dict[str, Any]:
    at = _pixel_of(patches, number) * reduced_by + 0.5 * (reduced_by - 1)
    return {"at_px": at.tolist(), "reason": suggestion.reason, "ledger": [entry_report(entry) for entry in suggestion.entries]}


def _object(
    number: int, suggestion: Suggestion, solid: Polyhedron, patches: Patches, reduced_by: int, T_world_sensor: NDArray
) -> dict[str, Any]:
    return _tried(number, suggestion, patches, reduced_by) | {
        "vertices_m": solid.vertices.tolist(),
        "faces": [[list(loop) for loop in face.loops] if face.holes else list(face.outer) for face in solid.faces],
        "sources": list(suggestion.sources),
        "T_world_sensor": T_world_sensor.tolist(),
        "dimensions_mm": (1e3 * aligned_box(solid)).tolist(),
        "height_mm": 1e3 * float(solid.vertices[:, 2].max()),
        "rms_m": suggestion.rms,
        "explained": suggestion.explained,
        "relations": [
            {"kind": r.kind, "faces": list(r.faces), "off": r.off, "limit": r.limit, "unit": r.unit} for r in suggestion.relations
        ],
    }


def _pixel_of(patches: Patches, number: int) -> NDArray:
    """(u, v) [px] on the object's largest patch, at the reading nearest to its middle."""
    largest = max(patches.objects[number], key=lambda k: patches.patches[k].readings)
    rows, columns = np.nonzero(patches.labels == largest)
    nearest = int(np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2))
    return np.array([float(columns[nearest]), float(rows[nearest])])


def aligned_box(solid: Polyhedron) -> NDArray:
    """Sides (3,) [m], the largest last, of the smallest box around a solid with one side along a face and one along an edge of it."""
    best, least = np.zeros(3), np.inf
    for f, face in enumerate(solid.faces):
        corners = solid.vertices[list(face.outer)]
        for along in np.roll(corners, -1, axis=0) - corners:
            along = along / np.linalg.norm(along)
            axes = np.stack([solid.normals[f], along, np.cross(solid.normals[f], along)])
            sides = np.ptp(solid.vertices @ axes.T, axis=0)
            if sides.prod() < least * (1.0 - 1e-9):
                best, least = sides, float(sides.prod())
    return np.sort(best)
