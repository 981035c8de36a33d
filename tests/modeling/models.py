"""Drafts built as a hand would build them, and what must hold of any solid."""

from collections import Counter

import numpy as np
import trimesh

from handey_studio.geometry import Polyhedron
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.history import with_operation
from handey_studio.modeling.operations import Box, Extrude, Sketch
from handey_studio.modeling.outline import Outline
from handey_studio.modeling.replay import Built

UP = np.array([0.0, 0.0, 1.0])


def check_solid(solid: Polyhedron) -> None:
    """Closed, planar, without bodies apart, positive volume: by counting sides, by distances, and by trimesh."""
    sides = Counter((a, b) for face in solid.faces for loop in face.loops for a, b in zip(loop, loop[1:] + loop[:1], strict=True))
    assert all(count == 1 and sides[b, a] == 1 for (a, b), count in sides.items())
    for face, normal, offset in zip(solid.faces, solid.normals, solid.offsets, strict=True):
        corners = solid.vertices[[c for loop in face.loops for c in loop]]
        assert np.abs(corners @ normal - offset).max() < 3e-6
    mesh = trimesh.Trimesh(solid.vertices, solid.triangles, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1
    assert mesh.volume > 1e-12
    assert np.isclose(mesh.volume, solid.volume_and_centroid[0], rtol=1e-9)


def check_built(built: Built) -> None:
    if built.solid is not None:
        check_solid(built.solid)
        assert len(built.sources) == len(built.makers) == len(built.solid.faces)
    else:
        assert built.sources == built.makers == ()
    assert all(step.reason is None or (step.reason.endswith(".") and len(step.reason) < 400) for step in built.steps)


def top_plane(z: float) -> np.ndarray:
    T = np.eye(4)
    T[2, 3] = z
    return T


def box_draft(size=(0.1, 0.06, 0.04)) -> Draft:
    """A box with a corner at the origin."""
    x, y, z = size
    return with_operation(Draft("box"), Box(np.array([[0, 0, z], [x, 0, z], [x / 2, y, z]]), UP))


def l_draft() -> Draft:
    """An L lying on its side: 100 × 60 mm, 40 mm high, 70 mm over one half."""
    draft = box_draft()
    outline = Outline(np.array([[0, 0], [0.05, 0], [0.05, 0.06], [0, 0.06]]))
    draft = with_operation(draft, Sketch("step", top_plane(0.04), outline))
    return with_operation(draft, Extrude("step", 0.03))
