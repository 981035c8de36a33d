"""What of a model is looked at, and what is under way: one frozen value in the workbench's state."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry import Polyhedron
from handey_studio.modeling.operations import Combine
from handey_studio.modeling.picking.snap import Snap
from handey_studio.modeling.references import FaceAt
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.sketching import Guides, Stroke
from handey_studio.session.mesh_files import MeshUpload
from handey_studio.session.model_files import Upload

SELECT, POINTS = "select", "align"
TO_TABLE, BY_HEIGHT, TO_FACE = "to the table", "by a height", "to a face"
BY_SCAN, BY_DISTANCE = "scan", "distance"


@dataclass(frozen=True)
class ToolSettings:
    """What is set beside the tools, in metres. `far` is how deep a box, or how far an extrusion goes."""

    far: str = TO_TABLE
    height: float = 0.05
    combine: Combine = "join"
    offset: float = 0.0
    flip: bool = False
    keep_original: bool = True
    infer: bool = True


@dataclass(frozen=True)
class Material:
    """What the part is made of: `density` [kg/m³], `friction` against the fingers."""

    density: float = 700.0
    friction: float = 0.5


@dataclass(frozen=True)
class Waiting:
    """An uploaded file that waits for the other one that belongs to it: a depth image for its camera, or a camera for its image."""

    name: str
    content: bytes


@dataclass(frozen=True, eq=False)
class MeshImport:
    """A mesh file that is to become the model: its `extents` along x, y, z in its own numbers, empty until they are known, and the `unit`
    that these make likely; why it was refused, and the `tolerance` [m] that would help, 0 where none is known."""

    upload: MeshUpload
    extents: tuple[float, ...] = ()
    unit: str = "mm"
    refusal: str = ""
    tolerance: float = 0.0


@dataclass(frozen=True, eq=False)
class Drawing:
    """A sketch in the making on the plane `T_model_plane` (4, 4), which is that of the model's face `on` if it is one."""

    T_model_plane: NDArray
    on: FaceAt | None
    guides: Guides
    stroke: Stroke = field(default_factory=Stroke)


@dataclass(frozen=True, eq=False)
class Worked:
    """An outcome worked out in the background for what was `asked`; None when that failed."""

    asked: tuple
    outcome: Any


@dataclass(frozen=True, eq=False)
class ModelLook:
    """How the model is looked at, and what a person is doing with it. All lengths [m], in the model's frame."""

    open: bool = False  # the scene shows the model, not the MOVE
    tool: str = SELECT
    clicks: tuple[Snap, ...] = ()  # what the tool has so far
    drawing: Drawing | None = None
    picked: tuple[Snap, ...] = ()  # what is selected
    settings: ToolSettings = ToolSettings()
    material: Material = Material()
    object_at: tuple[int, float, float] | None = None  # scan, u, v: the pixel of the object that a model is wanted of
    new_object: int = 0  # of a new scan, the number of the object that is aligned
    pairs: tuple[tuple[NDArray, NDArray], ...] = ()  # points (3,) picked for that, in the model's frame and in the scan's world
    alternative: int = 0  # which of the poses that fit
    step: int | None = None  # the model is shown as after so many steps, None for all of them
    check: int = -1  # the check that is pointed at
    colours: str = BY_SCAN
    unit: str = "m"  # of clouds that are uploaded
    waiting: Waiting | None = None
    reading: Upload | None = None
    mesh: MeshImport | None = None
    trial: Scan | None = None  # the scan in which the model is looked for
    part: str = ""  # the part of the library that is pointed at
    saves: int = 0  # how often a part was kept, so that the library is read again
    preview: Polyhedron | None = None  # the solid as it would be after the drag that is under way
    drags: int = 0
    eye: NDArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))  # where the last click came from
    patches: tuple[Worked, ...] = ()  # the planar faces of scans
    worked: tuple[tuple[str, Worked], ...] = ()  # what else the background worked out, by its name
