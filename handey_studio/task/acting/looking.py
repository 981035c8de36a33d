"""Looking again: whether a scene is still as it was scanned, and where the part came to stand."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handey_studio.geometry.transforms import apply, inverse, pose_difference
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.drawing import camera_of, rendered_depth
from handey_studio.task.acting.performance import Check, Incident
from handey_studio.task.destination import base_name
from handey_studio.task.sense import Scene
from handey_studio.world import Part

CHANGE_M = 0.003  # readings that differ by more than this are of something else, not noise
SILHOUETTE_CELLS = 1  # at silhouettes readings jump from scan to scan, in strips no wider than this on either side
CHANGED_AREA_M2 = 6e-5  # in one piece: a change smaller than a finger's end moves no part that a hand could take
NEAR_M = 0.05  # farther from the destination than this an instance is another, or one that was never put there
AGREE_M = 0.0025  # readings this near to the part's surface may be of it
SEEN_SHARE, LEAST_READINGS = 0.8, 60  # so many of its readings must agree before a part that is not recognised counts as seen


@dataclass(frozen=True)
class PlaceLimits:
    """How far [m, rad] a part may stand from where it was commanded."""

    off_m: float = 0.002
    off_rad: float = float(np.deg2rad(1.0))


def changed(before: DepthMap, after: DepthMap) -> Incident | None:
    """Whether two scans between which nothing was done differ; cheap, without locating anything."""
    j, i = np.nonzero(np.isfinite(after.elevation))
    points = apply(after.T_world_range, np.c_[(i + 0.5) * after.cell, (j + 0.5) * after.cell, after.elevation[j, i]])
    there = apply(inverse(before.T_world_range), points)
    at = np.floor(there[:, :2] / before.cell).astype(int)
    ny, nx = before.elevation.shape
    inside = (at >= 0).all(axis=1) & (at[:, 0] < nx) & (at[:, 1] < ny)
    differs = np.zeros(after.elevation.shape, dtype=bool)
    was = before.elevation[at[inside, 1], at[inside, 0]]
    with np.errstate(invalid="ignore"):
        differs[j[inside], i[inside]] = np.abs(there[inside, 2] - was) > CHANGE_M
    core = ndimage.binary_erosion(differs, iterations=SILHOUETTE_CELLS)
    pieces: Any = ndimage.label(ndimage.binary_dilation(core, iterations=SILHOUETTE_CELLS) & differs)
    area = float(np.bincount(pieces[0].ravel())[1:].max(initial=0)) * after.cell**2
    if area <= CHANGED_AREA_M2:
        return None
    return Incident("moved", -1, "something moved since the scan; what changed has an area of", area, CHANGED_AREA_M2, "m²")


def check_place(scene: Scene, part: Part, T_world_goal: NDArray, T_world_released: NDArray) -> Check:
    """Where the part stands after the release, by a new scene; `T_world_released` is where it was by the arm's joints.

    A view that cannot tell the commanded pose from another counts for the commanded one, as the hand put it there, and says so.
    """
    near = [found for found in _instances(scene, part) if _off(found[0], part, T_world_goal)[1] < NEAR_M]
    if near:
        T, rivals = min(near, key=lambda found: _off(found[0], part, T_world_goal)[1])
        return _told(part, T, rivals, T_world_goal)
    metres, radians = _off(T_world_released, part, T_world_goal)[1:]
    by_joints = f"by the arm's joints it was let go {1e3 * metres:.1f} mm and {np.rad2deg(radians):.1f}° from where it was commanded"
    agree, read, missing = readings_of(scene.depth_map, part, T_world_goal)
    if read < LEAST_READINGS:
        return Check("hidden", f"its place is not seen; {by_joints}")
    if missing > (1.0 - SEEN_SHARE) * read:
        return Check("not there", f"its place is empty: {missing} of {read} readings there are of something behind it")
    if agree < SEEN_SHARE * read:
        return Check("not there", f"something else is at its place: {agree} of {read} readings there lie on it")
    return Check("agrees", f"it is not recognised at its place, but {agree} of {read} readings there lie on it; {by_joints}")


def wrong_place(check: Check, limits: PlaceLimits, step: int) -> Incident | None:
    """Whether the check tells that the part does not stand where it was commanded."""
    if check.found == "not there":
        return Incident("wrong place", step, check.sentence)
    if check.off_m is None or check.off_rad is None:
        return None
    if check.off_m > limits.off_m:
        return Incident("wrong place", step, "the part stands off the commanded place by", check.off_m, limits.off_m, "m")
    if check.off_rad > limits.off_rad:
        return Incident("wrong place", step, "the part is turned from the commanded pose by", check.off_rad, limits.off_rad, "rad")
    return None


def readings_of(depth_map: DepthMap, part: Part, T_world_part: NDArray) -> tuple[int, int, int]:
    """How many readings lie on the part's upper surface, how many there are over it, and how many of these are below it."""
    view = depth_map.view()
    corners = apply(inverse(view.T_world_sensor) @ T_world_part, part.solid.vertices)
    depth = rendered_depth(corners, part.solid.triangles, view.depth.shape, camera_of(view.projection))
    above: NDArray = (depth - view.depth)[inner(depth)]
    above = above[np.isfinite(above)]
    return int((np.abs(above) < AGREE_M).sum()), len(above), int((above < -CHANGE_M).sum())


def inner(depth: NDArray) -> NDArray:
    """Where (H, W) a drawn part is met well inside its silhouette."""
    eroded: Any = ndimage.binary_erosion(np.isfinite(depth), iterations=SILHOUETTE_CELLS + 1)
    return eroded


def _told(part: Part, T: NDArray, rivals: tuple[tuple[str, NDArray], ...], T_world_goal: NDArray) -> Check:
    """The check of an instance near the goal, or of the reading of it that is nearest, where the view allows several."""
    readings = [T, *(rival for name, rival in rivals if name == part.name)]
    best = min(readings, key=lambda reading: _cost(_off(reading, part, T_world_goal)))
    seen, metres, radians = _off(best, part, T_world_goal)
    sentence = f"seen {1e3 * metres:.2f} mm and {np.rad2deg(radians):.2f}° from where it was commanded"
    names = tuple(name for name, _ in rivals)
    if best is not T:
        sentence += "; the view alone would as soon have it otherwise, the hand put it so"
    elif names:
        sentence += f"; the view could also be of {' or '.join(dict.fromkeys(names))} otherwise"
    return Check("seen", sentence, seen, metres, radians, names)


def _instances(scene: Scene, part: Part) -> list[tuple[NDArray, tuple[tuple[str, NDArray], ...]]]:
    """Pose and rivals of each located instance of a part."""
    poses = zip(scene.instances, scene.located.poses, strict=False)
    own = [(placed, pose) for placed, pose in poses if base_name(placed.name) == part.name]
    return [(placed.T_world_part, tuple((rival.part, rival.T_world_part) for rival in pose.rivals)) for placed, pose in own]


def _off(T_world_part: NDArray, part: Part, T_world_goal: NDArray) -> tuple[NDArray, float, float]:
    """The pose in the naming of its symmetry that is nearest to the goal, and how far off it is [m, rad]."""
    named = [T_world_part @ S for S in part.symmetries]
    told = [(T, *pose_difference(T, T_world_goal)) for T in named]
    return min(told, key=_cost)


def _cost(told: tuple[NDArray, float, float]) -> float:
    """Metres, a radian for 5 cm."""
    return told[1] + 0.05 * told[2]
