"""Random MOVEs that can be done, by construction: first a pick and place that is known to be good, then clutter around it.

What is known is the grasp, the arm's configurations at both ends, and the way straight up from them. The clutter keeps out of these
and out of nothing else, so it leans on the part and crowds the hand. Nothing of this is told to the planner.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody, fixed_bodies, solid_body
from handey_studio.cell.check.penetration import Polytope, overlap, polytope, polytopes_of
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.scenes.alike import seen_alike
from handey_studio.cell.scenes.fitness import visible_share
from handey_studio.cell.scenes.piles import Pile, destination
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, pose_difference, transform
from handey_studio.grasping import (
    GraspEnd,
    grasp_groups,
    grasp_placement_table,
    hand_in_plane,
    legal_rotations,
    sequences,
    stable_placements,
    tilts_at,
)
from handey_studio.world import FINGERS, ConvexBody, Part, PlacedPart, Robot, World, arm_of
from handey_studio.world.collision import collision_model
from handey_studio.world.library import Library

RAISED_M = (0.0, 0.04, 0.08, 0.12)
STABLE_M, STABLE_RAD = 0.001, np.deg2rad(0.5)


@dataclass(frozen=True)
class SolvableOptions:
    """Lengths in metres, angles in radians. `blocks` least and most blocks of clutter, with `sides`, dropped within `spread` of either
    end of the motion; they stay `play` away from the known-good hand. The ends are `apart`, `inside` the scanned area."""

    blocks: tuple[int, int] = (4, 9)
    sides: tuple[float, float] = (0.015, 0.055)
    spread: float = 0.045
    play: float = 0.004
    inside: float = 0.07
    apart: float = 0.13
    visible: float = 0.6
    most_tilt: float = np.deg2rad(40.0)
    joint_margin: float = np.deg2rad(10.0)
    attempts: int = 60


def solvable_move(
    seed: int, part: str, library: Library, robot: str = "ur5", regrasp: bool = False, options: SolvableOptions = SolvableOptions()
) -> Pile:
    """A MOVE of a part among clutter, the same for the same seed; with `regrasp` one whose start and goal have no grasp in common.

    Raises BadInput when no attempt gives one.
    """
    workcell, model, arm_robot = Workcell(robot=robot, parts=(part,)), library.part(part), library.robot(robot)
    rng = np.random.default_rng([seed, int(regrasp)])
    for attempt in range(1, options.attempts + 1):
        ends = _turned_over(workcell, model, arm_robot, rng, options) if regrasp else _kept_up(workcell, model, arm_robot, rng, options)
        if ends is None:
            continue
        T_start, T_goal, hands = ends
        bodies = _cluttered(workcell, model, arm_robot, T_start, T_goal, hands, rng, options)
        if bodies is None:
            continue
        setup = SimulatedSetup(tuple(_true_body(body, part) for body in bodies if not body.fixed), seed=seed, physics=False)
        cell = Workcell(robot, (part,), workcell.blocks, workcell.free_space, workcell.table_z, workcell.finder, setup)
        return Pile(cell, part, destination(T_goal), T_goal, attempt)
    raise BadInput(f'no MOVE of part "{part}" with seed {seed} came out solvable in {options.attempts} attempts.')


Hands = list[tuple[NDArray, float, PlacedPart]]
"""Where the hand is known to be good (4, 4), its opening [m], and the part as it stands there."""


def _places(workcell: Workcell, model: Part, rng: np.random.Generator, options: SolvableOptions) -> tuple[NDArray, NDArray, int, int]:
    """Two stable poses in the scanned area, the first one told apart from above, and the numbers of their placements."""
    placements, _ = stable_placements(model)
    area = np.array(workcell.finder.area)
    spots = rng.uniform(options.inside, area - options.inside, (2, 2))
    while np.linalg.norm(spots[1] - spots[0]) < options.apart:
        spots = rng.uniform(options.inside, area - options.inside, (2, 2))
    kinds = rng.integers(len(placements), size=2)
    alike = seen_alike(model)
    while alike[kinds[0]] and not all(alike):
        kinds[0] = rng.integers(len(placements))
    poses = []
    for spot, kind in zip(spots, kinds, strict=True):
        x, y, _ = apply(workcell.finder.T_world_range, (*spot, 0.0))
        poses.append(from_xyz_rpy((x, y, workcell.table_z), (0, 0, rng.uniform(-np.pi, np.pi))) @ placements[kind].T_plane_part)
    return poses[0], poses[1], int(kinds[0]), int(kinds[1])


def _world(workcell: Workcell, robot: Robot, placed: PlacedPart, clutter: Sequence[SolidBody] = ()) -> World:
    solids = tuple(
        ConvexBody(f"{body.name}/{k}", apply(body.T_world_body, piece)) for body in clutter for k, piece in enumerate(body.pieces)
    )
    return World(robot, workcell.table_z, (*workcell.blocks, *solids), (placed,), None, workcell.free_space)


def _kept_up(
    workcell: Workcell, model: Part, robot: Robot, rng: np.random.Generator, options: SolvableOptions
) -> tuple[NDArray, NDArray, Hands] | None:
    """A pick and place with one grasp that keeps the side up that is up, or turns it as the grasp allows."""
    T_start, T_goal, _, _ = _places(workcell, model, rng, options)
    if rng.random() < 0.7:  # most MOVEs keep the resting side
        x, y = apply(T_goal, model.solid.volume_and_centroid[1])[:2] - apply(T_start, model.solid.volume_and_centroid[1])[:2]
        centre = apply(T_start, model.solid.volume_and_centroid[1])
        turn = transform(Rotation.from_rotvec((0, 0, rng.uniform(-np.pi, np.pi))).as_matrix())
        about = transform(None, centre) @ turn @ transform(None, -centre)
        T_goal = transform(None, (x, y, 0.0)) @ about @ T_start
    placed = [PlacedPart("part", model, T) for T in (T_start, T_goal)]
    ends = [GraspEnd(_world(workcell, robot, here), here.T_world_part) for here in placed]
    groups, _ = grasp_groups(model, robot.hand)
    for g in rng.permutation(len(groups))[:24]:
        rotations = legal_rotations(groups[g], ends[0], ends[1])
        opening = groups[g].opening(robot.hand)
        for angle in rotations.best(2):
            if rotations.tilts(np.array([angle])).max() > options.most_tilt:
                continue
            T_part_hand = groups[g].grasp_class.T_part_plane @ hand_in_plane(groups[g].point, angle, 1)
            hands: Hands = [(here.T_world_part @ T_part_hand, opening, here) for here in placed]
            if _standing(workcell, robot, hands, (), options):
                return T_start, T_goal, hands
    return None


def _turned_over(
    workcell: Workcell, model: Part, robot: Robot, rng: np.random.Generator, options: SolvableOptions
) -> tuple[NDArray, NDArray, Hands] | None:
    """Two poses with no grasp in common, but one for each that the arm reaches, on a sequence of the grasp–placement table."""
    T_start, T_goal, from_kind, to_kind = _places(workcell, model, rng, options)
    if from_kind == to_kind:
        return None
    table = grasp_placement_table(model, robot.hand)
    from_row, to_row = (int(np.nonzero(table.placement_of == kind)[0][0]) for kind in (from_kind, to_kind))
    start, goal = table.legal[table.placement_of == from_kind].any(axis=0), table.legal[table.placement_of == to_kind].any(axis=0)
    if (start & goal).any():
        return None
    costs = [np.where(table.legal[row], tilts_at(table, T), np.inf) for row, T in ((from_row, T_start), (to_row, T_goal))]
    for count, sequence in enumerate(sequences(table, *costs, fewest=1, most=1)):
        columns = sequence.transfers[0].column, sequence.transfers[-1].column
        hands: Hands = [
            (T @ table.Ts_part_hand[column], float(table.openings[column]), PlacedPart("part", model, T))
            for T, column in zip((T_start, T_goal), columns, strict=True)
        ]
        if _standing(workcell, robot, hands, (), options):
            return T_start, T_goal, hands
        if count > 30:
            break
    return None


def _standing(workcell: Workcell, robot: Robot, hands: Hands, clutter: Sequence[SolidBody], options: SolvableOptions) -> bool:
    """Whether the arm stands at every known-good hand pose, and straight above it, clear of everything."""
    return all(
        any(_clear(workcell, robot, T @ turn, opening, here, clutter, options) for turn in (np.eye(4), TURNED))
        for T, opening, here in hands
    )


TURNED = np.diag([-1.0, -1.0, 1.0, 1.0])  # the hand looks the same with its fingers swapped


def _clear(
    workcell: Workcell, robot: Robot, T_world_hand: NDArray, opening: float, here: PlacedPart, clutter: Sequence[SolidBody],
    options: SolvableOptions,
) -> bool:  # fmt: skip
    """Whether one branch of the arm stands at the pose, and the same branch 8 cm above it."""
    arm, model = arm_of(robot), collision_model(_world(workcell, robot, here, clutter))
    touching = tuple((finger, here.name) for finger in FINGERS)
    above = T_world_hand.copy()
    above[2, 3] += 0.08
    for q in arm.nearest_turns(arm.ik(T_world_hand), robot.home):
        if robot.limit_margin(q) < options.joint_margin or model.in_contact(q, opening, None, touching, options.play / 2) is not None:
            continue
        raised = arm.nearest_turns(arm.ik(above), q)
        if len(raised) and np.abs(raised - q).max(axis=1).min() < 0.6:
            b = raised[np.argmin(np.abs(raised - q).max(axis=1))]
            if robot.limit_margin(b) >= options.joint_margin and model.in_contact(b, opening, None, touching, options.play / 2) is None:
                return True
    return False


def _cluttered(
    workcell: Workcell, model: Part, robot: Robot, T_start: NDArray, T_goal: NDArray, hands: Hands, rng: np.random.Generator,
    options: SolvableOptions,
) -> list[SolidBody] | None:  # fmt: skip
    """All bodies at rest, the part among them; None if it moved, is hidden, or blocks what is known to be good."""
    part = SolidBody(model.name, model.solid, T_start, model.density, model.friction)
    fixed, clutter = list(fixed_bodies(workcell)), []
    kept_out = list(_kept_out(robot, hands, options))
    middles = [apply(T, model.solid.volume_and_centroid[1]) for T in (T_start, T_goal)]
    for k in range(rng.integers(options.blocks[0], options.blocks[1] + 1)):
        place = middles[k % 2] + np.array([*rng.normal(0.0, options.spread, 2), 0.05])
        size = np.round(rng.uniform(*options.sides, 3), 4)
        turn = Rotation.from_rotvec((0, 0, rng.uniform(-np.pi, np.pi))) if rng.random() < 0.5 else Rotation.random(rng=rng)
        block = solid_body(TrueBody(f"block{k + 1}", transform(turn.as_matrix(), place), size=size), lambda _: model)
        rested = settle([*fixed, _still(part), *map(_still, clutter), block])
        block = rested.bodies[-1]
        if rested.resting and _inside(workcell, block) and not _meets(block, kept_out):
            clutter.append(block)
    last = settle([*fixed, part, *clutter])
    pairs = zip([part, *clutter], last.bodies[len(fixed) :], strict=True)
    moved = [pose_difference(before.T_world_body, after.T_world_body) for before, after in pairs]
    if not last.resting or any(metres > STABLE_M or radians > STABLE_RAD for metres, radians in moved):
        return None
    good = visible_share(workcell.finder, last.bodies, last.bodies[len(fixed)]) >= options.visible
    return list(last.bodies) if good and _standing(workcell, robot, hands, clutter, options) else None


def _kept_out(robot: Robot, hands: Hands, options: SolvableOptions) -> Iterator[Polytope]:
    """Where no clutter may be: the hand wide open, back along its fingers and straight up, and the part on its way up."""
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    for T_world_hand, opening, here in hands:
        for back, up in [(0.0, up) for up in RAISED_M] + [(back, 0.0) for back in RAISED_M[1:]]:
            T = T_world_hand.copy()
            T[:3, 3] += np.array([0.0, 0.0, up]) - back * T_world_hand[:3, 2]
            for lower, upper in robot.hand.boxes(opening).values():
                yield polytope(apply(T, np.where(pick, upper + options.play, lower - options.play)))
        for up in RAISED_M:
            for piece in here.part.pieces:
                grown = piece + np.sign(piece - piece.mean(axis=0)) * 0.001
                yield polytope(apply(here.T_world_part, grown) + np.array([0.0, 0.0, up]))


def _meets(block: SolidBody, kept_out: list[Polytope]) -> bool:
    mine = polytopes_of(block)
    return any(overlap(piece, np.eye(4), one, block.T_world_body) >= 0 for piece in kept_out for one in mine)


def _still(body: SolidBody) -> SolidBody:
    """The body as one that does not move."""
    return SolidBody(body.name, body.solid, body.T_world_body, body.density, body.friction, fixed=True)


def _inside(workcell: Workcell, body: SolidBody) -> bool:
    places = apply(inverse(workcell.finder.T_world_range), body.corners_world)[:, :2]
    return bool((places > 0.01).all() and (places < np.array(workcell.finder.area) - 0.01).all())


def _true_body(body: SolidBody, part: str) -> TrueBody:
    if body.name == part:
        return TrueBody(body.name, body.T_world_body, part=part)
    return TrueBody(body.name, body.T_world_body, size=np.ptp(body.solid.vertices, axis=0))
