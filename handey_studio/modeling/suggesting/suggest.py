"""The whole closed solid that an object most likely is: candidates from its planes, held against every reading, the best one wins."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Entry, Ledger
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.modeling.patches.finding import patch_at, patches_of
from handey_studio.modeling.patches.patch import Patches
from handey_studio.modeling.patches.sides import lost_at_rims
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting.candidates import shapes_of
from handey_studio.modeling.suggesting.clues import Body
from handey_studio.modeling.suggesting.fit import Fit, Rays, fit_of, rays_of
from handey_studio.modeling.suggesting.planes import BodyPlane, body_planes
from handey_studio.modeling.suggesting.shapes import Shape
from handey_studio.modeling.suggesting.squares import Squared
from handey_studio.modeling.suggesting.suggestion import Relation, Suggestion

SAME_PLANE_M, SAME_PLANE_COSINE = 0.0006, np.cos(np.deg2rad(0.5))  # a face of the solid and the plane that it was made from
SHORT_LOSSES = 4.0  # sides of outlines shorter than so many times what is lost at rims are raggedness
SQUARE_COSINE = np.cos(np.deg2rad(0.1))  # a face along the object's own directions
MARGIN_M = 0.02  # around an object's readings rays are held against a candidate


@dataclass(frozen=True)
class SuggestOptions:
    """`least_explained`: the share of the object's readings that a solid must explain; `most_through`: the share of the rays to it that may
    be seen to pass; `through_cost` and `face_cost` what these, and each face, twice for one out of square, take off the share explained
    when candidates are compared;
    `least_share` of the largest patch's readings makes a patch count."""

    least_explained: float = 0.85
    most_through: float = 0.06
    through_cost: float = 2.0
    face_cost: float = 0.01
    least_share: float = 0.04


def suggest(
    scans: Sequence[Scan],
    Ts_model_scan: Sequence[NDArray] | None = None,
    at: tuple[int, float, float] | None = None,
    patches: Sequence[Patches] | None = None,
    options: SuggestOptions = SuggestOptions(),
) -> Suggestion:
    """The closed solid of one object, in the model frame.

    `Ts_model_scan` (4, 4) place the scans (identities when None); `at` (scan, u, v) [px] picks the object, else the largest of the first
    scan is taken; `patches` of the scans where they are known already. Never raises: without a solid the suggestion's `reason` tells why.
    """
    patches = [patches_of(scan) for scan in scans] if patches is None else patches
    Ts = [np.eye(4)] * len(scans) if Ts_model_scan is None else list(Ts_model_scan)
    scan, u, v = at if at is not None else (0, 0.0, 0.0)
    if at is None:
        picked = 0 if patches[0].objects else None
    else:
        patch = patch_at(patches[scan], u, v)
        picked = None if patch is None else patch.object
    if picked is None:
        return _none("nothing with a planar face stands above the support" + ("" if at is None else f" at {u:.0f}, {v:.0f} px"))
    return suggest_object(scans, Ts, patches, scan, picked, options)


def suggest_object(
    scans: Sequence[Scan],
    Ts: Sequence[NDArray],
    patches: Sequence[Patches],
    scan: int,
    number: int,
    options: SuggestOptions = SuggestOptions(),
) -> Suggestion:
    """The suggestion for object `number` of scan `scan`, with what the other scans show of it."""
    body = Body(patches, Ts, members_of(patches, Ts, scan, number, options))
    planes, clues, frame, squares = body_planes(body)
    short = SHORT_LOSSES * max(lost_at_rims(scans[k].view) for k, _ in body.members)
    views = _views(scans, body)
    ledger, best = Ledger(), None
    for shape in shapes_of(body, clues, planes, frame, short):
        fit = None if shape.solid is None else fit_of(shape.solid, views)
        value = _judged(ledger, shape, fit, frame, options)
        if shape.solid is not None and fit is not None and value is not None and (best is None or value > best[0]):
            best = (value, shape.solid, fit, shape.by)
    if best is None:
        return _none(_why(ledger.entries), ledger.entries, tuple(body.of_all()))
    _, solid, fit, by = best
    sources = tuple(_source(solid, f, planes, body, by) for f in range(len(solid.faces)))
    relations = _relations(solid, planes, squares)
    return Suggestion(solid, sources, relations, ledger.entries, fit.rms, fit.explained, tuple(body.of_all()))


def _none(reason: str, entries: tuple[Entry, ...] = (), of: tuple[tuple[int, int], ...] = ()) -> Suggestion:
    return Suggestion(None, (), (), entries, 0.0, 0.0, of, reason)


