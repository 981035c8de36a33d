"""What localization says: the poses, the edges it saw, the hypotheses it weighed and why each fell."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Entry, Value, frozen_array, rejected_counts
from handey_studio.localization.segments import DataEdge


@dataclass(frozen=True)
class LocateOptions:
    """`max_poses` instances of a part are looked for. A pose is accepted if it is right with a probability of at least `min_score`
    and at least `min_visible_fraction` of the faces turned to the sensor is seen. Data edges shorter than `min_edge_m` [m] are left
    out (None: by the view's pixels). `max_hypotheses` are verified and the best `max_refined` refined. `table_z_m` is the
    height [m] below which no part can be (None: no such plane)."""

    max_poses: int = 5
    min_score: float = 0.31
    min_visible_fraction: float = 0.15
    min_edge_m: float | None = None
    max_data_edges: int = 600
    max_hypotheses: int = 40000
    max_refined: int = 120
    table_z_m: float | None = 0.0


@dataclass(frozen=True, eq=False)
class Rival(Value):
    """What readings could be as well: a `part` at a pose (4, 4), with the `probability` that it is that."""

    part: str
    T_world_part: NDArray
    probability: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))


@dataclass(frozen=True, eq=False)
class LocatedPose(Value):
    """A part found. Transforms (4, 4); `score` in [0, 1] is the probability that it is right
    (before coarse sensors a rule on agreement, see `score`);
    `visible_fraction` of the faces turned to the sensor is seen; `surface_rms_m` [m] how far
    readings lie off them; `margin_m` [m] what the sensor lost at silhouettes, `sigma_m` [m] the standard deviation of its
    loosest point; `rivals` what else its readings could be, the most probable first."""

    part: str
    T_world_part: NDArray
    T_sensor_part: NDArray
    score: float
    edges_predicted: int
    edges_found: int
    visible_fraction: float
    surface_rms_m: float
    margin_m: float = 0.0
    sigma_m: float = 0.0
    rivals: tuple[Rival, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))
        object.__setattr__(self, "T_sensor_part", frozen_array(self.T_sensor_part))


@dataclass(frozen=True, eq=False)
class Hypothesis(Value):
    """A pose that was weighed: from one or two data edges `data` assigned to model edges `model` (their numbers), its `score`, and what was
    found and what was missing [m of edge]; `reason` says why it fell, None if it was accepted, and the ledger's entry number `entry`
    by how much (-1: none); of an accepted one `rivals` tell what else its readings could be."""

    part: str
    T_world_part: NDArray
    score: float
    found_m: float
    missing_m: float
    data: tuple[int, ...]
    reason: str | None
    model: tuple[int, ...] = ()
    entry: int = -1
    rivals: tuple[Rival, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))


@dataclass(frozen=True, eq=False)
class LocateResult(Value):
    """`poses` best first; `edges` found in the view; up to 50 `hypotheses` for the screen; `fell` counts assignments of edge
    pairs by the parameter that they failed; `timing_s` seconds a stage. Nothing found: `poses` is empty and `reason` says why."""

    poses: tuple[LocatedPose, ...]
    edges: tuple[DataEdge, ...]
    hypotheses: tuple[Hypothesis, ...]
    ledger: tuple[Entry, ...]
    timing_s: dict[str, float] = field(default_factory=dict)
    fell: dict[str, int] = field(default_factory=dict)
    reason: str = ""
    cancelled: bool = False

    @property
    def rejected(self) -> dict[str, int]:
        """How many assignments and hypotheses fell for each reason."""
        return {**self.fell, **rejected_counts(self.ledger)}


def pose_matrix(R: NDArray, t: NDArray) -> NDArray:
    """T (4, 4) from a rotation (3, 3) and a translation (3,)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T
