"""Exact operations on solids: join, cut, common, half spaces, mirror images, prisms between two planes (Handey 1987 §1).

The booleans are manifold3d's, in double precision. Faces that are meant to be flush never are to the last bit, and what lies between would
come out as films: so a tool is made half a micrometre larger, and every corner of the result is put back to where the planes meet that its
faces came from, which takes the steps away again.
"""

from typing import Literal

import manifold3d
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handey_studio.base import BadInput, measured
from handey_studio.geometry import Face, Polyhedron, polyhedron_from_polygons
from handey_studio.geometry.meshes import standing_for
from handey_studio.geometry.soundness import unmatched_sides
from handey_studio.modeling.planes import corners_on_planes, nearest_plane, onto_planes, told_point
from handey_studio.modeling.soundness import SLIVER_M, checked, narrowest, sound, without_slivers

FLUSH_M = 2e-5  # a face of a tool this near to a plane of the solid is meant to be in it; what lay between would be a sliver
LARGER_M = 5e-7  # so much larger than asked is every tool while it works
FOUND_M = 5e-6  # a face of a result this near to a plane came from it
SAME_VOLUME_M3 = 1e-13
FAR_M = 3.0
WORDS = {"join": "joining them", "cut": "the cut", "common": "keeping what is common"}


def combined(solid: Polyhedron, tool: Polyhedron, how: Literal["join", "cut", "common"]) -> Polyhedron:
    """The two solids joined, the second cut from the first, or what is common to both.

    Raises BadInput with one sentence when nothing is left, nothing changes, or what is left is no single solid body without slivers.
    """
    tool = _made_flush(tool, solid)
    _check_effect(solid, tool, how)
    a, b = _manifold(solid), _manifold(_larger(tool))
    result = {"join": a + b, "cut": a - b, "common": a ^ b}[how]
    normals = np.concatenate([solid.normals, tool.normals])
    offsets = np.concatenate([solid.offsets, tool.offsets])
    return without_slivers(_polyhedron(result, normals, offsets, WORDS[how]), WORDS[how], solid, tool)


def common_volume(a: Polyhedron, b: Polyhedron) -> float:
    """The volume [m³] of what two solids have in common."""
    return float((_manifold(a) ^ _manifold(b)).volume())


def cut_by_plane(solid: Polyhedron, point: ArrayLike, normal: ArrayLike) -> Polyhedron:
    """The part of a solid on the far side of a plane from where its `normal` (3,) points. Raises BadInput."""
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    offset = float(normal @ np.asarray(point, dtype=float))
    heights = solid.vertices @ normal - offset
    if heights.max() < SLIVER_M:
        raise BadInput("the plane does not pass through the solid on the side that it would cut off; nothing would change.")
    if heights.min() > -SLIVER_M:
        raise BadInput("the plane would cut off the whole solid; turn it round or move it.")
    result = _manifold(solid).trim_by_plane(tuple(-normal), LARGER_M - offset)
    normals, offsets = np.vstack([solid.normals, normal]), np.append(solid.offsets, offset)
    return without_slivers(_polyhedron(result, normals, offsets, WORDS["cut"]), WORDS["cut"], solid)


def mirrored(solid: Polyhedron, point: ArrayLike, normal: ArrayLike) -> Polyhedron:
    """The mirror image of a solid in a plane; its faces are in the same order."""
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    heights = solid.vertices @ normal - normal @ np.asarray(point, dtype=float)
    faces = tuple(Face(face.outer[::-1], tuple(hole[::-1] for hole in face.holes)) for face in solid.faces)
    return Polyhedron(solid.vertices - 2.0 * heights[:, None] * normal, faces)


def prism_between(rings: list[NDArray], normal: NDArray, far_normal: NDArray, far_offset: float) -> Polyhedron:
    """A planar outline with holes, drawn out along its `normal` (3,), either way, as far as the plane `far_normal` · x = `far_offset` [m].

    `rings`: (n, 3) [m] each, the outline first. Raises BadInput when the plane lies along the normal or crosses the outline.
    """
    slope = float(far_normal @ normal)
    if abs(slope) < 0.05:
        raise BadInput("the plane to extrude to runs along the extrusion; choose one that lies across it.")
    heights = [(far_offset - ring @ far_normal) / slope for ring in rings]
    all_heights = np.concatenate(heights)
    if np.abs(all_heights).max() > FAR_M:
        raise BadInput(f"the extrusion would be {measured(float(np.abs(all_heights).max()), 'm')} long, the limit is {FAR_M * 1e3:.0f} mm.")
    if all_heights.min() < SLIVER_M and all_heights.max() > -SLIVER_M:
        if np.ptp(all_heights) < SLIVER_M:
            raise BadInput(f"the extrusion has no height; it must be at least {measured(SLIVER_M, 'm')} high.")
        raise BadInput("the plane to extrude to crosses the outline; all of the outline must lie on one side of it.")
    up = float(np.sign(all_heights[0]))
    tops = [ring + height[:, None] * normal for ring, height in zip(rings, heights, strict=True)]
    return _prism(rings, tops, up * normal)


