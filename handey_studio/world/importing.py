"""Parts from elsewhere: meshes and CAD files in any unit become exact polyhedra, or a sentence tells why not and what would help."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handey_studio.base import BadInput, Value, measured
from handey_studio.geometry import Polyhedron, polyhedron_from_polygons
from handey_studio.geometry.meshes import MAX_TRIANGLES, check_closed, triangles_of, welded
from handey_studio.world.model_files import MESH_SUFFIXES, Mesh, read_mesh
from handey_studio.world.part import Part, Provenance
from handey_studio.world.simplify import MAX_TRIANGLES as MOST_SIMPLIFIED
from handey_studio.world.simplify import MOST_FACES, simplified
from handey_studio.world.step_files import STEP_SUFFIXES, read_step

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}  # in metres
USUAL_M = (0.008, 1.0)  # how large across parts that a hand takes are
TRIED_M = (0.0002, 0.0005, 0.001, 0.002)  # tolerances that are tried to say what would help


class Simplifiable(BadInput):
    """A mesh that is too rough as it is; within `tolerance` [m] it would be a part."""

    def __init__(self, sentence: str, tolerance: float) -> None:
        super().__init__(sentence)
        self.tolerance = tolerance


@dataclass(frozen=True)
class ImportOptions:
    """`unit`: that of the file's numbers, one of m, cm, mm, in; STEP files tell their own. `simplify_m` [m]: planes so near are made one.

    `body`: which of several separate bodies, from 1, the largest first. `name`: the file's own where empty.
    """

    unit: str = ""
    simplify_m: float | None = None
    body: int | None = None
    name: str = ""
    density: float = 700.0
    friction: float = 0.5


@dataclass(frozen=True, eq=False)
class Imported(Value):
    """The `part`; how many `triangles` its file had and `bodies` were in it; `deviation` [m]: the file's surface from the part's."""

    part: Part
    triangles: int
    bodies: int
    deviation: float


def import_part(path: str | os.PathLike, options: ImportOptions) -> Imported:
    """The part in an OBJ, STL, PLY, OFF or STEP file. Raises BadInput with one sentence that says what is wrong and what would help."""
    path = Path(path)
    try:
        mesh, scale = _read(path, options.unit)
        if not np.isfinite(mesh.corners).all():
            raise BadInput("a corner is not a finite number; every coordinate must be one.")
        _check_size(mesh.corners, scale, options.unit)
        corners, triangles = welded(mesh.corners * scale, triangles_of(mesh.corners * scale, mesh.polygons))
        found = _bodies(corners, triangles)
        triangles = _chosen(corners, found, options.body)
        solid, deviation = _solid(corners, triangles, options.simplify_m)
    except Simplifiable as error:
        raise Simplifiable(f'"{path}" cannot be imported: {error}', error.tolerance) from None
    except BadInput as error:
        raise BadInput(f'"{path}" cannot be imported: {error}') from None
    told = f"imported from {path.name}" + (f", simplified within {measured(options.simplify_m, 'm')}" if options.simplify_m else "")
    part = Part(options.name or path.stem, solid, options.density, options.friction, provenance=Provenance(told))
    return Imported(part, len(mesh.polygons), len(found), deviation)


def _read(path: Path, unit: str) -> tuple[Mesh, float]:
    """The file's mesh, and how many metres its unit is."""
    if path.suffix.lower() in STEP_SUFFIXES:
        return read_step(path), 1.0
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise BadInput(f'it has the suffix "{path.suffix}"; it must be one of {", ".join((*MESH_SUFFIXES, *STEP_SUFFIXES))}.')
    mesh = read_mesh(path)
    if unit not in UNITS:
        across = _across(mesh.corners)
        raise BadInput(f"its numbers have no unit; say which: {', '.join(UNITS)} ({across:.4g} across{_guess(across)}).")
    return mesh, UNITS[unit]


def _across(corners: NDArray) -> float:
    return float(np.linalg.norm(np.ptp(corners, axis=0))) if len(corners) else 0.0


def _guess(across: float) -> str:
    """Which unit would give a part of usual size."""
    for unit in ("mm", "m", "cm", "in"):
        if USUAL_M[0] <= across * UNITS[unit] <= USUAL_M[1]:
            return f": {unit} would make it {1e3 * across * UNITS[unit]:.4g} mm"
    return ""


