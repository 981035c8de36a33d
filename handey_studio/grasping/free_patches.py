"""Where a part can be put down for a while: free patches of the table, or of anything level (Handey 1987 §5.3).

Space that no reading vouches for is solid, so a patch lies where the depth map or the workcell says that nothing is.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Entry, Ledger, Value, frozen_array
from handey_studio.geometry.transforms import apply, from_xyz_rpy, rotate
from handey_studio.grasping.solid_heights import SolidHeights, body_cells, body_planes, solid_heights
from handey_studio.world import Part, Robot, World, arm_of, hand_hulls
from handey_studio.world.collision_bodies import TABLE_SKIN_M

FITS, NOT_LEVEL, PART_BLOCKED, HAND_BLOCKED, OUT_OF_REACH = range(5)
WORDS = {
    NOT_LEVEL: "it is no table there, or not level",
    PART_BLOCKED: "something stands where the part would",
    HAND_BLOCKED: "something stands where the hand would",
    OUT_OF_REACH: "the arm does not reach the hand's pose",
}
ON_PLANE_M = 2e-5  # corners this near the plane are those that the part stands on
CHUNK = 256  # places that are looked at together
TURNED = np.diag([-1.0, -1.0, 1.0, 1.0])  # the hand looks the same with its fingers swapped


@dataclass(frozen=True)
class PatchOptions:
    """Lengths in metres. The part keeps `part_gap` from everything that it does not stand on, the open hand `hand_gap`; what it stands on
    is level within `level`. At most `count` patches, `spacing` apart, in a ring around the robot's base between the shares `nearest` and
    `farthest` of its reach, those near the share `best` first. `raised` asks for patches that are not the table as well, after those.
    `area` (x0, y0, x1, y1) [m] in the world holds the places, which may be anywhere if it is None."""

    count: int = 6
    spacing: float = 0.06
    cell: float = 0.005
    yaws: int = 12
    part_gap: float = 0.008
    hand_gap: float = 0.004
    level: float = 0.002
    nearest: float = 0.28
    best: float = 0.46
    farthest: float = 0.75
    raised: bool = False
    area: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class Patch(Value):
    """A place to put the part down: its pose (4, 4) there, the height [m] of what it stands on, and whether that is the table."""

    T_world_part: NDArray
    height: float
    on_table: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))


class Wanted(NamedTuple):
    """A grasp that the patch must leave room for: the hand's pose (4, 4) in the part's frame and its opening [m]."""

    T_part_hand: NDArray
    opening: float


class _Footprints(NamedTuple):
    """What must be free around a place, yaw by yaw: `cells` (m, 2) counted from the place and how high [m] above the plane each may be
    filled (`room`); yaw k has those from `first[k]` to `first[k + 1]`, from `hand[k]` on the hand's. The part stands on the cells
    `stands_on` (s, 2), from `stand_first[k]` to `stand_first[k + 1]`, which must be `level` [m]."""

    cells: NDArray
    room: NDArray
    first: NDArray
    hand: NDArray
    stands_on: NDArray
    stand_first: NDArray
    level: float


def free_patches(
    world: World,
    part: Part,
    T_plane_part: NDArray,
    wanted: tuple[Wanted, ...] = (),
    near: NDArray | None = None,
    options: PatchOptions = PatchOptions(),
) -> tuple[tuple[Patch, ...], tuple[Entry, ...]]:
    """Poses where the part can stand as `T_plane_part` (4, 4) says, turned by any yaw, the best first and spread out, and the ledger of how
    many others fell for what. A placement has such a pose, and each row of the grasp–placement table.

    The part must not be in the world. The open hand must fit around it in every `wanted` grasp, and the arm must reach it. `near` (2,) [m]
    in the world draws the patches towards it, such as where the part is now.
    """
    ground, places = _ground(world, near, options)
    yaws = np.arange(options.yaws) * 2 * np.pi / options.yaws
    turns = [from_xyz_rpy((0, 0, 0), (0, 0, yaw)) for yaw in yaws]
    prints = _footprints(turns, T_plane_part, part, wanted, world.robot, options)
    poses = [turn @ T_plane_part for turn in turns]
    ledger, found = Ledger(), []
    for raised in (False, True)[: 1 + options.raised]:
        counts = np.zeros(len(WORDS) + 1, dtype=int)
        patches = _patches(world, ground, places, poses, prints, wanted, raised, counts)
        while len(found) < options.count and (patch := next(patches, None)) is not None:
            if all(np.linalg.norm(patch.T_world_part[:2, 3] - other.T_world_part[:2, 3]) >= options.spacing for other in found):
                found.append(patch)
        for code, words in WORDS.items():
            if counts[code]:
                option = f"{counts[code]} raised places" if raised else f"{counts[code]} places on the table"
                ledger.add("free patch", option, words, value=float(counts[code]))
    return tuple(found), ledger.entries


@lru_cache(maxsize=8)
def reach_around(robot: Robot, samples: int = 4000) -> float:
    """How far [m] from its base's axis the arm carries its hand: the farthest of many configurations."""
    rng = np.random.default_rng(0)
    hands = arm_of(robot).hand_pose(rng.uniform(robot.lower, robot.upper, (samples, len(robot.lower))))
    return float(np.linalg.norm(hands[:, :2, 3] - robot.T_world_base[:2, 3], axis=1).max())


