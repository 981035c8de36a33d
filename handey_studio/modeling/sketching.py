"""Drawing an outline click by click: what each side is meant to be is inferred, shown, and can be switched off (Handey 1987 §1).

A stroke is a value; every click gives the next one. What is inferred are plain `Constraint`s, which the sketch keeps: replaying a draft
infers nothing.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import BadInput, Value, measured
from handey_studio.modeling.constraints import Constraint, check_constraint, rank
from handey_studio.modeling.outline import CONTRADICTED_M, LEAST_SIDE_M, MAX_CORNERS, Outline, solve, solved_corners, sound_corners
from handey_studio.modeling.references import keep, numbers

SIDE_SHRINKS_TO = 0.5  # an inferred constraint may not halve a side


@dataclass(frozen=True, eq=False)
class Guides(Value):
    """What is seen in a sketch's plane, in its x and y [m]: `points` (k, 2) and `segments` (m, 2, 2) that clicks snap to, and `angles`
    (j,) [rad], the directions of edges that sides may run along."""

    points: NDArray = field(default_factory=lambda: np.empty((0, 2)))
    segments: NDArray = field(default_factory=lambda: np.empty((0, 2, 2)))
    angles: NDArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        keep(self, "points", numbers(self.points, (-1, 2), "the points to snap to"))
        keep(self, "segments", numbers(self.segments, (-1, 2, 2), "the edges to snap to"))
        keep(self, "angles", numbers(self.angles, (-1,), "the directions of edges"))


@dataclass(frozen=True)
class SketchOptions:
    """When a click is taken to mean more than its place.

    `turn` [rad]: a side this near to a direction has it; sides so short that `click_m` [m], the error of a click, turns them by more get
    up to `most_turn`. `equal`: lengths within this share are equal. `snap_m`, `close_m` [m]: how near a click must be to a point or an
    edge to be on it, and to the first corner to close the outline. `infer`: off, only the clicks count.
    """

    turn: float = float(np.deg2rad(4.0))
    most_turn: float = float(np.deg2rad(10.0))
    click_m: float = 0.001
    equal: float = 0.02
    snap_m: float = 0.003
    close_m: float = 0.005
    infer: bool = True


@dataclass(frozen=True, eq=False)
class Stroke(Value):
    """An outline in the making: the `clicks` (n, 2) [m] so far, the constraints inferred or set, and whether it has been closed."""

    clicks: NDArray = field(default_factory=lambda: np.empty((0, 2)))
    constraints: tuple[Constraint, ...] = ()
    closed: bool = False

    def __post_init__(self) -> None:
        keep(self, "clicks", numbers(self.clicks, (-1, 2), "the clicks of an outline"))

    @cached_property
    def corners(self) -> NDArray:
        """Corners (n, 2) [m] where the constraints put them."""
        return solved_corners(self.clicks, self.constraints)

    @property
    def outline(self) -> Outline:
        """The closed outline. Raises BadInput while the stroke is open."""
        if not self.closed:
            raise BadInput(f"the outline is still open after {len(self.clicks)} corners; click on its first corner to close it.")
        return Outline(self.clicks, self.constraints)


def clicked(stroke: Stroke, xy: ArrayLike, guides: Guides = Guides(), options: SketchOptions = SketchOptions()) -> Stroke:
    """The stroke after one more click at `xy` (2,) [m] in the plane; a click on the first corner closes it.

    Raises BadInput with one sentence when the click is on the corner before, or the new side crosses another.
    """
    if stroke.closed:
        raise BadInput("the outline is closed already; draw another one.")
    if len(stroke.clicks) >= MAX_CORNERS:
        raise BadInput(f"the outline has {len(stroke.clicks)} corners, the limit is {MAX_CORNERS}.")
    point = numbers(xy, (2,), "a click")
    if len(stroke.clicks) >= 3 and np.linalg.norm(stroke.corners[0] - point) < options.close_m:
        return closed(stroke, guides, options)
    if len(stroke.clicks):
        gap = float(np.linalg.norm(stroke.corners - point, axis=1).min())
        if gap < LEAST_SIDE_M:
            raise BadInput(
                f"the click is {measured(gap, 'm')} from a corner that is there; a side must be {measured(LEAST_SIDE_M, 'm')} long."
            )
    longer = Stroke(np.vstack([stroke.clicks, point]), stroke.constraints)
    if options.infer:
        longer = _snapped(longer, guides, options)
        if len(longer.clicks) > 1:
            longer = _inferred(longer, len(longer.clicks) - 2, guides, options)
    if len(longer.clicks) > 3 and not shapely.LineString(longer.corners).is_simple:
        raise BadInput("the new side would cross the outline; its sides must meet at its corners only.")
    return longer


def closed(stroke: Stroke, guides: Guides = Guides(), options: SketchOptions = SketchOptions()) -> Stroke:
    """The stroke with its last side drawn to the first corner. Raises BadInput when it then crosses itself or encloses nothing."""
    if len(stroke.clicks) < 3:
        raise BadInput(f"the outline has {len(stroke.clicks)} corners; it needs at least 3 to be closed.")
    whole = replace(stroke, closed=True)
    if options.infer:
        whole = _inferred(whole, len(whole.clicks) - 1, guides, options)
    sound_corners(whole.outline)
    return whole


def switched(stroke: Stroke, index: int, on: bool) -> Stroke:
    """The stroke with one of its constraints switched on or off. Raises BadInput when that contradicts the others."""
    if not 0 <= index < len(stroke.constraints):
        raise BadInput(f"constraint {index + 1} is not there; the outline has {len(stroke.constraints)}.")
    constraints = [replace(c, on=on) if k == index else c for k, c in enumerate(stroke.constraints)]
    return _sound(replace(stroke, constraints=tuple(constraints)))


def constrained(stroke: Stroke, constraint: Constraint) -> Stroke:
    """The stroke with one more constraint that a person asks for, such as a typed length, in place of the same asked before.

    What was merely inferred to be equal gives way to it. Raises BadInput when it contradicts the others.
    """
    check_constraint(constraint, len(stroke.clicks))
    others = tuple(c for c in stroke.constraints if (c.kind, c.item, c.other) != (constraint.kind, constraint.item, constraint.other))
    equal = [k for k, c in enumerate(others) if c.kind == "equal" and c.on]
    for yielding in ([], *([k] for k in equal), equal):
        kept = tuple(replace(c, on=c.on and k not in yielding) for k, c in enumerate(others))
        following = replace(stroke, constraints=(*kept, constraint))
        if solve(stroke.clicks, following.constraints)[1].max() < CONTRADICTED_M:
            return _sound(following)
    return _sound(replace(stroke, constraints=(*others, constraint)))


def undone(stroke: Stroke) -> Stroke:
    """The stroke before its last click. Raises BadInput when there is none."""
    if stroke.closed:
        last = len(stroke.clicks) - 1
        return Stroke(stroke.clicks, tuple(c for c in stroke.constraints if c.kind in ("at", "on line") or last not in (c.item, c.other)))
    if not len(stroke.clicks):
        raise BadInput("there is no click to take back.")
    corner = len(stroke.clicks) - 1
    left = [c for c in stroke.constraints if c.item < corner - (c.kind not in ("at", "on line")) and c.other < corner - 1]
    return Stroke(stroke.clicks[:-1], tuple(left))


def _sound(stroke: Stroke) -> Stroke:
    if stroke.closed:
        sound_corners(stroke.outline)
    else:
        solved_corners(stroke.clicks, stroke.constraints)
    return stroke


def _snapped(stroke: Stroke, guides: Guides, options: SketchOptions) -> Stroke:
    """The stroke with its newest corner on a point or an edge that is near."""
    corner, point = len(stroke.clicks) - 1, stroke.clicks[-1]
    distances = np.linalg.norm(guides.points - point, axis=1)
    if len(distances) and distances.min() < options.snap_m:
        x, y = guides.points[np.argmin(distances)]
        return _if_possible(stroke, Constraint("at", corner, values=(float(x), float(y))))
    off = np.array([shapely.LineString(segment).distance(shapely.Point(point)) for segment in guides.segments])
    if len(off) and off.min() < options.snap_m:
        (x, y), end = guides.segments[np.argmin(off)]
        return _if_possible(stroke, Constraint("on line", corner, values=(float(x), float(y), float(np.arctan2(end[1] - y, end[0] - x)))))
    return stroke


def _inferred(stroke: Stroke, side: int, guides: Guides, options: SketchOptions) -> Stroke:
    """The stroke with what its newest side is meant to be: a direction, and the length of another."""
    vectors = np.roll(stroke.corners, -1, axis=0) - stroke.corners
    vectors = vectors if stroke.closed else vectors[:-1]
    length = float(np.linalg.norm(vectors[side]))
    turn = min(max(options.turn, options.click_m / length), options.most_turn)
    for constraint in _directions(vectors, side, guides, turn):
        following = _if_possible(stroke, constraint)
        if following is not stroke:
            stroke = following
            break
    lengths = np.linalg.norm(vectors, axis=1)
    differences = np.abs(lengths - length) / length
    differences[side] = np.inf
    other = int(np.argmin(differences))
    return _if_possible(stroke, Constraint("equal", side, other)) if differences[other] < options.equal else stroke


def _directions(vectors: NDArray, side: int, guides: Guides, turn: float) -> list[Constraint]:
    """What a side's direction may be meant to be, the likeliest first: the nearest, but a simpler one is as good half a degree off."""
    x, y = vectors[side]
    angle = float(np.arctan2(y, x))
    meant = [(0.0, 0.0, Constraint("horizontal", side)), (np.pi / 2, 0.0, Constraint("vertical", side))]
    meant += [(float(a), 0.5, Constraint("along", side, values=(float(a),))) for a in guides.angles]
    for other, (u, v) in enumerate(vectors):
        if other != side:
            beside = 0.5 if other == side - 1 else 1.0
            meant.append((np.arctan2(v, u) + np.pi / 2, beside, Constraint("perpendicular", side, other)))
            meant.append((np.arctan2(v, u), 1.0, Constraint("parallel", side, other)))
    off = [(abs((angle - aim + np.pi / 2) % np.pi - np.pi / 2), weight, constraint) for aim, weight, constraint in meant]
    near = [(turned + np.deg2rad(weight), constraint) for turned, weight, constraint in off if turned < turn]
    return [constraint for _, constraint in sorted(near, key=lambda pair: pair[0])]


def _if_possible(stroke: Stroke, constraint: Constraint) -> Stroke:
    """The stroke with a constraint, if that says something new, contradicts nothing and leaves every side most of its length."""
    asked = [c for c in stroke.constraints if c.on]
    if rank(stroke.corners, [*asked, constraint]) == rank(stroke.corners, asked):
        return stroke
    constraints = (*stroke.constraints, constraint)
    corners, errors, _ = solve(stroke.clicks, constraints)
    before, after = (np.linalg.norm(np.roll(c, -1, axis=0) - c, axis=1) for c in (stroke.corners, corners))
    if errors.max() > CONTRADICTED_M or (after < SIDE_SHRINKS_TO * before).any():
        return stroke
    return replace(stroke, constraints=constraints)
