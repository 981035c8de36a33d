"""The steps that make a solid: a suggestion taken, a scan aligned, a box, a sketch, what is extruded from it."""

from dataclasses import dataclass
from typing import ClassVar

from numpy.typing import NDArray

from handey_studio.base import BadInput, measured
from handey_studio.geometry.transforms import is_rigid
from handey_studio.modeling.operation import Combine, Operation, combined_words
from handey_studio.modeling.outline import Outline
from handey_studio.modeling.references import FaceAt, keep, number, numbers, unit

MAX_SUGGESTED_CORNERS = 5000


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
        suggested = any(source.startswith(("seen", "assumed")) for source in self.sources)
        return f"{self.kind if suggested else 'take shape'} with {len(self.faces)} faces"


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
        return f"{self.kind} {deep}{combined_words(self.combine)}"


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
        return f"{self.kind} {self.sketch} {far}{combined_words(self.combine)}"