def _prism(bottoms: list[NDArray], tops: list[NDArray], up: NDArray) -> Polyhedron:
    """The solid between two sets of rings, the second in the direction `up` of the first."""
    vertices = np.concatenate([*bottoms, *tops])
    half = sum(len(ring) for ring in bottoms)
    start, loops, sides = 0, [], []
    for number, ring in enumerate(bottoms):
        loop = tuple(range(start, start + len(ring)))
        left = float(np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0) @ up) > 0
        loop = loop if left == (number == 0) else loop[::-1]
        loops.append(loop)
        sides += [Face((a, b, half + b, half + a)) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]
        start += len(ring)
    top = Face(tuple(half + c for c in loops[0]), tuple(tuple(half + c for c in loop) for loop in loops[1:]))
    bottom = Face(loops[0][::-1], tuple(loop[::-1] for loop in loops[1:]))
    return sound(vertices, (top, bottom, *sides))


def _manifold(solid: Polyhedron) -> manifold3d.Manifold:
    made = manifold3d.Manifold(manifold3d.Mesh64(np.array(solid.vertices), np.array(solid.triangles, dtype=np.uint64)))
    if made.status() != manifold3d.Error.NoError or made.is_empty():
        raise BadInput("the surface of the solid is not closed; it cannot be cut or joined.")
    return made


def _made_flush(tool: Polyhedron, solid: Polyhedron) -> Polyhedron:
    """The tool with those of its faces that nearly lie in a plane of the solid put exactly into it, where its corners allow."""
    normals, offsets = np.array(tool.normals), np.array(tool.offsets)
    for f in range(len(tool.faces)):
        k, sign, off = nearest_plane(tool, f, solid.normals, solid.offsets)
        if off < FLUSH_M:
            normals[f], offsets[f] = sign * solid.normals[k], sign * solid.offsets[k]
    try:
        flush = Polyhedron(corners_on_planes(tool, normals, offsets), tool.faces)
    except BadInput:  # more than three faces meet at a corner: it stays as it was drawn
        return tool
    return flush if narrowest(tool)[0] > 4.0 * FLUSH_M else tool


def _larger(tool: Polyhedron) -> Polyhedron:
    """The tool with each face moved out by half a micrometre."""
    return Polyhedron(corners_on_planes(tool, tool.normals, tool.offsets + LARGER_M), tool.faces)


def _check_effect(solid: Polyhedron, tool: Polyhedron, how: str) -> None:
    """Raises BadInput when the two do not meet, nothing would be left, or nothing would change."""
    common, whole, added = common_volume(solid, tool), solid.volume_and_centroid[0], tool.volume_and_centroid[0]
    apart, all_of_it, inside = common < SAME_VOLUME_M3, whole - common < SAME_VOLUME_M3, added - common < SAME_VOLUME_M3
    if how == "join" and apart:
        gap = _manifold(solid).min_gap(_manifold(tool), FAR_M)
        if gap > FLUSH_M:
            raise BadInput(f"the two bodies do not touch, they are {measured(gap, 'm')} apart; a part is one body.")
    if how == "join" and inside:
        raise BadInput("the new body lies wholly inside the solid; nothing would change.")
    if how == "cut" and apart:
        raise BadInput("the cut does not touch the solid; nothing would change.")
    if how == "cut" and all_of_it:
        raise BadInput("the cut would leave nothing of the solid.")
    if how == "common" and apart:
        raise BadInput("the two bodies have nothing in common.")
    if how == "common" and all_of_it:
        raise BadInput("the solid lies wholly inside the other body; nothing would change.")


def _polyhedron(result: manifold3d.Manifold, normals: NDArray, offsets: NDArray, what: str) -> Polyhedron:
    """The solid of a boolean's mesh, its faces in the planes that they came from. Raises BadInput when it is not one sound body."""
    mesh = result.to_mesh64()
    vertices, triangles = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, dtype=np.int64)
    triangles = _one_body(vertices, triangles, what)
    vertices = onto_planes(vertices, triangles, normals, offsets, FOUND_M)
    triangles = standing_for(vertices)[triangles]
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    _, twice = unmatched_sides(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]))
    if len(twice):
        at = told_point(vertices[twice[0]].mean(axis=0))
        raise BadInput(f"{what} would leave bodies that only touch along an edge at {at}; let them overlap or keep them apart.")
    return checked(polyhedron_from_polygons(vertices, triangles.tolist()))


def _one_body(vertices: NDArray, triangles: NDArray, what: str) -> NDArray:
    """The triangles without specks. Raises BadInput when they bound several bodies, or one with a hollow."""
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    _, group = connected_components(coo_array((np.ones(len(sides)), sides.T), shape=(len(vertices),) * 2), directed=False)
    groups = group[triangles[:, 0]]
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    volumes = np.bincount(groups, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0, minlength=group.max() + 1)
    bodies = np.flatnonzero(volumes > SAME_VOLUME_M3)
    if len(bodies) > 1:
        told = " and ".join(f"{volume * 1e6:.3g} cm³" for volume in sorted(volumes[bodies])[::-1][:3])
        raise BadInput(f"{what} would leave {len(bodies)} separate bodies, of {told}; a part is one body.")
    if (volumes < -SAME_VOLUME_M3).any():
        raise BadInput(f"{what} would leave a hollow of {-volumes.min() * 1e6:.3g} cm³ inside the solid; a part is solid.")
    return triangles[np.isin(groups, bodies)]
