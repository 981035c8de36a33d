"""The steps that a model is made of. Each is a small value: what a person did, in the model's frame [m], and nothing computed from it.

`replay` runs them. A step's `kind` is its word in a draft's file and on screen.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, measured
from handey_studio.geometry.transforms import is_rigid
from handey_studio.modeling.outline import Outline
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt, keep, number, numbers, unit

Combine = Literal["join", "cut", "common"]
MAX_SUGGESTED_CORNERS = 5000
MAX_ANGLE_RAD = 3.1415


@dataclass(frozen=True, eq=False)
class Operation(Value):
    """One step of a draft."""

    kind: ClassVar[str] = ""

    @property
    def told(self) -> str:
        """The step in a few words, with its numbers in mm and degrees."""
        return self.kind


@dataclass(frozen=True, eq=False)
class TakeSuggestion(Operation):
    """A suggested solid as it was, so that replaying needs no segmentation; it takes the place of a solid that is there.

    `vertices` (n, 3) [m]; `faces`: each its loops of corner numbers, the outer one first, counter-clockwise seen from outside; `sources`:
    where each face comes from ("seen in scan …", "assumed: …").
    """

    kind: ClassVar[str] = "take suggestion"
    vertices: NDArray
    faces: tuple[tuple[tuple[int, ...], ...], ...]
    sources: tuple[str, ...]

    def __post_init__(self) -> None:
        keep(self, "vertices", numbers(self.vertices, (-1, 3), "the corners of a suggestion"))
        if len(self.vertices) < 4 or len(self.faces) < 4:
            raise BadInput(f"a suggestion has {len(self.vertices)} corners and {len(self.faces)} faces; a solid has at least 4 of each.")
        if len(self.vertices) > MAX_SUGGESTED_CORNERS or len(self.faces) > MAX_SUGGESTED_CORNERS:
            raise BadInput(
                f"a suggestion has {len(self.vertices)} corners and {len(self.faces)} faces, the limit is {MAX_SUGGESTED_CORNERS}."
            )
        if len(self.sources) != len(self.faces):
            raise BadInput(f"a suggestion has {len(self.faces)} faces but tells the source of {len(self.sources)}; every face needs one.")

    @property
    def told(self) -> str:
        return f"{self.kind} with {len(self.faces)} faces"


@dataclass(frozen=True, eq=False)
class AlignScan(Operation):
    """`T_model_scan` (4, 4) maps the world frame of the scan of that name into the model's frame; `rms` [m] is the residual."""

    kind: ClassVar[str] = "align scan"
    scan: str
    T_model_scan: NDArray
    rms: float = 0.0

    def __post_init__(self) -> None:
        keep(self, "T_model_scan", numbers(self.T_model_scan, (4, 4), "the pose of a scan", 100.0))
        number(self.rms, "the residual of an alignment [m]", 0.0)
        if not is_rigid(self.T_model_scan, tolerance=1e-5):
            raise BadInput(f'the pose of scan "{self.scan}" is not a rigid transform: a proper rotation, metres, last row 0 0 0 1.')

    @property
    def told(self) -> str:
        return f"align {self.scan} within {measured(self.rms, 'm')}"


@dataclass(frozen=True, eq=False)
class Box(Operation):
    """A box from three clicks on one of its faces: a corner, the next corner along a side, and a point on the side across.

    `clicks` (3, 3) [m]; `normal` (3,) outward from that face; `depth` [m] inward from it, or None for down to the table (z = 0), for
    which the face must be level.
    """

    kind: ClassVar[str] = "box"
    clicks: NDArray
    normal: NDArray
    depth: float | None = None
    combine: Combine = "join"

    def __post_init__(self) -> None:
        keep(self, "clicks", numbers(self.clicks, (3, 3), "the clicks of a box"))
        keep(self, "normal", unit(self.normal, "the normal of a box's face"))
        if self.depth is not None:
            number(self.depth, "the depth of a box [m]")

    @property
    def told(self) -> str:
        deep = "down to the table" if self.depth is None else f"{measured(self.depth, 'm')} deep"
        return f"{self.kind} {deep}{_combined(self.combine)}"


@dataclass(frozen=True, eq=False)
class Sketch(Operation):
    """An outline on a plane, under a name that later steps use; the same name again takes the older one's place.

    `T_model_plane` (4, 4): x and y in the plane, z its normal. With `on` the plane is that of a face of the solid: it stays with the face
    when earlier steps are edited.
    """

    kind: ClassVar[str] = "sketch"
    name: str
    T_model_plane: NDArray
    outline: Outline
    on: FaceAt | None = None

    def __post_init__(self) -> None:
        keep(self, "T_model_plane", numbers(self.T_model_plane, (4, 4), "the plane of a sketch"))
        if not is_rigid(self.T_model_plane, tolerance=1e-5):
            raise BadInput(f'the plane of sketch "{self.name}" is not a rigid transform: a proper rotation, metres, last row 0 0 0 1.')
        if not self.name or len(self.name) > 60:
            raise BadInput(f"the name of a sketch has {len(self.name)} letters; it must have 1 to 60.")

    @property
    def told(self) -> str:
        return f"{self.kind} {self.name} with {len(self.outline.corners)} sides"


@dataclass(frozen=True, eq=False)
class Extrude(Operation):
    """A sketch drawn out along its plane's normal by `height` [m] (negative: to the other side), else as far as the plane of the face
    `to`, else to the table (z = 0). `holes` names sketches in the same plane that are left open."""

    kind: ClassVar[str] = "extrude"
    sketch: str
    height: float | None = None
    to: FaceAt | None = None
    combine: Combine = "join"
    holes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.height is not None:
            number(self.height, "the height of an extrusion [m]")
        if self.height is not None and self.to is not None:
            raise BadInput("an extrusion has a height or a face that it goes to; it must have one of them.")

    @property
    def told(self) -> str:
        far = "to the table" if self.to is None else "to a plane"
        far = far if self.height is None else f"by {measured(self.height, 'm')}"
        return f"{self.kind} {self.sketch} {far}{_combined(self.combine)}"


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


KINDS: dict[str, type[Operation]] = {
    operation.kind: operation
    for operation in (
        TakeSuggestion,
        AlignScan,
        Box,
        Sketch,
        Extrude,
        CutByPlane,
        MoveFace,
        MoveEdge,
        MoveCorner,
        SetDistance,
        SetLength,
        SetAngle,
        Mirror,
        Delete,
        ConfirmFace,
    )
}


def _combined(combine: Combine) -> str:
    return {"join": "", "cut": ", cut away", "common": ", only what is common kept"}[combine]
