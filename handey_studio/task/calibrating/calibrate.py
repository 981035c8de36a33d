"""Calibrating the range finder to the robot (Handey 1987 §6): the hand shows the cube here and there, each pose scanned.

The fingers hold the cube by two upright faces, the hand level, so that its upper face stands clear above hand and fingers: a range finder
that looks down sees all of it. The first three poses are the paper's.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Entry, Ledger, Progress, Share, Silent, Value, frozen_array
from handey_studio.cell.protocol import CannotAct, Cell
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, inverse, rotate, transform
from handey_studio.motion import PathResult, plan_path, plan_reach, time_path
from handey_studio.sensing.cube_face import CubeFace, find_cube_face
from handey_studio.sensing.frame_fit import FitOptions, FrameFit, fit_frame
from handey_studio.sensing.range_calibration import Shown, TablePoint, three_pose_frame
from handey_studio.sensing.support import support_plane
from handey_studio.task.calibrating.places import SPARE_M, UNDER_M, YAWS_DEG, other_hands, stage_of, three_hands
from handey_studio.task.run import Station
from handey_studio.world import Block, Held, Part, Robot, World, arm_of

CUBE = "calibration cube"
STAGE = "calibration"
PLAY_M = 0.005  # that the cube may sit elsewhere in the hand than it is said to
HOLD_M = 0.02  # the fingers' tips reach so far past the cube's rim
WIDTH_M = 0.003  # that the fingers' opening may differ from the cube's side
STANDING_M = 0.01  # lower is the table's own
ON_SIGMAS = 3.0


@dataclass(frozen=True)
class CalibrateOptions:
    """`poses` of the cube to be shown, the paper's three among them; `side_m` of the cube; `seed` of the places."""

    poses: int = 10
    side_m: float = 0.05
    seed: int = 0
    fit: FitOptions = field(default_factory=FitOptions)

    def __post_init__(self) -> None:
        if not 3 <= self.poses <= 100:
            raise BadInput(f"{self.poses} poses cannot be shown; it takes 3 to 100.")
        if not 0.03 <= self.side_m <= 0.12:
            raise BadInput(f"a cube of {1e3 * self.side_m:.0f} mm cannot be shown; its sides are 30 to 120 mm.")


@dataclass(frozen=True, eq=False)
class Showing(Value):
    """One pose of the cube: the hand's as the joints had it (4, 4), and the face that was seen, or why not."""

    T_world_hand: NDArray
    face: CubeFace

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_hand", frozen_array(self.T_world_hand))


