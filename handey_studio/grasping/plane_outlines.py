"""Obstacles as the picture of Handey 1987, Figure 8, has them: outlines in the grasp plane, the putdown's carried back to the pickup."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.grasping.groups import GraspGroup
from handey_studio.grasping.plane_columns import BIN_M, Strips, depth_columns, filled_strips
from handey_studio.grasping.plane_obstacles import Volumes, clipped, hand_volumes, hull
from handey_studio.grasping.rotations import ENDS, HAND_MARGIN_M, End, GraspEnd
from handey_studio.world.collision_bodies import DEPTH_MAP, solids_of


@dataclass(frozen=True, eq=False)
class PlaneOutline(Value):
    """What one of the hand's volumes (`finger_left`, …) would meet of a body at one end: corners (k, 2) [m] in the grasp plane."""

    end: End
    body: str
    volume: str
    corners: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", frozen_array(self.corners))


def plane_outlines(group: GraspGroup, pickup: GraspEnd, putdown: GraspEnd) -> tuple[PlaneOutline, ...]:
    """Outlines of everything within the hand's reach at both ends, in the group's grasp plane; the part itself is left out."""
    hand = pickup.world.robot.hand
    opening = group.opening(hand)
    volumes, names = hand_volumes(hand, group.grasp_class.width, opening, HAND_MARGIN_M), tuple(hand.boxes(opening))
    found: list[PlaneOutline] = []
    for name, end in zip(ENDS, (pickup, putdown), strict=True):
        for v, volume in enumerate(names):
            found += [PlaneOutline(name, body, volume, corners + group.point) for body, corners in _outlines(end, group, volumes, v)]
    return tuple(found)


def _outlines(end: GraspEnd, group: GraspGroup, volumes: Volumes, v: int) -> list[tuple[str, NDArray]]:
    """Bodies and their outlines about the grasp point, cut off where the volume does not reach."""
    T_world_plane = end.T_world_part @ group.grasp_class.T_part_plane
    T_world_plane[:3, 3] += T_world_plane[:3, 1:3] @ group.point
    reach = shapely.Point(0.0, 0.0).buffer(float(np.hypot(volumes.boxes[v, 0], volumes.boxes[v, 2])))
    own, shapes = end.own.name if end.own else "", []
    for name, corners in solids_of(end.world):
        points = hull(clipped(apply(inverse(T_world_plane), corners), *volumes.slabs[v])) if name != own else np.empty((0, 2))
        if len(points) > 2:
            shapes.append((name, shapely.Polygon(points)))
    if end.world.terrain is not None:
        columns = depth_columns(end.world.terrain, end.world.table_z, float(end.world.free_space[1, 2]))
        shapes.append((DEPTH_MAP, _filled(filled_strips(columns, T_world_plane, volumes.slabs[v], volumes.boxes[v]))))
    return [(name, corners) for name, shape in shapes for corners in _corners(shape.intersection(reach))]


def _filled(strips: Strips) -> BaseGeometry:
    """What the depth map's columns fill."""
    runs, counts, across, up = strips
    rows, cols = np.nonzero(np.arange(runs.shape[1]) < counts[:, None])
    left = (rows - 0.5 * len(runs)) * BIN_M
    boxes = shapely.box(left, runs[rows, cols, 0], left + BIN_M, runs[rows, cols, 1])
    return shapely.transform(shapely.union_all(boxes), lambda points: points @ np.array([across, up]))


def _corners(shape: BaseGeometry) -> list[NDArray]:
    pieces = [piece for piece in shapely.get_parts(shape) if isinstance(piece, shapely.Polygon) and not piece.is_empty]
    return [shapely.get_coordinates(piece.exterior)[:-1] for piece in pieces]
