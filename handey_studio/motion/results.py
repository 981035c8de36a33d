"""What arm motion hands on: certificates, paths, the picture of the configuration space, timed trajectories."""

from dataclasses import dataclass, replace
from typing import Literal

from numpy.typing import NDArray

from handey_studio.base import Entry, Value, frozen_array
from handey_studio.motion.curve import Curve

LegName = Literal["start", "free", "goal", "direct", "straight"]
OTHER_WAY: dict[LegName, LegName] = {"start": "goal", "goal": "start"}


@dataclass(frozen=True)
class Certificate:
    """What was proved of a path between its samples as well as at them.

    `proved`: every pair of bodies that may not touch stays at least `margin` [m] apart on the whole joint-linear path.
    `least_clearance` [m] is the least distance that was measured on it, negative for a penetration's depth, `bodies` the
    pair that was that close, and `at` the place: number of the segment and fraction along it. When the proof fails
    these tell where, and `reason` says why in words. `checks` counts the exact distances, `pairs_allowed` were left out.
    """

    least_clearance: float
    at: tuple[int, float]
    bodies: tuple[str, ...]
    proved: bool
    margin: float
    checks: int = 0
    pairs_allowed: tuple[tuple[str, str], ...] = ()
    reason: str = ""


@dataclass(frozen=True)
class Leg:
    """A stretch of a path: its points `first` to `last`, both belonging to it. The paper's three are start, free, goal."""

    name: LegName
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class CSpaceSummary(Value):
    """The configuration space of the arm joints, to be drawn.

    `blocked` (n1, n2, n3) bool: cells that are not wholly free. Cell k of joint i is centred at `centres[i][k]` [rad].
    `path_cells` (m, 3) the cells of the free leg, `start_cell` and `goal_cell` the nearest free ones to start and goal.
    `wrist_box` (8, 3) [m] are the corners of the box that stands for the wrist's links, the hand and what it holds, in
    the frame of `wrist_box_link`. `regions` counts the free regions. `step_rad` is the cells' width. `joints` (3,) tell which
    joints of a configuration these are.
    """

    step_rad: float
    centres: tuple[NDArray, ...]
    blocked: NDArray
    path_cells: NDArray
    start_cell: tuple[int, ...] | None
    goal_cell: tuple[int, ...] | None
    wrist_box: NDArray
    wrist_box_link: int
    regions: int
    joints: tuple[int, ...] = (0, 1, 2)

    def __post_init__(self) -> None:
        object.__setattr__(self, "centres", tuple(frozen_array(c) for c in self.centres))
        object.__setattr__(self, "blocked", frozen_array(self.blocked, bool))
        object.__setattr__(self, "path_cells", frozen_array(self.path_cells, int))
        object.__setattr__(self, "wrist_box", frozen_array(self.wrist_box))


@dataclass(frozen=True, eq=False)
class PathResult(Value):
    """A certified path, or why there is none.

    `q_rad` (n, joints) [rad] are its points, empty (0, joints) when there is none; `curve` is the way that the arm takes, straight between
    them but for what rounds the corners, and what the certificate speaks of. Where the hand goes straight it is at most `off_line` [m]
    from its lines. `legs` name its stretches, `needed` says what beyond the paper's three legs was needed, empty when nothing was.
    `entries` are the ledger's. `proven`: there is no path at all, for start and goal stay apart even where only what is wholly blocked
    is taken out. `separating` names the bodies of the world that the attempts met when there is no path, most often first.
    """

    status: Literal["found", "none"]
    reason: str
    q_rad: NDArray
    certificate: Certificate | None = None
    legs: tuple[Leg, ...] = ()
    needed: str = ""
    entries: tuple[Entry, ...] = ()
    space: CSpaceSummary | None = None
    cancelled: bool = False
    proven: bool = False
    curve: Curve | None = None
    off_line: float = 0.0
    separating: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "q_rad", frozen_array(self.q_rad))

    @property
    def found(self) -> bool:
        return self.status == "found"

    @property
    def way(self) -> NDArray:
        """The curve in short straight steps: its points (k, joints) [rad], or the path's own where it has none."""
        return self.q_rad if self.curve is None else self.curve.at(self.curve.chords()[0])

    @property
    def straight(self) -> bool:
        """Whether the hand goes straight, and not the joints."""
        return any(leg.name == "straight" for leg in self.legs)

    def reversed(self) -> "PathResult":
        """The same motion the other way round; its certificate holds for both directions."""
        last, certificate = len(self.q_rad) - 1, self.certificate
        if certificate is not None:
            certificate = replace(certificate, at=(max(0, last - 1 - certificate.at[0]), 1.0 - certificate.at[1]))
        legs = tuple(Leg(OTHER_WAY.get(leg.name, leg.name), last - leg.last, last - leg.first) for leg in self.legs[::-1])
        curve = None if self.curve is None else self.curve.reversed()
        return replace(self, q_rad=self.q_rad[::-1], certificate=certificate, legs=legs, curve=curve)


@dataclass(frozen=True, eq=False)
class Trajectory(Value):
    """A timed path: at `time_s` (n,) from zero, joints `q_rad` (n, joints), fingers `hand_opening_m` (n,) apart; linear between."""

    time_s: NDArray
    q_rad: NDArray
    hand_opening_m: NDArray

    def __post_init__(self) -> None:
        for key in ("time_s", "q_rad", "hand_opening_m"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))
