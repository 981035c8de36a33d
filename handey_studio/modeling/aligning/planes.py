"""Which planes of two scans of an object are the same: rotations from pairs of planes, then shifts that bring most of them together."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply, transform
from handey_studio.modeling.suggesting.planes import BodyPlane

ALIKE_RAD = np.deg2rad(4.0)  # angles and normals that may be the same
LEAST_ANGLE_RAD = np.deg2rad(20.0)  # between two planes that give a rotation
SAME_SIGMAS, LEAST_SAME_M = 4.0, 0.0015  # offsets that may be the same, before refinement
KEPT_SHIFTS, KEPT_POSES = 4, 40
WORTH = {"seen": 1.0, "support": 1.0, "rim": 0.4}  # of a plane's size
LEAST_SUPPORT_M = 0.03  # the size that a plane without one, a support, counts with


class Pairing(NamedTuple):
    """A first pose `T` (4, 4) of the new scan in the model frame, the planes (model, new) that lie together then, and their `worth` [m]."""

    T: NDArray
    pairs: tuple[tuple[int, int], ...]
    worth: float


def pairings(model: Sequence[BodyPlane], new: Sequence[BodyPlane]) -> list[Pairing]:
    """The poses that bring most planes together, the best first; only those that three independent directions fix."""
    found: list[Pairing] = []
    for R in _rotations(model, new):
        for shift in _shifts(R, model, new):
            T = transform(R, shift)
            pairs = pairs_at(T, model, new)
            found.append(Pairing(T, pairs, _worth_of(pairs, model, new)))
    found.sort(key=lambda pairing: -pairing.worth)
    return found[:KEPT_POSES]


def pairs_at(T: NDArray, model: Sequence[BodyPlane], new: Sequence[BodyPlane]) -> tuple[tuple[int, int], ...]:
    """The planes (model, new) that lie together at a pose, each new one with the nearest."""
    pairs = []
    for b, plane in enumerate(new):
        normal, middle = T[:3, :3] @ plane.normal, apply(T, plane.middle)
        apart = [abs(float(other.normal @ middle) - other.offset) for other in model]
        near = [
            (apart[a], a) for a, other in enumerate(model) if normal @ other.normal > np.cos(ALIKE_RAD) and apart[a] < _limit(plane, other)
        ]
        if near:
            pairs.append((min(near)[1], b))
    return tuple(pairs)


def independent(pairs: Sequence[tuple[int, int]], model: Sequence[BodyPlane]) -> int:
    """How many independent directions the paired planes have."""
    if not pairs:
        return 0
    normals = np.array([model[a].normal for a, _ in pairs])
    return int((np.linalg.svd(normals, compute_uv=False) > 0.3).sum())


def _limit(plane: BodyPlane, other: BodyPlane) -> float:
    """How far apart [m] two planes may be and still be one."""
    return max(LEAST_SAME_M, SAME_SIGMAS * float(np.hypot(plane.sigma, other.sigma)))


def _size(plane: BodyPlane) -> float:
    return WORTH[plane.kind] * max(plane.size, LEAST_SUPPORT_M)


def _worth_of(pairs: Sequence[tuple[int, int]], model: Sequence[BodyPlane], new: Sequence[BodyPlane]) -> float:
    return float(sum(min(_size(model[a]), _size(new[b])) for a, b in pairs))


def _rotations(model: Sequence[BodyPlane], new: Sequence[BodyPlane]) -> Iterator[NDArray]:
    """Rotations (3, 3) that take two planes' normals of the new scan to two of the model's, each once."""
    seen: list[NDArray] = []
    frames_model = _frames(model)
    for _, angle, frame in _frames(new):
        for _, other, target in frames_model:
            if abs(angle - other) < ALIKE_RAD:
                R = target @ frame.T
                if not seen or np.einsum("kij,ij->k", np.array(seen), R).max() < 1.0 + 2.0 * np.cos(ALIKE_RAD):
                    seen.append(R)
                    yield R


def _frames(planes: Sequence[BodyPlane]) -> list[tuple[float, float, NDArray]]:
    """Ordered pairs of planes as worth, angle between their normals and a frame (3, 3), the most worth first."""
    out = []
    for a, one in enumerate(planes):
        for b, two in enumerate(planes):
            angle = float(np.arccos(np.clip(one.normal @ two.normal, -1.0, 1.0)))
            if a != b and LEAST_ANGLE_RAD < angle < np.pi - LEAST_ANGLE_RAD:
                z = np.cross(one.normal, two.normal)
                z /= np.linalg.norm(z)
                out.append((_size(one) * _size(two), angle, np.stack([one.normal, np.cross(z, one.normal), z], axis=1)))
    out.sort(key=lambda frame: -frame[0])
    return out


def _shifts(R: NDArray, model: Sequence[BodyPlane], new: Sequence[BodyPlane]) -> Iterator[NDArray]:
    """Shifts (3,) that bring planes together, from pairs with three independent normals; along each the ones with most worth."""
    normals = [R @ plane.normal for plane in new]
    single = [(a, b) for b in range(len(new)) for a in range(len(model)) if normals[b] @ model[a].normal > np.cos(ALIKE_RAD)]
    axes: list[NDArray] = []
    for a, _ in sorted(single, key=lambda pair: -_worth_of([pair], model, new)):
        if np.linalg.matrix_rank(np.array([*axes, model[a].normal]), tol=0.3) == len(axes) + 1:
            axes.append(model[a].normal)
    if len(axes) < 3:
        return
    choices = [_along(axis, R, single, model, new) for axis in axes]
    for x in choices[0]:
        for y in choices[1]:
            for z in choices[2]:
                yield np.linalg.solve(np.array(axes), [x, y, z])


def _along(
    axis: NDArray, R: NDArray, single: Sequence[tuple[int, int]], model: Sequence[BodyPlane], new: Sequence[BodyPlane]
) -> list[float]:
    """The shifts [m] along an axis that bring most planes square to it together."""
    votes = []
    for a, b in single:
        cosine = float(model[a].normal @ axis)
        if abs(cosine) > np.cos(ALIKE_RAD):
            shift = (model[a].offset - float(model[a].normal @ R @ new[b].middle)) * np.sign(cosine)
            votes.append((shift, _worth_of([(a, b)], model, new), _limit(new[b], model[a])))
    ranked = sorted(votes, key=lambda vote: -sum(worth for shift, worth, limit in votes if abs(shift - vote[0]) < max(limit, vote[2])))
    kept: list[float] = []
    for shift, _, limit in ranked:
        if all(abs(shift - other) > limit for other in kept):
            kept.append(float(shift))
    return kept[:KEPT_SHIFTS]