def members_of(
    patches: Sequence[Patches], Ts: Sequence[NDArray], scan: int, number: int, options: SuggestOptions
) -> list[tuple[int, tuple[int, ...]]]:
    """The patches of the object in each scan: of the other scans the object that lies most where it does."""
    chosen = [(scan, _large(patches[scan], patches[scan].objects[number], options))]
    corners = np.concatenate([apply(Ts[scan], ring) for k in chosen[0][1] for ring in patches[scan].patches[k].rings[:1]])
    corners = np.concatenate([corners, apply(Ts[scan], apply(inverse(Ts[scan]), corners) * (1.0, 1.0, 0.0))])
    low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
    for other in range(len(patches)):
        if other == scan:
            continue
        shares = [_inside(patches[other], group, Ts[other], low, high) for group in patches[other].objects]
        if shares and max(shares) > 0:
            chosen.append((other, _large(patches[other], patches[other].objects[int(np.argmax(shares))], options)))
    return sorted(chosen)


def _large(patches: Patches, group: tuple[int, ...], options: SuggestOptions) -> tuple[int, ...]:
    most = max(patches.patches[k].readings for k in group)
    return tuple(k for k in group if patches.patches[k].readings >= options.least_share * most)


def _inside(patches: Patches, group: tuple[int, ...], T: NDArray, low: NDArray, high: NDArray) -> float:
    """How many readings of an object belong to patches that lie in a box, by their middles."""
    found = 0.0
    for k in group:
        middle = apply(T, patches.patches[k].rings[0].mean(axis=0))
        found += patches.patches[k].readings * bool((middle > low).all() and (middle < high).all())
    return found


def _views(scans: Sequence[Scan], body: Body) -> list[Rays]:
    views = []
    for k, numbers in body.members:
        rings = [apply(body.Ts_model_scan[k], ring) for n in numbers for ring in body.patches[k].patches[n].rings[:1]]
        corners = np.concatenate(rings)
        around = np.concatenate([corners - MARGIN_M, corners + MARGIN_M, corners * (1.0, 1.0, 0.0)])
        views.append(rays_of(scans[k], body.Ts_model_scan[k], np.isin(body.patches[k].labels, numbers), around))
    return views


def _judged(ledger: Ledger, shape: Shape, fit: Fit | None, frame: NDArray, options: SuggestOptions) -> float | None:
    """Writes the candidate down; how good it is, None if it fell."""
    if fit is None:
        ledger.add("suggest", shape.option, shape.reason, value=shape.value, limit=shape.limit, unit=shape.unit)
        return None
    shares = (
        (options.least_explained - fit.explained, "too few of the object's readings lie on it", fit.explained, options.least_explained),
        (fit.through - options.most_through, "the sensor saw through it", fit.through, options.most_through),
    )
    for excess, reason, value, limit in shares:
        if excess > 0:
            ledger.add("suggest", shape.option, reason, value=value, limit=limit, unit="share")
            return None
    odd = 0 if shape.solid is None else int((np.abs(shape.solid.normals @ frame.T).max(axis=1) < SQUARE_COSINE).sum())
    faces = 0 if shape.solid is None else len(shape.solid.faces)
    value = fit.explained - options.through_cost * fit.through - options.face_cost * (faces + odd)
    ledger.add("suggest", shape.option, value=value, unit="share")
    return value


def _why(entries: tuple[Entry, ...]) -> str:
    """The reason of the candidate that came nearest."""
    held = [entry for entry in entries if entry.unit == "share"]
    if held:
        best = max(held, key=lambda entry: (entry.reason != "the sensor saw through it", entry.value or 0.0))
        return f"no closed solid explains what is seen; nearest came the {best.option}: {best.reason}"
    return f"no closed solid can be made: {entries[0].option}: {entries[0].reason}" if entries else "nothing was tried"


def _match(solid: Polyhedron, f: int, planes: Sequence[BodyPlane]) -> BodyPlane | None:
    for plane in planes:
        if plane.normal @ solid.normals[f] > SAME_PLANE_COSINE and abs(plane.offset - solid.offsets[f]) < SAME_PLANE_M:
            return plane
    return None


def _source(solid: Polyhedron, f: int, planes: Sequence[BodyPlane], body: Body, by: str) -> str:
    """What a face rests on; what nothing shows is assumed `by`, "hidden" or "symmetric"."""
    plane = _match(solid, f, planes)
    if plane is not None:
        seen = [scan for scan, patch in plane.of if patch >= 0 and (scan, patch) in body.of_all()]
        if plane.kind == "seen" and seen:
            return f"seen in scan {min(seen) + 1}"
        if plane.kind == "support":
            return "assumed: support"
    elif by == "symmetric":
        return "assumed: symmetric"
    parallel = any(other.kind == "seen" and abs(other.normal @ solid.normals[f]) > SAME_PLANE_COSINE for other in planes)
    return "assumed: parallel" if parallel else "assumed: hidden"


def _relations(solid: Polyhedron, planes: Sequence[BodyPlane], squares: Sequence[Squared]) -> tuple[Relation, ...]:
    """What was made square, by the solid's faces."""
    relations = []
    for f in range(len(solid.faces)):
        plane = _match(solid, f, planes)
        for square in squares:
            if plane is not None and plane.kind == "seen" and square.of in plane.of and square.off > 0:
                relations.append(Relation(square.kind, (f,), square.off, square.limit))
                break
    return tuple(relations)
