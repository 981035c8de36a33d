"""Part models on disk: OBJ with true polygon faces, any triangle mesh, and the sidecar for what OBJ cannot say."""

import os
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron, polyhedron_from_polygons
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.world.part import Mate, Part

MESH_SUFFIXES = (".obj", ".stl", ".ply", ".off")
MAX_MODEL_BYTES = 50_000_000
MIN_SIZE_M, MAX_SIZE_M = 1e-3, 3.0


def read_part(path: str | os.PathLike, scale: float = 1.0) -> Part:
    """A part from a mesh file [m × scale] and, if there is one, the `.toml` sidecar of the same name beside it."""
    path = Path(path)
    solid = read_polyhedron(path, scale)
    sidecar = path.with_suffix(".toml")
    table: dict[str, Any] = {}
    if sidecar.is_file():
        try:
            table = tomllib.loads(sidecar.read_text())
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise BadInput(f'the sidecar "{sidecar}" cannot be read as TOML: {error}.') from None
    try:
        mates = {
            name: Mate(mate["part"], from_xyz_rpy(mate["xyz_m"], np.deg2rad(mate.get("rpy_deg", (0, 0, 0)))))
            for name, mate in table.get("mates", {}).items()
        }
        return Part(
            path.stem, solid, density=float(table.get("density_kg_m3", 700.0)), friction=float(table.get("friction", 0.5)), mates=mates
        )
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(f'the sidecar "{sidecar}" is broken: {error!r}.') from None


def read_polyhedron(path: str | os.PathLike, scale: float = 1.0) -> Polyhedron:
    """The solid in a mesh file, in metres after scaling. Raises BadInput with one sentence."""
    path = Path(path)
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise BadInput(f'part model "{path}" has the suffix "{path.suffix}"; it must be one of {", ".join(MESH_SUFFIXES)}.')
    try:
        if path.stat().st_size > MAX_MODEL_BYTES:
            raise BadInput(f'part model "{path}" has {path.stat().st_size} bytes, the limit is {MAX_MODEL_BYTES}.')
        vertices, polygons = _read_obj(path) if path.suffix.lower() == ".obj" else _read_mesh(path)
    except FileNotFoundError:
        raise BadInput(f'part model "{path}" does not exist.') from None
    except OSError as error:
        raise BadInput(f'part model "{path}" cannot be read: {error.strerror}.') from None
    if not np.isfinite(scale) or scale <= 0:
        raise BadInput(f"the part scale is {scale}; it must be a positive number.")
    try:
        solid = polyhedron_from_polygons(vertices * scale, polygons)
    except BadInput as error:
        raise BadInput(f'part model "{path}" cannot be used: {error}') from None
    if not MIN_SIZE_M <= solid.diameter <= MAX_SIZE_M:
        raise BadInput(
            f'part model "{path}" is {solid.diameter:.4g} m across; parts are {MIN_SIZE_M} to {MAX_SIZE_M} m: is the scale right? '
            "Millimetre files take a scale of 0.001."
        )
    return solid


def write_obj(path: str | os.PathLike, solid: Polyhedron) -> None:
    """Write a solid as OBJ; a face with holes goes out as triangles, which reading merges again."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in solid.vertices]
    for f, face in enumerate(solid.faces):
        polygons = solid.face_triangles(f).tolist() if face.holes else [face.outer]
        lines += ["f " + " ".join(str(c + 1) for c in polygon) for polygon in polygons]
    Path(path).write_text("\n".join(lines) + "\n")


def _read_obj(path: Path) -> tuple[np.ndarray, list[list[int]]]:
    vertices: list[list[float]] = []
    polygons: list[list[int]] = []
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
        except ValueError:
            raise BadInput(f'part model "{path}", line {number}: "{line.strip()[:60]}" is not a corner or a face.') from None
    return np.array(vertices, dtype=float).reshape(-1, 3), polygons


def _read_mesh(path: Path) -> tuple[np.ndarray, list[list[int]]]:
    import trimesh  # slow to import, and only arms and foreign meshes need it

    try:
        mesh = trimesh.load_mesh(path, process=False)
        return np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces).tolist()
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, NotImplementedError) as error:  # the mesh readers' own
        raise BadInput(f'part model "{path}" cannot be read as a mesh: {error}.') from None
