"""Measuring between two picks: a distance or an angle, with its unit and where to draw it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array, measured
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt, Reference

PARALLEL_RAD = float(np.deg2rad(0.5))  # nearer to parallel than this a distance says more than the angle


@dataclass(frozen=True, eq=False)
class Measurement(Value):
    """What was measured: `value` in `unit` ("m" or "rad"), `sentence` as people read it, and the line (2, 3) [m] to draw it
    along. `off_parallel` [rad]: how far two faces or edges whose distance it is are from parallel."""

    value: float
    unit: str
    sentence: str
    line: NDArray
    off_parallel: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "line", frozen_array(self.line))


def measure(a: Reference, b: Reference) -> Measurement:
    """The distance or angle between two picks, taken as a plane (a face), a line (an edge) and a point (a corner).

    Planes and lines that are parallel within half a degree have a distance, others an angle in [0°, 90°]; edges that pass each other
    have an angle too.
    """
    kinds = (FaceAt, EdgeAt, CornerAt)
    if kinds.index(type(a)) > kinds.index(type(b)):
        a, b = b, a
    if isinstance(b, CornerAt):
        return _from_point(a, b.point)
    turn = _turn(a, b)
    if turn > PARALLEL_RAD:
        return Measurement(turn, "rad", f"the angle is {measured(turn, 'rad')}", np.array([a.point, b.point]))
    return _from_point(a, b.point, turn)


def _from_point(a: Reference, point: NDArray, off_parallel: float = 0.0) -> Measurement:
    """The distance of a point from a plane, a line or a point."""
    way = point - a.point
    if isinstance(a, FaceAt):
        way = a.normal * (a.normal @ way)
    elif isinstance(a, EdgeAt):
        way = way - a.direction * (a.direction @ way)
    distance = float(np.linalg.norm(way))
    return Measurement(distance, "m", f"the distance is {measured(distance, 'm')}", np.array([point - way, point]), off_parallel)


def _turn(a: Reference, b: Reference) -> float:
    """The angle [rad] between planes, lines, or a plane and a line, in [0, π/2]."""
    u, v = (pick.normal if isinstance(pick, FaceAt) else pick.direction for pick in (a, b) if not isinstance(pick, CornerAt))
    turn = float(np.arctan2(np.linalg.norm(np.cross(u, v)), abs(u @ v)))
    return np.pi / 2 - turn if type(a) is not type(b) else turn
