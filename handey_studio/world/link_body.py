"""A link's collision geometry: its exact mesh, and the convex pieces that hold it, worked out once and kept in the user's cache."""

import hashlib
import os
import sys
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, frozen_array
from handey_studio.base.files import replace_file
from handey_studio.geometry import hull_triangles
from handey_studio.geometry.cover import CoverOptions, convex_cover
from handey_studio.geometry.round_bodies import cuboid, cylinder, sphere
from handey_studio.geometry.transforms import apply

METHOD = 2  # counts the ways in which pieces were made: those kept by another one are not used


@dataclass(frozen=True)
class LinkBody:
    """A link's collision geometry. `link` counts the moving links: 0 is the fixed base, i is what joint i carries.

    `hulls`, each (n, 3) [m] in the link's frame, are the corners of convex pieces that together hold the link. `vertices` and `triangles`
    are its exact mesh.
    """

    name: str
    link: int
    hulls: tuple[NDArray, ...]
    vertices: NDArray
    triangles: NDArray


def link_body(geometry: Any) -> LinkBody:
    """The body of one of Pinocchio's collision objects. Raises BadInput for shapes and files that cannot be read."""
    kept = _kept_at(geometry)
    arrays = _recalled(kept) if kept is not None else None
    if arrays is None:
        arrays = _made(geometry)
        if kept is not None:
            _keep(kept, arrays)
    hulls = tuple(frozen_array(arrays[f"hull_{k}"]) for k in range(len(arrays) - 2))
    name = geometry.name.rsplit("_", 1)[0]
    return LinkBody(name, geometry.parentJoint, hulls, frozen_array(arrays["vertices"]), frozen_array(arrays["triangles"], int))


def _made(geometry: Any) -> dict[str, NDArray]:
    """The mesh in its link's frame and its pieces."""
    vertices, triangles = _primitive(geometry) if _mesh_file(geometry) is None else _mesh(geometry)
    vertices = apply(geometry.placement.homogeneous, vertices)
    pieces = convex_cover(vertices, triangles)
    return {"vertices": vertices, "triangles": triangles} | {f"hull_{k}": piece for k, piece in enumerate(pieces)}


def _mesh(geometry: Any) -> tuple[NDArray, NDArray]:
    import trimesh  # slow to import, and only links seen for the first time and foreign meshes need it

    try:
        mesh: Any = trimesh.load_mesh(geometry.meshPath)
    except (OSError, ValueError, NotImplementedError) as error:
        raise BadInput(f'the collision mesh "{geometry.meshPath}" of "{geometry.name}" cannot be read: {error}.') from None
    return np.asarray(mesh.vertices) * np.asarray(geometry.meshScale).reshape(3), np.asarray(mesh.faces)


def _mesh_file(geometry: Any) -> Path | None:
    """The file that the mesh is in; None for a plain shape."""
    return Path(geometry.meshPath) if geometry.meshPath and geometry.meshPath not in ("BOX", "CYLINDER", "SPHERE") else None


def _primitive(geometry: Any) -> tuple[NDArray, NDArray]:
    """A plain shape; a round one as the polytope that holds it."""
    shape = geometry.geometry
    if hasattr(shape, "halfSide"):
        corners = cuboid(2 * np.asarray(shape.halfSide).reshape(3))
    elif hasattr(shape, "halfLength"):
        corners = cylinder(2 * shape.halfLength, shape.radius)
    elif hasattr(shape, "radius"):
        corners = sphere(shape.radius)
    else:
        raise BadInput(f'collision shape of "{geometry.name}" is not supported; use a mesh, box, cylinder or sphere.')
    return corners, hull_triangles(corners)


def cache_folder() -> Path:
    """Where what can be worked out again is kept, by the platform's custom."""
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "handey-studio"
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "handey-studio"


def _kept_at(geometry: Any) -> Path | None:
    """The file in the cache, named by all that the pieces hang on; None for plain shapes, and for meshes that are not there."""
    path = _mesh_file(geometry)
    if path is None or not path.is_file():
        return None
    digest = hashlib.sha256(path.read_bytes())
    digest.update(repr((path.suffix, METHOD, CoverOptions())).encode())
    digest.update(np.asarray(geometry.meshScale, dtype=float).tobytes() + np.ascontiguousarray(geometry.placement.homogeneous).tobytes())
    return cache_folder() / "links" / f"{digest.hexdigest()[:32]}.npz"


def _recalled(path: Path) -> dict[str, NDArray] | None:
    """What was kept; None when nothing was, or not all of it can be read any more."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except (OSError, ValueError, EOFError, KeyError, BadZipFile):
        return None


def _keep(path: Path, arrays: dict[str, NDArray]) -> None:
    """Keeps the arrays for the next process; a cache that cannot be written is done without."""
    content = BytesIO()
    np.savez(content, allow_pickle=False, **arrays)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, content.getvalue())
    except OSError:
        return
