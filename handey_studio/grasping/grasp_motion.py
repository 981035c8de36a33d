"""The hand's ways in and out of a grasp, in its plane: bump lines first, and what escapes from where they get stuck (Handey 1987 §5.2)."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.grasping.bump_lines import BumpOptions, plan_approach
from handey_studio.grasping.bump_run import BumpRun, FoundBy
from handey_studio.grasping.classes import contact_area, contact_areas
from handey_studio.grasping.grasp_plane import GraspPlane
from handey_studio.grasping.groups import GraspGroup
from handey_studio.grasping.hand_outline import Outline, hand_outline, overlaps
from handey_studio.grasping.plane_paths import is_free, shortened
from handey_studio.grasping.plane_search import PlaneSpace, SearchOptions, beyond, plane_space, way_out
from handey_studio.grasping.roofs import under_roofs
from handey_studio.world import Hand


@dataclass(frozen=True)
class MotionOptions:
    """The bump-line planner starts straight back from the grasp by each of `standoffs` [m]; then by the first one in directions off by
    `asides` [rad], with the hand as it is to be in the end and with the hand turned as well. Leaving, the same the other way round. Where
    the search may end anywhere, a radian that the fingers are off straight down costs as much as a way of `tilt_cost` [m]."""

    standoffs: tuple[float, ...] = (0.08, 0.05)
    asides: tuple[float, ...] = (0.35, -0.35, 0.7, -0.7)
    tilt_cost: float = 0.05
    bumps: BumpOptions = field(default_factory=BumpOptions)
    search: SearchOptions = field(default_factory=SearchOptions)


WITH_PART = MotionOptions(
    standoffs=(0.08, 0.16, 0.05),
    asides=(1.57, -1.57, 0.7, -0.7),
    search=SearchOptions(step=0.004, turn=float(np.deg2rad(7.5)), radius=0.20, out=0.04),
)
"""With a part in the hand the way is longer, and also leads aside; a radian that the part is turned costs what tilted fingers do."""


def plan_grasp_motion(
    plane: GraspPlane,
    hand: Hand,
    group: GraspGroup,
    angle: float,
    ranges: NDArray | None = None,
    options: MotionOptions = MotionOptions(),
) -> BumpRun:
    """The way in for a grasp group with the hand in the end at `angle` [rad], or as near to it as the bump lines' turns leave it.

    `ranges` (m, 2) [rad] are the hand angles that are legal at the grasp, all if None. Bump lines from several starts come first, then the
    search of the plane's configuration space, which also settles that there is no way; the run says which it was (`found_by`). A run that
    has reached ends at a legal angle, overlaps the face sufficiently, and has a shortened path. If none has, it is the nearest one.
    """
    outline, nearest = hand_outline(hand), None
    for start, found_by in _starts(np.array([*group.point, angle]), group.depth, options):
        run = _judged(plan_approach(plane, outline, start, group.point, options.bumps), hand, group, ranges)
        if run.status == "reached":
            path = shortened(plane, outline, run.path, options.search.margin)
            return replace(run, path=path, found_by=found_by)
        nearest = run if nearest is None or run.distance < nearest.distance else nearest
    assert nearest is not None
    space = plane_space(plane, outline, np.array([*group.point, angle]), options.search)
    path, allowed, cost = None, _allowed(space, hand, group, ranges), _upright(plane, space, options)
    for angles in ([a for a in allowed if a == space.root[2]], allowed):
        sources = [found for a in angles for found in _sources(plane, outline, space, a, options)]
        path = _ways(plane, outline, space, sources, cost, options) if path is None else path
    if path is None:
        return replace(nearest, status="no way") if nearest.status != "short contact" else nearest
    return replace(nearest, path=path[::-1], status="reached", distance=0.0, found_by="plane search")


def plan_retreat(plane: GraspPlane, hand: Hand, pose: NDArray, options: MotionOptions = MotionOptions()) -> BumpRun:
    """The way out of a grasp from a pose (y, z, angle) of the open hand among what stands around the putdown: the reverse of the way in.

    Straight back along the fingers if that is free, else led by bump lines to one of the places where a way in might start, else by search.
    The path begins at the pose, which is taken for free; `goal` is where it was to lead.
    """
    outline, pose = hand_outline(hand), np.array(pose, dtype=float)
    (out, _), *others = _starts(pose, 0.0, options)
    if is_free(plane, outline, pose, out):
        path = shortened(plane, outline, np.array([pose, out]), 0.0)
        return BumpRun(plane, path, out[:2], "reached", 0.0, options.bumps.threshold, "straight back")
    nearest = plan_approach(plane, outline, pose, out[:2], options.bumps)
    for target, _ in others:
        if nearest.status != "stuck":
            break
        run = plan_approach(plane, outline, pose, target[:2], options.bumps)
        nearest = run if run.status == "reached" else nearest
    if nearest.status == "reached":
        return replace(nearest, path=shortened(plane, outline, nearest.path, options.search.margin))
    space = plane_space(plane, outline, pose, options.search)
    sources = _sources(plane, outline, space, pose[2], options)
    path = _ways(plane, outline, space, sources, _upright(plane, space, options), options)
    if path is None:
        return replace(nearest, status="no way")
    return replace(nearest, path=path, goal=path[-1, :2], status="reached", distance=0.0, found_by="plane search")


def plan_removal(plane: GraspPlane, outline: Outline, pose: NDArray, options: MotionOptions = WITH_PART) -> BumpRun:
    """The way of the hand with a part in it from a pose (y, z, angle) to where nothing is above them any more; backwards it is the way in.

    `plane` and `outline` are those of hand and part together (`fill_grasp_plane` with `held`, `outline_with`). At the pose they touch
    nothing: the part has been lifted off what it stood on. Bump lines lead to one place after the other that lies back or aside,
    until one is out; else the search does, to the nearest place that is. The path begins at the pose; `goal` is where it was to lead.
    """
    pose, roofs = np.array(pose, dtype=float), under_roofs(plane)
    nearest: BumpRun | None = None
    for target, found_by in _starts(pose, 0.0, options):
        run = plan_approach(plane, outline, pose, target[:2], options.bumps)
        if run.status == "reached" and not overlaps(roofs, outline, run.path[-1]):
            return replace(run, path=shortened(plane, outline, run.path, 0.0), found_by=found_by)
        nearest = run if nearest is None or run.distance < nearest.distance else nearest
    assert nearest is not None
    space = plane_space(plane, outline, pose, options.search)
    roofed = plane_space(roofs, outline, pose, options.search, inside=True)
    turned = options.tilt_cost * np.abs(space.angles - pose[2])[:, None, None]
    cost = np.where(roofed.blocked | ~beyond(space, options.search.out), np.inf, turned)
    sources = _source(plane, outline, space, pose[2], plane.T_world_plane[2, 1:3], options.search.out, looked_at=False)
    path = _ways(plane, outline, space, sources, cost, options)
    if path is None:
        return replace(nearest, status="no way", found_by="")
    return replace(nearest, path=path, goal=path[-1, :2], status="reached", distance=0.0, found_by="plane search")


def _starts(pose: NDArray, depth: float, options: MotionOptions) -> Iterator[tuple[NDArray, FoundBy]]:
    """Poses (3,) from where a way in may start, and what a run from there is called."""
    for standoff in options.standoffs:
        back = pose[:2] - (standoff + depth) * _along(pose[2])
        yield np.append(back, pose[2]), "bump lines" if standoff == options.standoffs[0] else "another start"
    for aside in options.asides:
        back = pose[:2] - (options.standoffs[0] + depth) * _along(pose[2] + aside)
        yield np.append(back, pose[2]), "another start"
        yield np.append(back, pose[2] + aside), "another start"


def _judged(run: BumpRun, hand: Hand, group: GraspGroup, ranges: NDArray | None) -> BumpRun:
    """The run, not reached after all if it ended at an angle that is not legal or with too little overlap of finger and face."""
    if run.status == "reached" and not _is_legal(run.path[-1, 2], ranges):
        return replace(run, status="stuck", found_by="")
    if run.status == "reached" and contact_area(group.grasp_class, hand, run.path[-1, :2], run.path[-1, 2]) < hand.min_contact_area:
        return replace(run, status="short contact", found_by="")
    return run


def _is_legal(angle: float, ranges: NDArray | None) -> bool:
    return ranges is None or bool(((angle >= ranges[:, 0] - 1e-6) & (angle <= ranges[:, 1] + 1e-6)).any())


def _allowed(space: PlaneSpace, hand: Hand, group: GraspGroup, ranges: NDArray | None) -> list[float]:
    """The space's angles [rad] at which the hand may be at the grasp."""
    areas = contact_areas(group.grasp_class, hand, np.tile(group.point, (len(space.angles), 1)), space.angles)
    enough = areas >= hand.min_contact_area
    return [float(angle) for angle, touches in zip(space.angles, enough, strict=True) if touches and _is_legal(angle, ranges)]


