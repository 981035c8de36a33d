"""What is known from before, confirmed by a new scan: parts that were seen or put down, where the localizer alone cannot tell them.

Two parts that stand together can look like one thing, and a part on its end like another way of standing. Where a part was seen before,
or the hand put it there, its pose is held against the new readings: what they bear out is taken up, what they do not is forgotten.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import inverse, pose_difference
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.drawing import camera_of, rendered_depth
from handey_studio.task.acting.looking import AGREE_M, LEAST_READINGS, SEEN_SHARE, inner
from handey_studio.task.destination import base_name
from handey_studio.task.sense import Scene
from handey_studio.world import PlacedPart

SAME_M, SAME_RAD = 0.006, float(np.deg2rad(6.0))  # an instance, or another reading of it, so near to a known pose is the same


def known_after(scene: Scene, moved: str, T_world_part: NDArray | None) -> tuple[PlacedPart, ...]:
    """What a scene told, with the instance `moved` at `T_world_part` (4, 4) now; without it where nobody knows."""
    others = tuple(placed for placed in scene.instances if placed.name != moved)
    one = scene.instance(moved)
    return others if one is None or T_world_part is None else (*others, replace(one, T_world_part=T_world_part))


def remembered(scene: Scene, known: Sequence[PlacedPart]) -> Scene:
    """The scene with what was `known` before it, as far as its readings bear it out.

    An instance that could be otherwise as well (a rival) is taken as it is known. A known part that was not found is added, under the next
    number of its name, if the readings in its place lie on it and on no instance that was found. `Scene.known` names both.
    """
    instances = list(scene.instances)
    missing, sure = [], []
    for placed in known:
        number, T = _found(placed, scene)
        if T is None:
            missing.append(placed)
        elif scene.doubts.get(instances[number].name, 0.0) > 0.0:
            instances[number] = replace(instances[number], T_world_part=T)
            sure.append(instances[number].name)
    found = len(instances)
    for placed in _borne_out(scene, instances, missing):
        count = sum(base_name(other.name) == placed.part.name for other in instances) + 1
        instances.append(replace(placed, name=f"{placed.part.name}#{count}"))
    names = (*sure, *(placed.name for placed in instances[found:]))
    return replace(scene, instances=tuple(instances), known=names) if names else scene


def _found(placed: PlacedPart, scene: Scene) -> tuple[int, NDArray | None]:
    """Which of the located instances a known part is, and its pose (4, 4) there: its own or another one that the view allows; -1 and None
    if it is none of them."""
    for number, one in enumerate(scene.instances):
        if _same(one, placed):
            return number, one.T_world_part
    for number, pose in enumerate(scene.located.poses[: len(scene.instances)]):
        rivals = (PlacedPart("", placed.part, rival.T_world_part) for rival in pose.rivals if rival.part == placed.part.name)
        same = next((rival for rival in rivals if _same(rival, placed)), None)
        if pose.part == placed.part.name and same is not None:
            return number, same.T_world_part
    return -1, None


def _same(one: PlacedPart, other: PlacedPart) -> bool:
    """Whether two placed parts are of one kind and at one pose, by any of their symmetries."""
    if one.part.name != other.part.name:
        return False
    apart = (pose_difference(one.T_world_part @ S, other.T_world_part) for S in one.part.symmetries)
    return any(metres < SAME_M and radians < SAME_RAD for metres, radians in apart)


def _borne_out(scene: Scene, found: Sequence[PlacedPart], known: Sequence[PlacedPart]) -> list[PlacedPart]:
    """Those of the known parts that the readings bear out: what shows of each beside the others is seen, and not of what was found."""
    view = scene.depth_map.view()
    drawn = [_drawn(view, placed) for placed in known]
    theirs = _nearest([_drawn(view, placed) for placed in found], view.depth.shape)
    front = _nearest([*drawn, theirs], view.depth.shape)
    kept = []
    for placed, depth in zip(known, drawn, strict=True):
        shows = inner(depth) & (depth <= front + AGREE_M)
        own = (np.abs(depth[shows] - view.depth[shows]) < AGREE_M) & (theirs[shows] > depth[shows] + AGREE_M)
        if own.sum() >= max(LEAST_READINGS, SEEN_SHARE * shows.sum()):
            kept.append(placed)
    return kept


def _drawn(view: DepthView, placed: PlacedPart) -> NDArray:
    """The depth (H, W) [m] that a part would give, infinite beside it."""
    T_sensor_part = inverse(view.T_world_sensor) @ placed.T_world_part
    corners = placed.part.solid.vertices @ T_sensor_part[:3, :3].T + T_sensor_part[:3, 3]
    depth = rendered_depth(corners, placed.part.solid.triangles, view.depth.shape, camera_of(view.projection))
    return np.where(np.isnan(depth), np.inf, depth)


def _nearest(depths: Sequence[NDArray], shape: tuple[int, ...]) -> NDArray:
    """The nearest of several depths (H, W), infinite where there is none."""
    return np.min(depths, axis=0) if depths else np.full(shape, np.inf)
