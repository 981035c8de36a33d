"""A face pushed or pulled through what would break its outline: the space that it sweeps is added or taken away.

Where all neighbours of a face are at right angles to it, that is the same as moving its plane, and goes on where edges end: the low side
of a step grows past the high one.
"""

import numpy as np

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.planes import Change, inherited
from handey_studio.modeling.solids import combined, common_volume, prism_between

UPRIGHT = 1e-7  # the sine of how far a neighbour may lean for its plane to be that of the swept space's side
SAME_SHARE = 1e-6


def swept_face(solid: Polyhedron, f: int, distance: float) -> Change:
    """The solid with the space that face f sweeps on its way along its normal, `distance` [m], added when positive, else taken away.

    Raises BadInput when a neighbour leans, or the face would meet the solid on its way out or leave it on its way in.
    """
    neighbours = [e.right if e.left == f else e.left for e in solid.edges if f in (e.left, e.right)]
    if np.abs(solid.normals[neighbours] @ solid.normals[f]).max() > UPRIGHT:
        raise BadInput("a neighbour of the face leans; its plane would have to move too.")
    rings = [solid.vertices[list(loop)] for loop in solid.faces[f].loops]
    body = prism_between(rings, solid.normals[f], solid.normals[f], float(solid.offsets[f]) + distance)
    volume = body.volume_and_centroid[0]
    if abs(common_volume(solid, body) - (0.0 if distance > 0 else volume)) > SAME_SHARE * volume:
        raise BadInput("the face would meet another side of the solid on its way.")
    changed = combined(solid, body, "join" if distance > 0 else "cut")
    sides = list(dict.fromkeys(neighbours))
    labels = [_side_of(solid, body, b, sides, f) for b in range(len(body.faces))]
    return Change(changed, inherited(changed, [(body, labels), (solid, range(len(solid.faces)))], f))


def _side_of(solid: Polyhedron, body: Polyhedron, b: int, neighbours: list[int], f: int) -> int:
    """The neighbour of face f in whose plane a side of the swept body lies; its ends are face f itself."""
    turned = np.abs(solid.normals[neighbours] @ body.normals[b])
    off = np.abs(body.vertices[body.faces[b].outer[0]] @ solid.normals[neighbours].T - solid.offsets[neighbours])
    best = int(np.argmin(off + (1.0 - turned)))
    return f if abs(body.normals[b] @ solid.normals[f]) > 0.5 else neighbours[best]