def _along(angle: float) -> NDArray:
    return np.array([np.cos(angle), np.sin(angle)])


class _Source(NamedTuple):
    """Where a search begins: the pose (3,) of the hand at the grasp, where it has come to straight from there, and the node (3,) there."""

    pose: NDArray
    backed: NDArray
    node: NDArray


def _sources(plane: GraspPlane, outline: Outline, space: PlaneSpace, angle: float, options: MotionOptions) -> list[_Source]:
    """From the root's point with the hand at an angle: straight back along the fingers, straight up, and between."""
    back, up = -_along(angle), plane.T_world_plane[2, 1:3]
    directions = [d / np.linalg.norm(d) for d in (back, back + up, up) if np.linalg.norm(d) > 0.2]
    return [found for d in directions for found in _source(plane, outline, space, angle, d, options.search.out)]


def _source(
    plane: GraspPlane, outline: Outline, space: PlaneSpace, angle: float, direction: NDArray, longest: float, looked_at: bool = True
) -> list[_Source]:
    """From the root's point with the hand at an angle, straight in a direction (2,), to the first node of the space that is free; none if
    there is none within `longest` [m], or if the straight motion there is surely blocked: by more than a cell, as the hand may stand nearer
    to something than the cells can tell."""
    pose = np.append(space.root[:2], angle)
    for back in np.arange(0.0, longest, space.step):
        backed = pose + np.append(back * direction, 0.0)
        node = space.node(backed)
        if (node < 0).any() or (node >= space.blocked.shape).any():
            return []
        if not space.blocked[tuple(node)]:
            free = not looked_at or is_free(plane, outline, pose, backed, -plane.cell)
            return [_Source(pose, backed, node)] if free else []
    return []


def _upright(plane: GraspPlane, space: PlaneSpace, options: MotionOptions) -> NDArray:
    """What it costs (angles, n, n) [m] the hand alone to be at a node: its tilt; infinite where it is not out yet."""
    fingers = np.stack([np.cos(space.angles), np.sin(space.angles)], axis=1) @ plane.T_world_plane[2, 1:3]
    tilts = np.arccos(np.clip(-fingers, -1.0, 1.0))
    return np.where(beyond(space, options.search.out), options.tilt_cost * tilts[:, None, None], np.inf)


def _ways(
    plane: GraspPlane, outline: Outline, space: PlaneSpace, sources: list[_Source], cost: NDArray, options: MotionOptions
) -> NDArray | None:
    """The shortened path (k, 3) from one of the sources out of everything, to the node that costs least; None if there is none."""
    if not sources:
        return None
    nodes = way_out(space, np.array([source.node for source in sources]), cost)
    if not len(nodes):
        return None
    first = next(source for source in sources if (source.node == nodes[0]).all())
    return shortened(plane, outline, np.vstack([first.pose, first.backed, space.poses(nodes)]), options.search.margin)
