"""Corners and faces keep their numbers on the way through a file: what points at face 3 today points at it tomorrow."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry import Face, Polyhedron

Loop = tuple[int, ...]


def numbered_as(solid: Polyhedron, corners: NDArray, polygons: list[list[int]], faces: Sequence[int]) -> Polyhedron:
    """The solid that was made of polygons over corners (n, 3), with its corners and faces numbered as there; `faces[k]` is the face that
    polygon k is a piece of. Where the polygons are not just its faces, in pieces or whole, it stays as it is."""
    places = {place: number for number, place in enumerate(map(tuple, corners.tolist()))}
    numbers = [places.get(place, -1) for place in map(tuple, solid.vertices.tolist())]
    if len(places) != len(corners) or sorted(numbers) != list(range(len(corners))):
        return solid
    owner = {side: face for polygon, face in zip(polygons, faces, strict=True) for side in _sides(tuple(polygon))}
    whole = {face: tuple(polygon) for polygon, face in zip(polygons, faces, strict=True)}
    counts, found = Counter(faces), dict[int, Face]()
    for face in solid.faces:
        loops = [tuple(numbers[c] for c in loop) for loop in face.loops]
        of = {owner.get(side, -1) for loop in loops for side in _sides(loop)}
        number = of.pop()
        if of or number < 0 or number in found:
            return solid
        found[number] = _face(loops, whole[number] if counts[number] == 1 else None)
    if sorted(found) != sorted(set(faces)) or sorted(found) != list(range(len(found))):
        return solid
    return Polyhedron(corners, tuple(found[number] for number in range(len(found))))


def _face(loops: list[Loop], whole: Loop | None) -> Face:
    """The face with loops in a fixed order: as its one polygon begins, else each from its lowest corner, holes by their lowest."""
    if whole is not None:
        return Face(whole)
    outer, *holes = (loop[loop.index(min(loop)) :] + loop[: loop.index(min(loop))] for loop in loops)
    return Face(outer, tuple(sorted(holes)))


def _sides(loop: Loop) -> list[tuple[int, int]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def pieces(solid: Polyhedron) -> tuple[list[list[int]], list[int]]:
    """The faces as single loops of corner numbers, and which face each is a piece of; a face with holes is cut into the triangles of its
    constrained Delaunay triangulation, others stay whole."""
    cut = [solid.face_triangles(f).tolist() if face.holes else [list(face.outer)] for f, face in enumerate(solid.faces)]
    return [polygon for some in cut for polygon in some], np.repeat(np.arange(len(cut)), [len(some) for some in cut]).tolist()
