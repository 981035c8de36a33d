"""Random piles by seed: a modelled part among dropped blocks that no model describes, and where to MOVE it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput, Value
from handey_studio.cell.bodies import SolidBody, fixed_bodies, solid_body
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.scenes.fitness import graspable, visible_share
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell
from handey_studio.geometry.transforms import apply, inverse, pose_difference, to_xyz_rpy, transform
from handey_studio.world.library import Library

STABLE_M, STABLE_RAD = 0.001, np.deg2rad(0.5)  # a part that moves no more when all else is taken away stands by itself


@dataclass(frozen=True)
class PileOptions:
    """`blocks` least and most unmodelled cuboids with sides of `sides` [m], dropped within `spread` [m] of the part."""

    blocks: tuple[int, int] = (4, 8)
    sides: tuple[float, float] = (0.020, 0.060)
    spread: float = 0.050
    margin: float = 0.010
    visible: float = 0.75
    attempts: int = 60
    goal_x: tuple[float, float] = (0.38, 0.58)
    goal_y: tuple[float, float] = (0.29, 0.38)


@dataclass(frozen=True, eq=False)
class Pile(Value):
    """A pile at rest and its MOVE: `part` TO `to`. `T_world_goal` (4, 4) is the same destination as a pose."""

    workcell: Workcell
    part: str
    to: str
    T_world_goal: NDArray
    attempts: int


def random_pile(seed: int, part: str, library: Library, robot: str = "ur5", options: PileOptions = PileOptions()) -> Pile:
    """A pile around one instance of a part, the same for the same seed.

    The part lies in the scan area, stands by itself, shows `visible` of what it would show alone, and some hand position
    from above closes on it without touching anything. The destination keeps its resting side down, at another place and
    yaw, on free table beside the scanned area. Raises BadInput when no attempt gives such a pile.
    """
    workcell = Workcell(robot=robot, parts=(part,))
    hand = library.robot(robot).hand
    rng = np.random.default_rng(seed)
    for attempt in range(1, options.attempts + 1):
        bodies = _dropped(workcell, part, library, rng, options)
        target = next((body for body in bodies if body.name == part), None)
        if target is None or not _fits(workcell, bodies, target, options) or not graspable(hand, target, bodies):
            continue
        T_goal = _goal(workcell, target, rng, options)
        setup = SimulatedSetup(tuple(_true_body(body, part) for body in bodies if not body.fixed), seed=seed, physics=False)
        return Pile(_with(workcell, setup), part, destination(T_goal), T_goal, attempt)
    raise BadInput(f'no pile around part "{part}" with seed {seed} shows it and leaves room for the hand in {options.attempts} attempts.')


def destination(T_world_part: NDArray) -> str:
    """A pose as a MOVE's destination: `x,y,z,roll,pitch,yaw` in metres and degrees."""
    xyz, rpy = to_xyz_rpy(T_world_part)
    return ",".join([*(f"{value:z.6f}" for value in xyz), *(f"{value:z.4f}" for value in np.rad2deg(rpy))])


def _with(workcell: Workcell, setup: SimulatedSetup) -> Workcell:
    return Workcell(workcell.robot, workcell.parts, workcell.blocks, workcell.free_space, workcell.table_z, workcell.finder, setup)


def _true_body(body: SolidBody, part: str) -> TrueBody:
    if body.name == part:
        return TrueBody(body.name, body.T_world_body, part=part)
    return TrueBody(body.name, body.T_world_body, size=np.ptp(body.solid.vertices, axis=0))


def _dropped(workcell: Workcell, part: str, library: Library, rng: np.random.Generator, options: PileOptions) -> Sequence[SolidBody]:
    """The part and blocks after falling one over the other; empty when they did not come to rest."""
    finder = workcell.finder
    middle = apply(finder.T_world_range, (finder.area[0] / 2, finder.area[1] / 2, 0.0))
    radius = library.part(part).solid.diameter
    T_part = transform(Rotation.random(rng=rng).as_matrix(), middle + np.array([*rng.uniform(-0.04, 0.04, 2), radius]))
    bodies = [*fixed_bodies(workcell), solid_body(TrueBody(part, T_part, part=part), library.part)]
    first = settle(bodies)
    if not first.resting:
        return ()
    centre = apply(first.bodies[-1].T_world_body, first.bodies[-1].solid.volume_and_centroid[1])
    falling = list(first.bodies)
    for k in range(rng.integers(options.blocks[0], options.blocks[1] + 1)):
        place = (*(centre[:2] + rng.normal(0.0, options.spread, 2)), 0.12 + 0.07 * k)
        turn = Rotation.random(rng=rng).as_matrix()
        size = np.round(rng.uniform(*options.sides, 3), 4)
        falling.append(solid_body(TrueBody(f"block{k + 1}", transform(turn, place), size=size), library.part))
    last = settle(falling)
    return last.bodies if last.resting else ()


def _fits(workcell: Workcell, bodies: Sequence[SolidBody], target: SolidBody, options: PileOptions) -> bool:
    """Whether everything lies in the scan area, and the target stands by itself in plain view."""
    finder = workcell.finder
    corners = np.concatenate([body.corners_world for body in bodies if not body.fixed])
    inside = apply(inverse(finder.T_world_range), corners)[:, :2]
    if (inside < options.margin).any() or (inside > np.array(finder.area) - options.margin).any():
        return False
    alone = [body for body in bodies if body.fixed]
    stood = settle([*alone, target])
    moved, turned = pose_difference(stood.bodies[-1].T_world_body, target.T_world_body)
    if not stood.resting or moved > STABLE_M or turned > STABLE_RAD:
        return False
    return visible_share(finder, bodies, target) >= options.visible


def _goal(workcell: Workcell, target: SolidBody, rng: np.random.Generator, options: PileOptions) -> NDArray:
    """The target's resting side down at a random place beside the scan area, its lowest corner on the table."""
    yaw = rng.uniform(-np.pi, np.pi)
    T = transform(Rotation.from_rotvec((0.0, 0.0, yaw)).as_matrix()) @ target.T_world_body
    centre = apply(T, target.solid.volume_and_centroid[1])
    place = np.array([rng.uniform(*options.goal_x), rng.choice((-1.0, 1.0)) * rng.uniform(*options.goal_y), 0.0])
    lowest = float(apply(T, target.solid.vertices)[:, 2].min())
    return transform(None, (*(place - centre)[:2], workcell.table_z - lowest)) @ T
