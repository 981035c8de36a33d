"""A part kept in the user's own library: OBJ with true polygon faces, the sidecar, and the draft that it was modelled by."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from handey_studio.base import BadInput
from handey_studio.base.files import replace_files
from handey_studio.geometry import Polyhedron, polyhedron_from_polygons
from handey_studio.world.library import Library
from handey_studio.world.model_files import MAX_SIZE_M, MIN_SIZE_M, obj_text, read_part
from handey_studio.world.numbering import numbered_as, pieces
from handey_studio.world.part import Part
from handey_studio.world.sidecar import sidecar_text

DRAFT_SUFFIX = ".draft"
MAX_NAME = 60
SAME_PLANE = 1e-6  # of normal and offset [m]


def check_part_name(name: str) -> str:
    """A part's name, which is also that of its files and a word of destinations. Raises BadInput with one sentence."""
    if not re.fullmatch(r"\w([\w \-]*[\w\-])?", name) or len(name) > MAX_NAME:
        raise BadInput(f'the part name "{name[:80]}" cannot be used; give 1 to {MAX_NAME} letters, digits, "_", "-" or spaces inside.')
    return name


def write_part(library: Library, part: Part, draft: bytes | None = None, overwrite: bool = False) -> Part:
    """Keep a part in the user's own `parts/`, with its draft (bytes of a `.draft` file) if there is one; the part as reading gives it.

    Nobody ever finds it half written. Raises BadInput with one sentence when its shape is no solid, its name cannot be used, or a part of
    that name is there and `overwrite` is off.
    """
    folder, name = library.folder / "parts", check_part_name(part.name)
    _check_free(library, folder, name, overwrite)
    path = folder / f"{name}.obj"
    kept = as_read(part)
    files = {path.with_suffix(DRAFT_SUFFIX): draft} if draft is not None else {}
    files |= {path.with_suffix(".toml"): sidecar_text(kept).encode(), path: obj_text(kept.solid).encode()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        replace_files(files)
        if draft is None:
            path.with_suffix(DRAFT_SUFFIX).unlink(missing_ok=True)  # another shape's history
    except OSError as error:
        raise BadInput(f'part "{name}" cannot be written to "{folder}": {error.strerror}.') from None
    return read_part(path)


def as_read(part: Part) -> Part:
    """The part as its file keeps it: coplanar neighbours merged, corners on straight edges gone; where there are none, numbered as it was.

    Raises BadInput when its shape is no solid that can be read.
    """
    try:
        polygons, faces = pieces(part.solid)
        solid = polyhedron_from_polygons(part.solid.vertices, polygons)
    except BadInput as error:
        raise BadInput(f'part "{part.name}" cannot be kept: {error}') from None
    if not MIN_SIZE_M <= solid.diameter <= MAX_SIZE_M:
        raise BadInput(f'part "{part.name}" is {solid.diameter:.4g} m across; parts are {MIN_SIZE_M:g} to {MAX_SIZE_M:g} m.')
    solid = numbered_as(solid, part.solid.vertices, polygons, faces)
    assumed = {_same_face(part.solid, f, solid) for f in part.provenance.assumed_faces if 0 <= f < len(part.solid.faces)}
    return replace(part, solid=solid, provenance=replace(part.provenance, assumed_faces=tuple(sorted(assumed))))


def _same_face(old: Polyhedron, f: int, new: Polyhedron) -> int:
    """The face of `new` in the plane of face f of `old`, the one with most of its corners where several are."""
    apart = np.abs(new.normals - old.normals[f]).max(axis=1) + np.abs(new.offsets - old.offsets[f])
    corners = {tuple(corner) for corner in old.vertices[list(old.faces[f].outer)].tolist()}
    shared = [sum(tuple(new.vertices[c].tolist()) in corners for c in face.outer) for face in new.faces]
    return int(np.lexsort((apart, -np.array(shared) * (apart < SAME_PLANE)))[0])


def _check_free(library: Library, folder: Path, name: str, overwrite: bool) -> None:
    there = library.part_files().get(name)
    if there is None:
        return
    if there.parent == folder and there.suffix.lower() != ".obj":
        raise BadInput(f'a part "{name}" is there as "{there}"; give another name, or take that file away first.')
    if not overwrite:
        kind = "a part" if there.parent == folder else "a bundled part"
        raise BadInput(f'{kind} "{name}" is there already; give another name, or say that yours takes its place.')