def _check_size(corners: NDArray, scale: float, unit: str) -> None:
    across = _across(corners)
    if across == 0.0:
        raise BadInput("it holds no surface.")
    if not USUAL_M[0] / 4 <= across * scale <= 3 * USUAL_M[1]:
        given = f"in {unit} " if unit else ""
        raise BadInput(f"{given}it would be {across * scale:.4g} m across{_guess(across)}; parts are 0.002 to 3 m: is the unit right?")


def _bodies(corners: NDArray, triangles: NDArray) -> list[NDArray]:
    """The triangles of each connected surface, the one that spans the largest box first."""
    if not len(triangles):
        raise BadInput("it has no triangles with an area.")
    links = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    piece = connected_components(coo_array((np.ones(len(links)), tuple(links.T)), shape=(len(corners),) * 2), directed=False)[1]
    owner = piece[triangles[:, 0]]
    found = [triangles[owner == number] for number in np.unique(owner)]
    return sorted(found, key=lambda some: -_across(corners[some].reshape(-1, 3)))


def _chosen(corners: NDArray, found: list[NDArray], body: int | None) -> NDArray:
    """The triangles of the body that is wanted."""
    if body is None and len(found) == 1:
        return found[0]
    sizes = [np.ptp(corners[some].reshape(-1, 3), axis=0) for some in found]
    told = "; ".join(f"{k}: {' × '.join(f'{1e3 * x:.3g}' for x in size)} mm" for k, size in enumerate(sizes[:6], 1))
    if body is None:
        raise BadInput(f"it has {len(found)} surfaces that do not touch, separate bodies or hollows; choose one as the body ({told}).")
    if not 1 <= body <= len(found):
        raise BadInput(f"it has no body {body}; choose from 1 to {len(found)} ({told}).")
    return found[body - 1]


def _solid(corners: NDArray, triangles: NDArray, tolerance: float | None) -> tuple[Polyhedron, float]:
    """The polyhedron of one closed surface and how far it is off it [m]."""
    volume = np.einsum("ij,ij->i", corners[triangles[:, 0]], np.cross(corners[triangles[:, 1]], corners[triangles[:, 2]])).sum()
    triangles = triangles[:, ::-1] if volume < 0 else triangles
    check_closed(triangles)
    if tolerance is not None:
        if not 1e-6 <= tolerance <= 0.02:
            raise BadInput(f"it cannot be simplified within {1e3 * tolerance:g} mm; give 0.001 to 20 mm.")
        made = simplified(*_compact(corners, triangles), tolerance)
        return made.solid, made.deviation
    if len(triangles) > MAX_TRIANGLES:
        raise _what_helps(corners, triangles, f"it has {len(triangles)} triangles, the limit is {MAX_TRIANGLES}")
    solid = polyhedron_from_polygons(corners, triangles.tolist())
    if len(solid.faces) > MOST_FACES:
        raise _what_helps(corners, triangles, f"it has {len(solid.faces)} planar faces, the limit is {MOST_FACES}")
    return solid, 0.0


def _what_helps(corners: NDArray, triangles: NDArray, wrong: str) -> BadInput:
    """What is wrong with a mesh, and the least of some tolerances within which it becomes a polyhedron."""
    corners, triangles = _compact(corners, triangles)
    if len(triangles) > MOST_SIMPLIFIED:
        return BadInput(f"{wrong}; thin the mesh out, then it may be simplified.")
    for tolerance in TRIED_M:
        try:
            made = simplified(corners, triangles, tolerance)
        except BadInput:
            continue
        helps = f"it would have {len(made.solid.faces)} faces, at most {measured(made.deviation, 'm')} off"
        return Simplifiable(f"{wrong}; simplified within {1e3 * tolerance:g} mm {helps}.", tolerance)
    rough = f"it is round, or too rough to be simplified within {1e3 * TRIED_M[-1]:g} mm: only shapes with flat faces can be parts"
    return BadInput(f"{wrong}; {rough}.")


def _compact(corners: NDArray, triangles: NDArray) -> tuple[NDArray, NDArray]:
    used, numbers = np.unique(triangles, return_inverse=True)
    return corners[used], numbers.reshape(-1, 3)
