"""A part as a thumbnail: seen from above and the front, faces shaded by how they look towards the light, hidden ones covered."""

from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.pictures.svg import listed, svg
from handey_studio.world import Part

SIGHT = np.array([0.52, -0.74, 0.43])  # towards the eye: the front broad, the right side narrow
LIGHT = np.array([-0.28, -0.38, 0.88])
MOST_ORDERED = 300  # faces; more are drawn by how far their middles are
LEAST_SHARE = 1e-5  # of the picture's area, below which faces do not overlap
FLAT = "display:block;width:100%;height:100%"


@lru_cache(maxsize=256)
def part_thumbnail(part: Part, size: int = 96) -> str:
    """The picture, `size` × `size` units large on a transparent ground, as SVG text. The same part gives the same text."""
    solid = part.solid
    eye = SIGHT / np.linalg.norm(SIGHT)
    right = np.array([-eye[1], eye[0], 0.0]) / np.hypot(eye[0], eye[1])
    seen = [f for f in range(len(solid.faces)) if solid.normals[f] @ eye > 1e-6]
    flat = np.stack([solid.vertices @ right, -(solid.vertices @ np.cross(eye, right))], axis=1)
    low, high = flat.min(axis=0), flat.max(axis=0)
    flat = size / 2.0 + (flat - (low + high) / 2.0) * (0.90 * size / float((high - low).max()))
    outlines = {f: shapely.Polygon(flat[list(solid.faces[f].outer)], [flat[list(hole)] for hole in solid.faces[f].holes]) for f in seen}
    width = size / 96.0
    shapes = [_face(outlines[f], _shade(solid.normals[f]), width) for f in _back_to_front(part, outlines, eye, size)]
    around = shapely.union_all([outline.buffer(0.01) for outline in outlines.values()])
    line = f'stroke="{palette.css(palette.EDGE)}" stroke-width="{1.6 * width:g}" stroke-linejoin="round"'
    rim = f'<path d="{_path(around)}" fill="none" {line}/>'
    return svg(f"part-picture-{part.name}", part.name, size, size, *shapes, rim, style=FLAT)


def _back_to_front(part: Part, outlines: dict[int, shapely.Polygon], eye: NDArray, size: int) -> list[int]:
    """Faces so that each comes after all that it covers: where two overlap in the picture, the one nearer to the eye there is later."""
    solid = part.solid
    depths = {f: solid.vertices[list(solid.faces[f].outer)] @ eye for f in outlines}
    todo = sorted(outlines, key=lambda f: float(depths[f].mean()))
    if len(todo) > MOST_ORDERED:
        return todo
    planes = {f: _nearness(outlines[f], depths[f]) for f in todo}
    covers = {f: {g for g in todo if g != f and _is_over(outlines, planes, f, g, size)} for f in todo}
    order: list[int] = []
    while todo:
        left = set(todo)
        ready = next((f for f in todo if not covers[f] & left), todo[0])  # faces that cover each other in a ring: the farthest first
        order.append(ready)
        todo.remove(ready)
    return order


def _nearness(outline: shapely.Polygon, depths: NDArray) -> NDArray:
    """How near to the eye a face's plane is in the picture: (a, b, c) of a·x + b·y + c, from its corners."""
    corners = shapely.get_coordinates(outline.exterior)[:-1]
    return np.linalg.lstsq(np.c_[corners, np.ones(len(corners))], depths, rcond=None)[0]


def _is_over(outlines: dict[int, shapely.Polygon], planes: dict[int, NDArray], f: int, g: int, size: int) -> bool:
    """Whether face f covers a piece of face g."""
    both = outlines[f].intersection(outlines[g])
    if both.area < LEAST_SHARE * size * size:
        return False
    spot = np.r_[shapely.get_coordinates(both.representative_point())[0], 1.0]
    return bool(planes[f] @ spot > planes[g] @ spot)


def _face(outline: shapely.Polygon, colour: palette.RGB, width: float) -> str:
    look = f'fill="{palette.css(colour)}" stroke="{palette.css(palette.EDGE)}" stroke-width="{0.7 * width:g}" stroke-linejoin="round"'
    return f'<path d="{_path(outline)}" fill-rule="evenodd" {look}/>'


def _path(outline: shapely.Geometry) -> str:
    rings = [
        ring for piece in shapely.get_parts(outline) if isinstance(piece, shapely.Polygon) for ring in (piece.exterior, *piece.interiors)
    ]
    return " ".join(f"M{listed(np.array(ring.coords)[:-1]).replace(' ', ' L')}Z" for ring in rings)


def _shade(normal: NDArray) -> palette.RGB:
    """The lighter the more a face looks towards the light."""
    share = 0.52 + 0.52 * max(0.0, float(normal @ LIGHT))
    r, g, b = (int(min(255.0, share * c + 22.0)) for c in palette.ORANGE)
    return r, g, b
