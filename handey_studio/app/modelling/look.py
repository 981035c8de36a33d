"""What of a model is looked at, and what is under way: one frozen value in the workbench's state."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.modeling.operations import Combine
from handey_studio.modeling.references import FaceAt
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.sketching import Guides, Stroke
from handey_studio.modeling.snap import Snap
from handey_studio.session.model_files import Upload

SELECT = "select"
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
    """How the model is looked at. `open`: the scene shows the model, not the MOVE.

    `clicks` and `drawing` are what the active `tool` has so far, `picked` what is selected. `object_at` (scan, u, v) is the pixel at
    which an object was clicked that a model is wanted of. `step`: the model is shown as after that many steps, None for all of them.
    Of a new scan `new_object` is the number of the object that is aligned, by picked `pairs` of points if there are three: in the model's
    frame and in the scan's world (3,) [m]; `alternative` counts the poses that fit. `check` is the check that is pointed at, `part` the
    library's part that is. In the scan `trial` the model is looked for. `waiting` and `reading` are uploads under way, `saves` counts
    parts that were kept. `eye` (3,) [m] is where the last click came from. `worked` keeps what was worked out in the background, by name.
    """

    open: bool = False
    tool: str = SELECT
    clicks: tuple[Snap, ...] = ()
    drawing: Drawing | None = None
    picked: tuple[Snap, ...] = ()
    settings: ToolSettings = ToolSettings()
    material: Material = Material()
    object_at: tuple[int, float, float] | None = None
    new_object: int = 0
    pairs: tuple[tuple[NDArray, NDArray], ...] = ()
    step: int | None = None
    alternative: int = 0
    check: int = -1
    colours: str = BY_SCAN
    unit: str = "m"
    part: str = ""
    saves: int = 0
    waiting: Waiting | None = None
    reading: Upload | None = None
    trial: Scan | None = None
    eye: NDArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    patches: tuple[Worked, ...] = ()
    worked: tuple[tuple[str, Worked], ...] = ()
