"""The second look: a refined pose is drawn into the view, and every reading inside its faces compared with them.

The first verification forgives what outlines leave uncertain, as rough poses must be forgiven. Once refined, a pose that is right
leaves readings nothing but their own noise, and a look-alike that is a millimetre too small, or has its step elsewhere, does not.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.evidence import Evidence, ray_at
from handey_studio.localization.render import draw, window
from handey_studio.localization.verify import GRAZING, STEEP, _dot
from handey_studio.world.part import Part

NOISES = 3.5  # of a reading, within which it lies on a face
NEAR = 3.0  # as many times as far before a face it is another body's reading, that hides it


class Tally(NamedTuple):
    """What the readings inside the faces of poses (n,) say, as areas [m²] in the view: `on` a face, seen `through` it, a little
    `before` it, which no other body explains, `hidden` behind nearer readings, and `unread`."""

    on: NDArray
    through: NDArray
    before: NDArray
    hidden: NDArray
    unread: NDArray

    def rows(self, chosen: NDArray) -> "Tally":
        """Those of some of the poses, by their numbers."""
        return Tally(*(array[chosen] for array in self))


def second_look(part: Part, R: NDArray, t: NDArray, evidence: Evidence, noise: float) -> Tally:
    """Tallies of the poses R (n, 3, 3), t (n, 3) of a part in the sensor's frame, before a sensor of `noise` [m]."""
    counts = _tally(np.ascontiguousarray(R), np.ascontiguousarray(t), *_surface(part), evidence, noise)
    return Tally(*(counts.T * evidence.pixel**2))


@lru_cache(maxsize=64)
def _surface(part: Part) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Corners (n, 3) [m], triangles (k, 3), the face (k,) that each belongs to, and the faces' normals (m, 3)."""
    solid = part.solid
    owner = np.repeat(np.arange(len(solid.faces)), [len(solid.face_triangles(f)) for f in range(len(solid.faces))])
    return np.array(solid.vertices), np.array(solid.triangles), owner, np.array(solid.normals)


@njit(cache=True)
def _tally(R, t, vertices, triangles, owner, normals, evidence, noise):
    out = np.zeros((len(t), 5))
    corners = np.empty_like(vertices)
    for n in range(len(t)):
        for k in range(len(vertices)):
            for r in range(3):
                corners[k, r] = _dot(R[n], r, vertices[k]) + t[n, r]
        u0, v0, u1, v1 = window(corners, evidence.camera, evidence.depth.shape)
        depth, drawn = np.full((v1 - v0, u1 - u0), np.nan), np.full((v1 - v0, u1 - u0), -1)
        draw(corners, triangles, evidence.camera, u0, v0, depth, drawn)
        _count(R[n], depth, drawn, u0, v0, owner, normals, evidence, noise, out[n])
    return out


@njit(cache=True)
def _count(R, depth, drawn, u0, v0, owner, normals, evidence, noise, out):
    """Adds the pixels whose neighbours all show the same face: at the others the sensor sees two surfaces in one."""
    camera = evidence.camera
    for j in range(1, depth.shape[0] - 1):
        for i in range(1, depth.shape[1] - 1):
            if drawn[j, i] < 0 or not _inside(drawn, owner, j, i):
                continue
            z, scale = depth[j, i], 1.0 if camera[0] > 0.5 else depth[j, i]
            x, y = (i + u0 - camera[3]) / camera[1] * scale, (j + v0 - camera[4]) / camera[2] * scale
            rx, ry, rz = ray_at(x, y, z, camera)
            normal = normals[owner[drawn[j, i]]]
            cosine = -(_dot(R, 0, normal) * rx + _dot(R, 1, normal) * ry + _dot(R, 2, normal) * rz)
            if cosine < GRAZING:
                continue
            behind = (evidence.depth[j + v0, i + u0] - z) / rz * cosine  # the reading, along the face's normal
            if np.isnan(behind):
                out[4] += cosine > STEEP
            elif behind < -NOISES * noise:
                out[2 if behind > -NEAR * NOISES * noise else 3] += 1.0
            else:
                out[0 if behind < NOISES * noise else 1] += 1.0


@njit(cache=True)
def _inside(drawn, owner, j, i):
    """Whether a pixel's neighbours show the same face."""
    face = owner[drawn[j, i]]
    for a in range(j - 1, j + 2):
        for b in range(i - 1, i + 2):
            if drawn[a, b] < 0 or owner[drawn[a, b]] != face:
                return False
    return True
