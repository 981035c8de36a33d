"""Meshes and CAD files that come as bytes from a browser: how large they are in their own numbers, and the parts that they hold."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from handey_studio.base import BadInput, measured
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.operations import TakeSuggestion
from handey_studio.world.importing import UNITS, Imported, ImportOptions, Simplifiable, import_part
from handey_studio.world.model_files import MESH_SUFFIXES, read_mesh
from handey_studio.world.step_files import STEP_SUFFIXES

T = TypeVar("T")
USUAL_MM = (8.0, 1000.0)  # how large across parts for a hand are
SUFFIXES = (*MESH_SUFFIXES, *STEP_SUFFIXES)


@dataclass(frozen=True, eq=False)
class MeshUpload:
    """A mesh or CAD file as it was uploaded, and how it is to be read: `simplify_m` [m], 0 for exactly; `body` 0 for the only one."""

    name: str
    content: bytes
    unit: str = ""
    simplify_m: float = 0.0
    body: int = 0

    @property
    def suffix(self) -> str:
        return Path(self.name).suffix.lower()

    @property
    def tells_unit(self) -> bool:
        """Whether nobody needs to be asked for the unit."""
        return bool(self.unit) or self.suffix in STEP_SUFFIXES


@dataclass(frozen=True)
class Refusal:
    """Why a file is no part as it is, in one sentence, and the tolerance [m] within which it would be one, 0 where none is known."""

    sentence: str
    tolerance: float = 0.0


def extents_of_upload(upload: MeshUpload) -> tuple[float, float, float] | Refusal:
    """How large the file's mesh is along x, y, z in its own numbers."""

    def read(path: Path) -> tuple[float, float, float] | Refusal:
        corners = read_mesh(path).corners
        if not len(corners) or not np.isfinite(corners).all():
            return Refusal(f'"{upload.name}" holds no surface, or a corner that is no finite number.')
        x, y, z = np.ptp(corners, axis=0)
        return float(x), float(y), float(z)

    return _in_file(upload, read)


def part_of_upload(upload: MeshUpload) -> Imported | Refusal:
    """The part that the file holds."""
    options = ImportOptions(upload.unit, upload.simplify_m or None, upload.body or None)
    return _in_file(upload, lambda path: import_part(path, options))


def likely_unit(extents: tuple[float, float, float]) -> str:
    """The unit in which a part of that size is one that a hand takes; millimetres where several are."""
    across = float(np.linalg.norm(extents))
    return next((unit for unit in ("mm", "m", "cm", "in") if USUAL_MM[0] <= 1e3 * UNITS[unit] * across <= USUAL_MM[1]), "mm")


def draft_of_import(made: Imported) -> Draft:
    """A draft whose one step is an imported shape, set down upright on z = 0 around the origin."""
    solid, source = made.part.solid, made.part.provenance.source
    low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
    middle = (low + high) / 2.0
    moved = Polyhedron(solid.vertices - (middle[0], middle[1], low[2]), solid.faces)
    step = TakeSuggestion(moved.vertices, tuple(face.loops for face in moved.faces), (source,) * len(moved.faces))
    return Draft(made.part.name, (), (step,))


def told_of_import(upload: MeshUpload, made: Imported) -> str:
    """What became of the file, in a sentence."""
    off = f", at most {measured(made.deviation, 'm')} off its surface" if made.deviation else ""
    several = f", body {upload.body} of {made.bodies}" if made.bodies > 1 else ""
    return f"{len(made.part.solid.faces)} faces of {made.triangles} polygons of {upload.name}{several}{off}."


def _in_file(upload: MeshUpload, read: Callable[[Path], T]) -> T | Refusal:
    """What is read from the upload's bytes in a file, whose folder nobody is told of."""
    with tempfile.TemporaryDirectory(prefix="handey-") as folder:
        path = Path(folder) / Path(upload.name).name
        path.write_bytes(upload.content)
        try:
            return read(path)
        except BadInput as error:
            tolerance = error.tolerance if isinstance(error, Simplifiable) else 0.0
            return Refusal(str(error).replace(f"{folder}/", ""), tolerance)
