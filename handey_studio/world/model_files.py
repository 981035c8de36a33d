"""Part models on disk: OBJ with true polygon faces, any triangle mesh, and the sidecar for what OBJ cannot say."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.base.files import replace_file
from handey_studio.geometry import Polyhedron, polyhedron_from_polygons
from handey_studio.world.numbering import numbered_as, pieces
from handey_studio.world.part import Part
from handey_studio.world.sidecar import sidecar_part

MESH_SUFFIXES = (".obj", ".stl", ".ply", ".off")
MAX_MODEL_BYTES = 50_000_000
MIN_SIZE_M, MAX_SIZE_M = 1e-3, 3.0
FACE_GROUP = "face_"  # and its number: the group of a face's polygons in files that we wrote


class Mesh(NamedTuple):
    """Corners (n, 3) in the file's unit, polygons as corner numbers, and which face each is a piece of, -1 or nothing where none says."""

    corners: NDArray
    polygons: list[list[int]]
    faces: Sequence[int] = ()


def read_part(path: str | os.PathLike, scale: float = 1.0) -> Part:
    """A part from a mesh file [m × scale] and, if there is one, the `.toml` sidecar of the same name beside it."""
    path = Path(path)
    return sidecar_part(path.stem, read_polyhedron(path, scale), path.with_suffix(".toml"))


def read_polyhedron(path: str | os.PathLike, scale: float = 1.0) -> Polyhedron:
    """The solid in a mesh file, in metres after scaling. Raises BadInput with one sentence."""
    path = Path(path)
    mesh = read_mesh(path)
    if not np.isfinite(scale) or scale <= 0:
        raise BadInput(f"the part scale is {scale}; it must be a positive number.")
    try:
        corners = mesh.corners * scale
        solid = polyhedron_from_polygons(corners, mesh.polygons)
    except BadInput as error:
        raise BadInput(f'part model "{path}" cannot be used: {error}') from None
    solid = numbered_as(solid, corners, mesh.polygons, mesh.faces) if -1 not in mesh.faces and mesh.faces else solid
    if not MIN_SIZE_M <= solid.diameter <= MAX_SIZE_M:
        raise BadInput(
            f'part model "{path}" is {solid.diameter:.4g} m across; parts are {MIN_SIZE_M} to {MAX_SIZE_M} m: is the scale right? '
            "Millimetre files take a scale of 0.001."
        )
    return solid


def read_mesh(path: Path) -> Mesh:
    """What a mesh file holds, as it is. Raises BadInput with one sentence."""
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise BadInput(f'part model "{path}" has the suffix "{path.suffix}"; it must be one of {", ".join(MESH_SUFFIXES)}.')
    try:
        if path.is_dir():
            raise BadInput(f'part model "{path}" is a folder; give a file in it.')
        if path.stat().st_size > MAX_MODEL_BYTES:
            raise BadInput(f'part model "{path}" has {path.stat().st_size} bytes, the limit is {MAX_MODEL_BYTES}.')
        return _read_obj(path) if path.suffix.lower() == ".obj" else _read_mesh(path)
    except FileNotFoundError:
        raise BadInput(f'part model "{path}" does not exist.') from None
    except OSError as error:
        raise BadInput(f'part model "{path}" cannot be read: {error.strerror}.') from None


def write_obj(path: str | os.PathLike, solid: Polyhedron) -> None:
    """Write a solid as OBJ, in metres: the file is the old one or the new one whole, whatever happens meanwhile. Raises OSError."""
    replace_file(Path(path), obj_text(solid).encode())


def obj_text(solid: Polyhedron) -> str:
    """A solid as OBJ: its corners exactly, each face a group of its own; a face with holes as triangles, which reading puts together."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in solid.vertices.tolist()]
    before = -1
    for polygon, face in zip(*pieces(solid), strict=True):
        if face != before:
            lines.append(f"g {FACE_GROUP}{face}")
        lines.append("f " + " ".join(str(c + 1) for c in polygon))
        before = face
    return "\n".join(lines) + "\n"


def _read_obj(path: Path) -> Mesh:
    vertices: list[list[float]] = []
    polygons: list[list[int]] = []
    faces: list[int] = []
    group = -1
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        words = line.split("#")[0].split()
        try:
            if words[:1] == ["v"]:
                vertices.append([float(word) for word in words[1:4]])
                if len(vertices[-1]) != 3:
                    raise ValueError
            elif words[:1] == ["f"]:
                corners = [int(word.split("/")[0]) for word in words[1:]]
                polygons.append([c - 1 if c > 0 else len(vertices) + c for c in corners])
                faces.append(group)
            elif words[:1] == ["g"]:
                match = re.fullmatch(rf"{FACE_GROUP}([0-9]{{1,6}})", " ".join(words[1:]))
                group = int(match[1]) if match else -1
        except ValueError:
            raise BadInput(f'part model "{path}", line {number}: "{line.strip()[:60]}" is not a corner or a face.') from None
    return Mesh(np.array(vertices, dtype=float).reshape(-1, 3), polygons, faces)


def _read_mesh(path: Path) -> Mesh:
    import trimesh  # slow to import, and only arms and foreign meshes need it

    try:
        mesh = trimesh.load_mesh(path, process=False)
        return Mesh(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces).tolist())
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, NotImplementedError) as error:  # the mesh readers' own
        raise BadInput(f'part model "{path}" cannot be read as a mesh: {error}.') from None
