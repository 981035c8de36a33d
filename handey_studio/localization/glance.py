"""A glance at poses straight from edges: a few points of the faces in sight rule out nearly all that are wrong."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.evidence import Evidence, Limits
from handey_studio.localization.posed import GRAZING, ON, THROUGH, facing, placed, reading_at, turned
from handey_studio.localization.samples import PartSamples
from handey_studio.localization.shares import shared

GLANCE, MOST_GLANCES = 12, 200  # points of faces in sight that the first look asks for, and how many points it tries to get them
MAX_THROUGH = 0.3
LEAST_POSES = 100  # that are worth a share


def unopposed(R: NDArray, t: NDArray, samples: PartSamples, evidence: Evidence, limits: Limits) -> NDArray:
    """Numbers of the poses R (n, 3, 3), t (n, 3) that a glance does not rule out: the sensor sees through less than `MAX_THROUGH` of
    the few points of the faces that it looks at."""
    R, t, good = np.ascontiguousarray(R), np.ascontiguousarray(t), np.zeros(len(t), dtype=np.bool_)
    shared(lambda first, last: _unopposed(R, t, samples, evidence, limits, (first, last), good), len(t), LEAST_POSES)
    return np.nonzero(good)[0]


@njit(cache=True, nogil=True, error_model="numpy")
def _unopposed(R, t, samples, evidence, limits, poses, good):
    points, faces, rims, depth, camera = samples.face_point, samples.face, samples.face_rim, evidence.depth, evidence.camera
    stride = spreading(len(faces))
    for n in range(poses[0], poses[1]):
        normals = turned(R[n], samples.normal)
        met, on, through = False, 0, 0
        k = n % len(faces)
        for _ in range(min(len(faces), MOST_GLANCES)):
            k = (k + stride) % len(faces)
            face = faces[k]
            x, y, z = placed(R[n], t[n], points, k)
            cosine = facing(normals[face, 0], normals[face, 1], normals[face, 2], x, y, z, camera)
            if cosine < GRAZING:
                continue
            seen, _ = reading_at(x, y, z, depth, camera, limits)
            met = met or seen == ON
            if rims[k] * cosine < limits.edge:
                continue  # the margin that sensors lose at silhouettes, which may be all of a narrow face
            on, through = on + (seen == ON), through + (seen == THROUGH)
            if on + through == GLANCE or through > MAX_THROUGH * GLANCE:
                break
        good[n] = met and through <= MAX_THROUGH * (on + through)


@njit(cache=True)
def spreading(count):
    """A step by which one comes to every one of `count` numbers, and to far ones first."""
    step = max(1, int(0.618 * count))
    while np.gcd(step, count) > 1:
        step += 1
    return step
