"""The steps that change a solid that is there: cut, move, set to a number, mirror, delete, confirm."""

from dataclasses import dataclass
from typing import ClassVar

from numpy.typing import NDArray

from handey_studio.base import measured
from handey_studio.modeling.operation import Operation
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt, keep, number, numbers, unit

MAX_ANGLE_RAD = 3.1415


@dataclass(frozen=True, eq=False)
class CutByPlane(Operation):
    """What lies on the side of a plane that its `normal` (3,) points to is cut off; `point` (3,) [m] is on the plane."""

    kind: ClassVar[str] = "cut by plane"
    point: NDArray
    normal: NDArray

    def __post_init__(self) -> None:
        keep(self, "point", numbers(self.point, (3,), "the point of a cutting plane"))
        keep(self, "normal", unit(self.normal, "the normal of a cutting plane"))


@dataclass(frozen=True, eq=False)
class MoveFace(Operation):
    """A face moves along its normal by `distance` [m], outward when positive; its neighbours are lengthened or trimmed."""

    kind: ClassVar[str] = "move face"
    face: FaceAt
    distance: float

    def __post_init__(self) -> None:
        number(self.distance, "the way of a face [m]")

    @property
    def told(self) -> str:
        return f"{self.kind} by {measured(self.distance, 'm')}"


@dataclass(frozen=True, eq=False)
class MoveEdge(Operation):
    """An edge moves by `way` (3,) [m]: the two faces that meet there move along their normals. The part along the edge does nothing."""

    kind: ClassVar[str] = "move edge"
    edge: EdgeAt
    way: NDArray

    def __post_init__(self) -> None:
        keep(self, "way", numbers(self.way, (3,), "the way of an edge"))


@dataclass(frozen=True, eq=False)
class MoveCorner(Operation):
    """A corner moves by `way` (3,) [m]: the faces that meet there move along their normals."""

    kind: ClassVar[str] = "move corner"
    corner: CornerAt
    way: NDArray

    def __post_init__(self) -> None:
        keep(self, "way", numbers(self.way, (3,), "the way of a corner"))


@dataclass(frozen=True, eq=False)
class SetDistance(Operation):
    """The `face` moves until it is `distance` [m] from the parallel face `other`."""

    kind: ClassVar[str] = "set distance"
    face: FaceAt
    other: FaceAt
    distance: float

    def __post_init__(self) -> None:
        number(self.distance, "a distance between faces [m]", 0.0)

    @property
    def told(self) -> str:
        return f"{self.kind} to {measured(self.distance, 'm')}"


@dataclass(frozen=True, eq=False)
class SetLength(Operation):
    """An edge gets the length `length` [m]: the faces at the end that its direction leads to move."""

    kind: ClassVar[str] = "set length"
    edge: EdgeAt
    length: float

    def __post_init__(self) -> None:
        number(self.length, "the length of an edge [m]", 0.0)

    @property
    def told(self) -> str:
        return f"{self.kind} to {measured(self.length, 'm')}"


@dataclass(frozen=True, eq=False)
class SetAngle(Operation):
    """The `face` turns about the edge that it shares with `other` until the two meet at `angle` [rad].

    It is measured through the solid where their edge is an outer one, and through the air where it is an inner one: less than 180°.
    """

    kind: ClassVar[str] = "set angle"
    face: FaceAt
    other: FaceAt
    angle: float

    def __post_init__(self) -> None:
        number(self.angle, "an angle between faces [rad]", 0.0, MAX_ANGLE_RAD)

    @property
    def told(self) -> str:
        return f"{self.kind} to {measured(self.angle, 'rad')}"


@dataclass(frozen=True, eq=False)
class Mirror(Operation):
    """The solid and its mirror image in a plane, joined; or the image alone when `keep_original` is off."""

    kind: ClassVar[str] = "mirror"
    point: NDArray
    normal: NDArray
    keep_original: bool = True

    def __post_init__(self) -> None:
        keep(self, "point", numbers(self.point, (3,), "the point of a mirror plane"))
        keep(self, "normal", unit(self.normal, "the normal of a mirror plane"))


@dataclass(frozen=True, eq=False)
class Delete(Operation):
    """The solid, or the sketch of that name, is gone."""

    kind: ClassVar[str] = "delete"
    what: str = "solid"

    @property
    def told(self) -> str:
        return f"{self.kind} {self.what}"


@dataclass(frozen=True, eq=False)
class ConfirmFace(Operation):
    """A face that was assumed is held to be right, in the word of a person: `source` takes the place of the assumption."""

    kind: ClassVar[str] = "confirm face"
    face: FaceAt
    source: str = "confirmed by hand"