def _ground(world: World, near: NDArray | None, options: PatchOptions) -> tuple[SolidHeights, NDArray]:
    """The heights around the robot, and the cells (n, 2) of the places that are worth a look, best first."""
    reach, base = reach_around(world.robot), world.robot.T_world_base[:2, 3]
    wide = options.cell * np.ceil((options.farthest * reach + 0.3) / options.cell)
    x, y = ((float(base[a] - wide), float(base[a] + wide)) for a in (0, 1))
    ground = solid_heights(world, x, y, options.cell)
    step = max(1, round(options.spacing / 3 / options.cell))
    centres = ground.centres(step)
    distance = np.linalg.norm(centres - base, axis=-1) / reach
    cost = np.abs(distance - options.best) + np.where(ground.seen[::step, ::step], 0.0, 0.5)
    if near is not None:
        cost += np.linalg.norm(centres - near, axis=-1) / reach
    inside = (distance >= options.nearest) & (distance <= options.farthest)
    if options.area is not None:
        inside &= ((centres >= options.area[:2]) & (centres <= options.area[2:])).all(axis=-1)
    order = np.argsort(cost[inside], kind="stable")
    return ground, np.argwhere(inside)[order] * step


def _patches(
    world: World,
    ground: SolidHeights,
    places: NDArray,
    poses: list[NDArray],
    prints: _Footprints,
    wanted: tuple[Wanted, ...],
    raised: bool,
    counts: NDArray,
) -> Iterator[Patch]:
    """Every place that will do, at the first yaw that will, in the order of `places`; `counts` of the others grow by what spoke last."""
    heights = ground.heights.copy()
    for start in range(0, len(places), CHUNK):
        chunk = places[start : start + CHUNK]
        codes, levels = _fits(heights, chunk, prints, world.table_z, raised)
        fits = (codes == FITS).any(axis=1)
        counts += np.bincount(codes[~fits].max(axis=1), minlength=len(counts))
        for n in np.nonzero(fits)[0]:
            x, y = ground.origin + (chunk[n] + 0.5) * ground.cell
            for yaw in np.nonzero(codes[n] == FITS)[0]:
                T_world_part = from_xyz_rpy((x, y, levels[n, yaw])) @ poses[yaw]
                if _reached(world.robot, T_world_part, wanted):
                    yield Patch(T_world_part, float(levels[n, yaw]), not raised)
                    break
            else:
                counts[OUT_OF_REACH] += 1


def _reached(robot: Robot, T_world_part: NDArray, wanted: tuple[Wanted, ...]) -> bool:
    """Whether the arm has a configuration within its limits for every wanted grasp, either way round."""
    arm = arm_of(robot)
    for T_part_hand, _ in wanted:
        branches = [arm.ik(T_world_part @ T_part_hand @ turn) for turn in (np.eye(4), TURNED)]
        if not any(len(q) and robot.limit_margin(arm.nearest_turns(q, robot.home)).max() > 0 for q in branches):
            return False
    return True


