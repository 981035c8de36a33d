"""New bodies from what a person draws: a box from three clicks, a sketch drawn out to a height, a plane or the table."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, measured
from handey_studio.base.errors import unknown_name
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, rotation_about
from handey_studio.modeling.lookup import LookUpOptions, face_at
from handey_studio.modeling.operations import Box, Extrude, Sketch
from handey_studio.modeling.outline import sound_corners
from handey_studio.modeling.references import FaceAt
from handey_studio.modeling.solids import prism_between
from handey_studio.modeling.state import PlacedOutline, State

LEVEL_RAD = float(np.deg2rad(3.0))  # a face this near to level is level: a reading's noise tilts a small face by as much
LEAST_SIDE_M = 5e-4
IN_PLANE_M = 1e-5
UP = np.array([0.0, 0.0, 1.0])
THE_PLANE = LookUpOptions(most_turn=float(np.deg2rad(3.0)), reach=0.003)  # a plane to extrude to need not be one of the solid's


def box_body(box: Box) -> Polyhedron:
    """The body of three clicks. Raises BadInput with one sentence when they span nothing, or the face is not level above the table."""
    level = np.arccos(np.clip(box.normal[2], -1.0, 1.0)) < LEVEL_RAD
    normal = UP if level else box.normal
    middle = box.clicks.mean(axis=0)
    a, b, c = box.clicks - ((box.clicks - middle) @ normal)[:, None] * normal
    length = float(np.linalg.norm(b - a))
    if length < LEAST_SIDE_M:
        raise BadInput(f"the first two clicks of the box are {measured(length, 'm')} apart; they must be two corners of its face.")
    along = (b - a) / length
    across = np.cross(normal, along)
    width = float(across @ (c - a))
    if abs(width) < LEAST_SIDE_M:
        raise BadInput(f"the third click of the box is {measured(abs(width), 'm')} from its first side; click on the side across.")
    ring = np.array([a, b, b + width * across, a + width * across])
    if box.depth is not None:
        return prism_between([ring], normal, normal, float(normal @ a) - box.depth)
    if not level:
        lean = float(np.arccos(np.clip(box.normal[2], -1.0, 1.0)))
        raise BadInput(f"the face of the box leans by {measured(lean, 'rad')}; down to the table it must be level, else give its depth.")
    if a[2] < LEAST_SIDE_M:
        raise BadInput(f"the clicks of the box are {measured(float(a[2]), 'm')} above the table; its face must lie above the table.")
    return prism_between([ring], normal, UP, 0.0)


def placed(sketch: Sketch, solid: Polyhedron | None) -> PlacedOutline:
    """A sketch in its plane; one that is on a face is turned and shifted into the face's plane as it is now. Raises BadInput."""
    sound_corners(sketch.outline)
    T = sketch.T_model_plane
    if sketch.on is not None:
        if solid is None:
            raise BadInput(f'sketch "{sketch.name}" is on a face, but there is no solid.')
        f = face_at(solid, sketch.on)
        T = _in_plane(T, solid.normals[f], float(solid.offsets[f]))
    return PlacedOutline(sketch.name, T, sketch.outline)


def extruded_body(extrude: Extrude, state: State) -> Polyhedron:
    """The body of a sketch drawn out. Raises BadInput with one sentence."""
    outline = _sketch_called(extrude.sketch, state)
    rings = [_ring(outline)]
    T = outline.T_model_plane
    for name in extrude.holes:
        hole = _ring(_sketch_called(name, state))
        off = float(np.abs((hole - T[:3, 3]) @ T[:3, 2]).max())
        if name == extrude.sketch or off > IN_PLANE_M:
            raise BadInput(
                f'the hole "{name}" is {measured(off, "m")} off the plane of "{extrude.sketch}"; it must be drawn in that plane.'
            )
        rings.append(hole)
    normal, offset = _far_plane(extrude, T, state.solid)
    return prism_between(rings, T[:3, 2], normal, offset)


def _far_plane(extrude: Extrude, T_model_plane: NDArray, solid: Polyhedron | None) -> tuple[NDArray, float]:
    """Normal (3,) and offset [m] of the plane that an extrusion goes to."""
    if extrude.height is not None:
        normal = T_model_plane[:3, 2]
        return normal, float(normal @ T_model_plane[:3, 3]) + extrude.height
    if extrude.to is None:
        return UP, 0.0
    return plane_of(extrude.to, solid)


def plane_of(at: FaceAt, solid: Polyhedron | None) -> tuple[NDArray, float]:
    """Normal (3,) and offset [m] of the solid's face that a reference is on, else of the plane that it names itself."""
    if solid is not None:
        try:
            f = face_at(solid, at, THE_PLANE)
        except BadInput:  # a plane that was seen, but is not of the solid
            return at.normal, float(at.normal @ at.point)
        return solid.normals[f], float(solid.offsets[f])
    return at.normal, float(at.normal @ at.point)


def _sketch_called(name: str, state: State) -> PlacedOutline:
    known = {sketch.name: sketch for sketch in state.sketches}
    if name not in known:
        raise unknown_name("sketch", name, known)
    return known[name]


def _ring(sketch: PlacedOutline) -> NDArray:
    corners = sound_corners(sketch.outline)
    return apply(sketch.T_model_plane, np.c_[corners, np.zeros(len(corners))])


def _in_plane(T: NDArray, normal: NDArray, offset: float) -> NDArray:
    """A frame turned and shifted as little as needed for its z to be along ± `normal` and its origin in the plane."""
    normal = normal if normal @ T[:3, 2] > 0 else -normal
    offset = offset if normal @ T[:3, 2] > 0 else -offset
    turned = np.array(T)
    axis = np.cross(T[:3, 2], normal)
    angle = float(np.arctan2(np.linalg.norm(axis), T[:3, 2] @ normal))
    if angle > 1e-12:
        turned[:3, :3] = rotation_about(axis, angle) @ T[:3, :3]
    turned[:3, 3] += (offset - normal @ T[:3, 3]) * normal
    return turned
