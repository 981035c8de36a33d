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
from handey_studio.localization.posed import GRAZING, turned
from handey_studio.localization.shares import shared
from handey_studio.localization.verify import LEAST_POSES, STEEP
from handey_studio.sensing.drawing import draw, window
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
    R, t, counts = np.ascontiguousarray(R), np.ascontiguousarray(t), np.zeros((len(t), 5))
    surface = _surface(part)
    shared(lambda first, last: _tally(R, t, *surface, evidence, noise, (first, last), counts), len(t), LEAST_POSES)
    return Tally(*(counts.T * evidence.pixel**2))


@lru_cache(maxsize=64)
def _surface(part: Part) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Corners (n, 3) [m], triangles (k, 3), the face (k,) that each belongs to, and the faces' normals (m, 3)."""
    solid = part.solid
    owner = np.repeat(np.arange(len(solid.faces)), [len(solid.face_triangles(f)) for f in range(len(solid.faces))])
    return np.array(solid.vertices), np.array(solid.triangles), owner, np.array(solid.normals)


@njit(cache=True, nogil=True)
def _tally(R, t, vertices, triangles, owner, normals, evidence, noise, poses, out):
    for n in range(poses[0], poses[1]):
        corners = turned(R[n], vertices) + t[n]
        u0, v0, u1, v1 = window(corners, evidence.camera, evidence.depth.shape)
        depth, face = np.full((v1 - v0, u1 - u0), np.nan), np.full((v1 - v0, u1 - u0), -1, dtype=np.int32)
        draw(corners, triangles, owner, evidence.camera, u0, v0, depth, face)
        _count(depth, face, u0, v0, turned(R[n], normals), evidence.depth[v0:v1, u0:u1], evidence.camera, noise, out[n])


@njit(cache=True, error_model="numpy")
def _count(depth, face, u0, v0, normals, readings, camera, noise, out):
    """Adds the pixels whose neighbours all show the same face: at the others the sensor sees two surfaces in one."""
    for j in range(1, depth.shape[0] - 1):
        for i in range(1, depth.shape[1] - 1):
            f = face[j, i]
            if f < 0 or not _inside(face, j, i):
                continue
            z, scale = depth[j, i], 1.0 if camera[0] > 0.5 else depth[j, i]
            x, y = (i + u0 - camera[3]) / camera[1] * scale, (j + v0 - camera[4]) / camera[2] * scale
            rx, ry, rz = ray_at(x, y, z, camera)
            cosine = -(normals[f, 0] * rx + normals[f, 1] * ry + normals[f, 2] * rz)
            if cosine < GRAZING:
                continue
            behind = (readings[j, i] - z) / rz * cosine  # the reading, along the face's normal
            if np.isnan(behind):
                out[4] += cosine > STEEP
            elif behind < -NOISES * noise:
                out[2 if behind > -NEAR * NOISES * noise else 3] += 1.0
            else:
                out[0 if behind < NOISES * noise else 1] += 1.0


@njit(cache=True)
def _inside(face, j, i):
    """Whether a pixel's neighbours show the same face."""
    for a in range(j - 1, j + 2):
        for b in range(i - 1, i + 2):
            if face[a, b] != face[j, i]:
                return False
    return True