@dataclass(frozen=True, eq=False)
class RangeCalibration(Value):
    """What came of a calibration. `T_world_range_before` (4, 4) was believed; `fit` is the least-squares answer with upright axes, `free`
    the one that may lean, `three` (4, 4) the paper's from three poses. None where the poses did not come about: then `reason` says why."""

    status: Literal["found", "failed"]
    reason: str
    T_world_range_before: NDArray
    showings: tuple[Showing, ...] = ()
    fit: FrameFit | None = None
    free: FrameFit | None = None
    three: NDArray | None = None
    ledger: tuple[Entry, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_range_before", frozen_array(self.T_world_range_before))
        if self.three is not None:
            object.__setattr__(self, "three", frozen_array(self.three))


def cube_in_hand(side: float) -> NDArray:
    """T_hand_cube (4, 4): how the cube is said to sit in the hand, aligned with it and past the fingers' tips; anywhere near does."""
    return transform(None, (0.0, 0.0, side / 2 - HOLD_M))


def calibrate_range(
    station: Station, cell: Cell, options: CalibrateOptions = CalibrateOptions(), progress: Progress = Silent()
) -> RangeCalibration:
    """Show the cube, which is in the hand, at several poses and fit the range finder's frame. The arm comes home in the end.

    Scans may come from any sensor that makes depth maps: what they say is taken into the frame of `workcell.finder`, and that is fitted.
    Nothing is believed of where it stands, but within `SPARE_M` and a few degrees: what it sees on the table counts as
    standing everywhere around, as high as its highest reading. A pose that is not reached or not seen is told, and another taken.
    """
    before, ledger = station.workcell.finder.T_world_range, Ledger()
    try:
        table, standing = _look(cell, before, station.workcell.table_z)
        world, held = _world(station, standing), _take(cell, station.robot, options.side_m)
        session = _Showman(station, cell, options, world, table, standing.top, held, cell.opening(), ledger, [])
        session.show_all(Share(progress, 0.05, 0.95))
        session.come_home(Share(progress, 0.95, 1.0))
    except CannotAct as error:
        return RangeCalibration("failed", str(error), before, ledger=ledger.entries)
    return replace(_answer(session, before, progress), ledger=ledger.entries)


def _take(cell: Cell, robot: Robot, side: float) -> Held:
    """The cube, firmly held: the fingers close on it. For planning it is larger, as nobody knows just where in the hand it is."""
    ended = cell.grip(max(robot.hand.opening_min, side - WIDTH_M)).ended
    opening = cell.opening()
    if ended != "contact" or abs(opening - side) > WIDTH_M:
        told = f"{1e3 * opening:.1f} mm apart, the cube has {1e3 * side:.1f} ± {1e3 * WIDTH_M:.0f} mm"
        raise CannotAct(f"the fingers closed until they were {told}; put the cube between them.")
    return Held(CUBE, Part(CUBE, box((side + 2 * PLAY_M,) * 3)), cube_in_hand(side))


class _Standing(NamedTuple):
    """What stands on the table: how high [m] above it, and from where to where (2,) [m] in the range frame; unread cells count too."""

    top: float
    low: NDArray
    high: NDArray


def _look(cell: Cell, T_world_range: NDArray, table_z: float) -> tuple[TablePoint, _Standing]:
    """A point of the table, and what stands on it, in the range frame, from a scan with the arm at home."""
    seen = cell.scan()
    view, T_range_map = seen.view(), inverse(T_world_range) @ seen.T_world_range
    found = support_plane(view, np.random.default_rng(0))
    if not found.found:
        raise CannotAct(f"the table was not found in the scan: {found.reason}.")
    heights = apply(found.T_world_sensor, view.points_sensor())[::-1, :, 2]  # in the map's own order of rows
    with np.errstate(invalid="ignore"):
        j, i = np.nonzero(np.abs(heights) < ON_SIGMAS * max(seen.noise, found.rms))
        v, u = np.nonzero(~(heights <= STANDING_M))
    table = apply(T_range_map, np.append((np.mean([i, j], axis=1) + 0.5) * seen.cell, seen.elevation[j, i].mean()))
    if not len(u):
        return TablePoint(table, table_z), _Standing(0.0, table[:2], table[:2])
    standing = apply(T_range_map, np.stack([(u + 0.5) * seen.cell, (v + 0.5) * seen.cell, np.zeros(len(u))], axis=1))[:, :2]
    return TablePoint(table, table_z), _Standing(float(np.nanmax(heights)), standing.min(axis=0), standing.max(axis=0))


def _world(station: Station, standing: _Standing) -> World:
    """The workcell's own things, and a block about all that stands on the table, wherever the range finder may really be."""
    workcell, blocks = station.workcell, station.workcell.blocks
    if standing.top > STANDING_M:
        size = np.append(standing.high - standing.low + 2 * SPARE_M, standing.top + UNDER_M)
        T = workcell.finder.T_world_range.copy()
        T[:3, 3] = apply(T, np.append((standing.low + standing.high) / 2, 0.0))
        T[2, 3] = workcell.table_z + size[2] / 2
        blocks = (*blocks, Block("what stands on the table", size, T))
    return World(station.robot, workcell.table_z, blocks, free_space=workcell.free_space)


@dataclass
class _Showman:
    """The work in progress: where the cube was shown so far. It lives as long as one calibration does."""

    station: Station
    cell: Cell
    options: CalibrateOptions
    world: World
    table: TablePoint
    top: float
    held: Held
    opening: float
    ledger: Ledger
    showings: list[Showing]
    three: tuple[int, ...] = ()

    def show_all(self, progress: Progress) -> None:
        """The paper's three poses, with the first heading of the hand that allows them all; then others until there are enough."""
        finder, options = self.station.workcell.finder, self.options
        stage = stage_of(finder, self.world.table_z, self.top, options.side_m)
        for yaw in YAWS_DEG:
            if progress.cancelled or self._show_three(three_hands(stage, yaw), progress):
                break
        for hand in other_hands(stage, options.poses, options.seed):
            if len(self._seen) >= options.poses or progress.cancelled:
                return
            self._show(hand, progress)

    def _show_three(self, hands: Iterable[NDArray], progress: Progress) -> bool:
        """The paper's poses, until one fails; whether all came about."""
        numbers: list[int] = []
        for hand in hands:
            number = self._show(hand, progress)
            if number is None:
                return False
            numbers.append(number)
        self.three = tuple(numbers)
        return True

    @property
    def _seen(self) -> list[Showing]:
        return [showing for showing in self.showings if showing.face.found]

    def come_home(self, progress: Progress) -> None:
        home = plan_path(self.world, self.cell.joints(), self.station.robot.home, self.opening, self.held, progress=progress)
        self.ledger.adopt(home.entries, parent=self.ledger.add(STAGE, "the way home", home.reason or None))
        if home.found:
            self._follow(home)

    def _show(self, T_world_hand: NDArray, progress: Progress) -> int | None:
        """Go there, scan, look for the face; the showing's number if it was seen. Every failure is in the ledger."""
        number = len(self.showings)
        seen, wanted = len(self._seen), self.options.poses
        progress.report(min(0.99, seen / wanted), f"{seen} of {wanted} poses seen; showing the cube at place {number + 1}")
        x, y, z = 1e3 * T_world_hand[:3, 3]
        entry = self.ledger.add(STAGE, f"the hand at {x:.0f}, {y:.0f}, {z:.0f} mm")
        path = plan_reach(self.world, self.cell.joints(), T_world_hand, self.opening, self.held)
        self.ledger.adopt(path.entries, parent=entry)
        if not path.found:
            self.ledger.fall(entry, path.reason, bodies=path.separating[:2])
            return None
        self._follow(path)
        seen = self.cell.scan()
        face = find_cube_face(seen, self.options.side_m)
        T_range_map = inverse(self.station.workcell.finder.T_world_range) @ seen.T_world_range
        face = replace(face, middle_range=apply(T_range_map, face.middle_range), normal_range=rotate(T_range_map, face.normal_range))
        if face.found and face.middle_range[2] < self.table.point_range[2] + self.top:
            face = replace(face, found=False, reason="the face that was found is no higher than what stands on the table")
        if not face.found:
            self.ledger.fall(entry, face.reason)
        self.showings.append(Showing(arm_of(self.station.robot).hand_pose(self.cell.joints()), face))
        return number if face.found else None

    def _follow(self, path: PathResult) -> None:
        """Along the path; `CannotAct` when the arm does not arrive, or comes without the cube."""
        moved = self.cell.follow(time_path(self.station.robot, path, self.opening))
        if moved.ended != "arrived":
            raise CannotAct(f"the arm did not arrive where the cube was to be shown: it was {moved.ended}.")
        opening = self.cell.opening()
        if abs(opening - self.opening) > WIDTH_M:
            raise CannotAct(f"the cube was lost on the way: the fingers went from {1e3 * self.opening:.1f} to {1e3 * opening:.1f} mm.")


def _answer(session: _Showman, before: NDArray, progress: Progress) -> RangeCalibration:
    """The fits of what was shown."""
    showings, wanted = tuple(session.showings), session.options.poses
    shown = [Shown(showing.T_world_hand, showing.face.middle_range) for showing in showings if showing.face.found]
    result = RangeCalibration("failed", "", before, showings)
    if progress.cancelled:
        return replace(result, reason="cancelled")
    if len(shown) < 3:
        return replace(result, reason=f"the cube was seen at {len(shown)} of {wanted} poses, a frame takes 3; the ledger tells why.")
    upright, free = (fit_frame(shown, session.table, replace(session.options.fit, upright=way)) for way in (True, False))
    three = [showings[number] for number in session.three]
    frame = three_pose_frame([Shown(s.T_world_hand, s.face.middle_range) for s in three], session.table) if three else None
    short = "" if len(shown) >= wanted else f"only {len(shown)} of {wanted} poses came about; the ledger tells why."
    return replace(result, status="found", reason=short, fit=upright, free=free, three=frame)
