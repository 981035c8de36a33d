"""Several views of an object come together by the planes that they share, or by points that were picked; the rest is least squares."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput, Entry, Ledger
from handey_studio.geometry.transforms import apply, inverse, pose_difference, transform
from handey_studio.modeling.aligning.open import open_share, readings_of, seen_by
from handey_studio.modeling.aligning.planes import independent, pairings, pairs_at
from handey_studio.modeling.patches.finding import patches_of
from handey_studio.modeling.patches.patch import Patches
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting.clues import CERTAIN_M, Body
from handey_studio.modeling.suggesting.planes import BodyPlane, body_planes
from handey_studio.modeling.suggesting.suggest import SuggestOptions, members_of
from handey_studio.modeling.suggesting.suggestion import Alignment

ITERATIONS = 6
LEAST_SPREAD_M = 0.005  # of picked points across their longest line
SAME_POSE_M, SAME_POSE_RAD = 0.004, np.deg2rad(3.0)

Pairs = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class AlignOptions:
    """Poses are compared by the worth of the planes that they bring together, less `open_cost` times the share of the readings that would
    then hang in the open; with more than `most_open` of them a pose falls. One that reaches `rival` of the best one's value is told
    too: nothing that was read speaks against it."""

    open_cost: float = 1.5
    most_open: float = 0.06
    rival: float = 0.5


class Shared(NamedTuple):
    """The planes of the object in the model's scans and in the new one, and points (n, 3) [m] in the new scan's world on each of these."""

    model: tuple[BodyPlane, ...]
    new: tuple[BodyPlane, ...]
    points: tuple[NDArray, ...]


class Fitted(NamedTuple):
    """A refined pose, the planes (model, new) that it brings together, how much of the readings hangs in the open, and its value."""

    T: NDArray
    pairs: Pairs
    open: float
    value: float


def align(
    scans: Sequence[Scan],
    Ts_model_scan: Sequence[NDArray],
    new: Scan,
    patches: Sequence[Patches] | None = None,
    new_patches: Patches | None = None,
    objects: tuple[int, int] = (0, 0),
    picked: Sequence[tuple[NDArray, NDArray]] = (),
    options: AlignOptions = AlignOptions(),
) -> Alignment:
    """How a new scan of an object lies in the model frame of `scans`, which `Ts_model_scan` (4, 4) place.

    `objects`: which object of the first scan and of the new one, by number in `Patches.objects`. The object may lie otherwise in the new
    scan: its faces, and what it stands on, are compared. With `picked` pairs of points (3,) [m], in the model frame and in the new scan's
    world, at least three, only the pose that these tell is refined. Raises BadInput for fewer pairs, or for pairs on a line.
    """
    found = [patches_of(scan) for scan in scans] if patches is None else list(patches)
    mine = patches_of(new) if new_patches is None else new_patches
    if not found[0].objects or not mine.objects:
        return _none("one of the scans shows no planar face")
    model = Body(found, Ts_model_scan, members_of(found, Ts_model_scan, 0, objects[0], SuggestOptions()))
    other = Body([mine], [np.eye(4)], members_of([mine], [np.eye(4)], 0, objects[1], SuggestOptions()))
    planes = body_planes(other)[0]
    shared = Shared(body_planes(model)[0], planes, tuple(_points_on(plane, other, new) for plane in planes))
    first = [_pose_of(picked)] if picked else [pairing.T for pairing in pairings(shared.model, shared.new)]
    if not first:
        return _none("the scans share planes in fewer than three independent directions; pick three points in both")
    theirs = [(seen_by(scans[k], found[k], numbers), model.Ts_model_scan[k]) for k, numbers in model.members]
    own = seen_by(new, mine, other.members[0][1])
    fits = []
    for start in first:
        T, pairs = _refined(start, shared)
        hanging = max(open_share(seen, inverse(T_model_scan) @ T, own) for seen, T_model_scan in theirs)
        worth = sum(min(shared.model[a].size, shared.new[b].size) for a, b in pairs)
        fits.append(Fitted(T, pairs, hanging, worth * (1.0 - options.open_cost * hanging)))
    return _ranked(fits, shared, options, bool(picked))


def _none(reason: str, entries: tuple[Entry, ...] = ()) -> Alignment:
    return Alignment(None, (), 0.0, (), entries, reason)


def _pose_of(picked: Sequence[tuple[NDArray, NDArray]]) -> NDArray:
    """The rigid motion (4, 4) that brings the second points of the pairs onto the first, by least squares."""
    if len(picked) < 3:
        raise BadInput(f"{len(picked)} pairs of points were picked; a pose takes at least 3.")
    target, start = (np.array([pair[k] for pair in picked], dtype=float) for k in (0, 1))
    across, along = target - target.mean(axis=0), start - start.mean(axis=0)
    if min(np.linalg.svd(points, compute_uv=False)[1] for points in (across, along)) < LEAST_SPREAD_M:
        raise BadInput(f"the picked points lie within {1e3 * LEAST_SPREAD_M:g} mm of a line; pick three that span a triangle.")
    R = Rotation.align_vectors(across, along)[0].as_matrix()
    return transform(R, target.mean(axis=0) - R @ start.mean(axis=0))


def _points_on(plane: BodyPlane, body: Body, scan: Scan) -> NDArray:
    """Points (n, 3) [m] of the scan's world that tell of a plane: readings of its patches; where the object stands, the corners of what is
    seen of it, straight onto the plane; the ends of the sides that end there."""
    patches, points = body.patches[0], []
    for _, number in plane.of:
        if number >= 0 and plane.kind == "seen":
            points.append(readings_of(scan, patches, number))
        else:
            corners = np.concatenate([patches.patches[k].rings[0] for k in body.members[0][1]])
            points.append(corners - ((corners @ plane.normal) - plane.offset)[:, None] * plane.normal)
    for _, number, r, s in () if points else plane.sides:
        ring = patches.patches[number].rings[r]
        points.append(ring[[s, (s + 1) % len(ring)]])
    return np.concatenate(points)


def _refined(T: NDArray, shared: Shared) -> tuple[NDArray, Pairs]:
    """The pose after point-to-plane least squares over the planes that lie together, and these (model, new)."""
    pairs = pairs_at(T, shared.model, shared.new)
    for _ in range(ITERATIONS):
        if independent(pairs, shared.model) < 3:
            break
        rows, values = [], []
        faces = [(a, b) for a, b in pairs if "rim" not in (shared.model[a].kind, shared.new[b].kind)]
        turned = independent(faces, shared.model) > 1  # then faces tell how it is turned, and rims only where it is
        for a, b in pairs:
            points, plane = apply(T, shared.points[b]), shared.model[a]
            if turned and (a, b) not in faces:
                points = points.mean(axis=0, keepdims=True)
            sigma = float(np.hypot(plane.sigma, shared.new[b].sigma)) + CERTAIN_M
            weight = float(np.sqrt(max(shared.new[b].size, CERTAIN_M) / len(points))) / sigma
            lever = np.cross(points, plane.normal) * (len(points) > 1)
            rows.append(weight * np.concatenate([lever, np.tile(plane.normal, (len(points), 1))], axis=1))
            values.append(weight * (plane.offset - points @ plane.normal))
        step = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
        T = transform(Rotation.from_rotvec(step[:3]).as_matrix(), step[3:]) @ T
        pairs = pairs_at(T, shared.model, shared.new)
        if np.abs(step).max() < 1e-6:
            break
    return T, pairs


def _ranked(fits: Sequence[Fitted], shared: Shared, options: AlignOptions, picked: bool) -> Alignment:
    """The best pose, with those that are hardly worse, and all that were tried."""
    ledger, good = Ledger(), list[Fitted]()
    for fit in sorted(fits, key=lambda fit: -fit.value):
        option, directions = f"pose with {len(fit.pairs)} shared planes", independent(fit.pairs, shared.model)
        if any(_same_pose(fit.T, better.T) for better in good):
            continue
        if directions < 3 and not picked:
            ledger.add("align", option, "fewer than three independent directions", value=float(directions), limit=3.0)
        elif fit.open > options.most_open and not picked:
            ledger.add("align", option, "readings would hang in the open", value=fit.open, limit=options.most_open, unit="share")
        else:
            ledger.add("align", option, value=fit.value, unit="m")
            good.append(fit)
    if not good:
        return _none("no pose brings the scans' planes together without readings hanging in the open", ledger.entries)
    residuals, rms = _residuals(good[0], shared)
    others = tuple((fit.T, _residuals(fit, shared)[1]) for fit in good[1:] if fit.value > options.rival * good[0].value)
    return Alignment(good[0].T, residuals, rms, others, ledger.entries)


def _same_pose(T: NDArray, other: NDArray) -> bool:
    moved, turned = pose_difference(T, other)
    return moved < SAME_POSE_M and turned < SAME_POSE_RAD


def _residuals(fit: Fitted, shared: Shared) -> tuple[tuple[tuple[tuple[int, int], int, float], ...], float]:
    """The rms [m] of each shared plane's points at a pose, and over all of them; -1 stands for a support."""
    told, squares, count = [], 0.0, 0
    for a, b in fit.pairs:
        model, new = shared.model[a], shared.new[b]
        off = apply(fit.T, shared.points[b]) @ model.normal - model.offset
        told.append((_named(model), _named(new)[1], float(np.sqrt(np.mean(off**2)))))
        squares, count = squares + float((off**2).sum()), count + len(off)
    return tuple(told), float(np.sqrt(squares / max(count, 1)))


def _named(plane: BodyPlane) -> tuple[int, int]:
    """The (scan, patch) that a plane is of, or that ends there."""
    return plane.of[0] if plane.of else plane.sides[0][:2]