class _Body(NamedTuple):
    """A convex body at yaw 0: corners (n, 3), planes (m, 4), how much it is grown [m], and how high [m] above the plane a cell below it may
    be filled anyway: what lies on the plane may stand out of it a little, and a hand just above it need not keep its whole gap."""

    corners: NDArray
    planes: NDArray
    grown: float
    least: float


def _footprints(
    turns: list[NDArray], T_plane_part: NDArray, part: Part, wanted: tuple[Wanted, ...], robot: Robot, options: PatchOptions
) -> _Footprints:
    """The cells below the part and the hand around a place, which is the centre of its cell, for each of the turns (4, 4) about it."""
    pieces = [apply(T_plane_part, piece) for piece in part.pieces]
    boxes = [apply(T_plane_part @ want.T_part_hand, box) for want in wanted for box in hand_hulls(robot, want.opening).values()]
    bodies = [_Body(piece, body_planes(piece), options.part_gap, options.level) for piece in pieces]
    bodies += [_Body(box, body_planes(box), options.hand_gap, min(0.0, float(box[:, 2].min()))) for box in boxes]
    corners = apply(T_plane_part, part.solid.vertices)
    foot = corners[corners[:, 2] < ON_PLANE_M]
    foot = np.concatenate([foot, foot + np.array([0.0, 0.0, 1e-3])])
    stand = _Body(foot, body_planes(foot), options.cell, 0.0)
    below = [[_below(body, turn, options.cell) for body in bodies] for turn in turns]
    cells, room = ([np.concatenate([found[k] for found in each]) for each in below] for k in (0, 1))
    hand = np.array([sum(len(found) for found, _ in each[: len(pieces)]) for each in below])
    stands_on = [_below(stand, turn, options.cell)[0] for turn in turns]
    first, stand_first = (np.cumsum([0] + [len(found) for found in each]) for each in (cells, stands_on))
    joined = (np.concatenate(each) for each in (cells, room, stands_on))
    return _Footprints(next(joined), next(joined), first, first[:-1] + hand, next(joined), stand_first, options.level)


def _below(body: _Body, turn: NDArray, cell: float) -> tuple[NDArray, NDArray]:
    """Cells (m, 2) under a body turned about the place, counted from it, and how high [m] above the plane each may be filled."""
    planes = np.c_[rotate(turn, body.planes[:, :3]), body.planes[:, 3]]
    lower, covered, lowest = body_cells(apply(turn, body.corners), planes, np.full(2, -0.5 * cell), cell, upper=False, grown=body.grown)
    return np.argwhere(covered) + lower, np.maximum(lowest[covered], body.least)


@njit(cache=True)
def _fits(heights: NDArray, places: NDArray, prints: _Footprints, table: float, raised: bool) -> tuple[NDArray, NDArray]:
    """For every place (n, 2) and yaw what speaks against it, or FITS, and the height (n, yaws) [m] of what the part would stand on."""
    yaws = len(prints.hand)
    codes, levels = np.zeros((len(places), yaws), np.int64), np.zeros((len(places), yaws))
    for n in range(len(places)):
        i, k = places[n]
        for yaw in range(yaws):
            low, high = np.inf, -np.inf
            for s in range(prints.stand_first[yaw], prints.stand_first[yaw + 1]):
                height = _height(heights, i + prints.stands_on[s, 0], k + prints.stands_on[s, 1])
                low, high = min(low, height), max(high, height)
            on_table = high <= table + TABLE_SKIN_M
            levels[n, yaw] = table if on_table else high
            if on_table == raised or high == np.inf or high - low > prints.level:
                codes[n, yaw] = NOT_LEVEL
                continue
            for m in range(prints.first[yaw], prints.first[yaw + 1]):
                if _height(heights, i + prints.cells[m, 0], k + prints.cells[m, 1]) > levels[n, yaw] + prints.room[m]:
                    codes[n, yaw] = PART_BLOCKED if m < prints.hand[yaw] else HAND_BLOCKED
                    break
    return codes, levels


@njit(cache=True)
def _height(heights: NDArray, i: int, k: int) -> float:
    """The height of a cell; outside the grid everything is solid."""
    if i < 0 or k < 0 or i >= heights.shape[0] or k >= heights.shape[1]:
        return np.inf
    return heights[i, k]
