"""A kit to be sorted: ten parts dropped in a pile, and a tray with a place for each, all in one scan's view.

By construction it can be sorted: by the true bodies there is an order in which each part in its turn is in plain view, with room for an
open hand at two upright faces, for no finger goes under a part that leans, where nobody sees. What order, and which grasps, nobody tells
the planner; what a scan does not see it must take for solid all the same.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput, Value
from handey_studio.cell.bodies import SolidBody, fixed_bodies, solid_body
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.scenes.fitness import graspable, visible_share
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.sensing.stripes.stripe_camera import camera_looking_at
from handey_studio.world import Block, Hand, Library

PARTS = ("brick", "wedge", "stairs", "brick", "wedge", "stairs", "brick", "wedge", "stairs", "brick")
AREA = (0.40, 0.60)  # what the range finder sees
CORNER = (0.28, -0.24)  # where that begins in the world
TRAY_X, TRAY_Y = (0.33, 0.43, 0.53, 0.63), (0.14, 0.23, 0.31)  # the middles of the tray's places
PILE_X, PILE_Y = (0.31, 0.65), (-0.21, 0.06)  # where the parts come to lie
SLACK_M = 0.015  # a place is that much wide and deep about its middle
RAIL = (0.004, 0.008)  # thickness and height [m] of the tray's rails
UPRIGHT = np.sin(np.deg2rad(5.0))  # how far off upright the faces that can be grasped are
VISIBLE = 0.6  # share of a part that shows when its turn comes
ATTEMPTS = 200


@dataclass(frozen=True, eq=False)
class Kit(Value):
    """A workcell with a pile and a tray, and the commands (part, destination) that fill the tray, in order."""

    workcell: Workcell
    commands: tuple[tuple[str, str], ...]


def kit(seed: int, library: Library, robot: str = "ur5", physics: bool = True) -> Kit:
    """A kit, the same for the same seed. Raises BadInput when no attempt lets the parts come to lie where they can be sorted."""
    rng = np.random.default_rng([seed, 10])
    names = tuple(dict.fromkeys(PARTS))
    workcell, hand = Workcell(robot, names, _rails(), finder=_finder()), library.robot(robot).hand
    for _ in range(ATTEMPTS):
        bodies = _dropped(workcell, library, rng)
        if bodies is not None and _sortable(workcell, hand, bodies):
            true = tuple(TrueBody(body.name, body.T_world_body, part=body.name.split("#")[0]) for body in bodies)
            setup = SimulatedSetup(true, seed=seed, physics=physics)
            return Kit(replace(workcell, setup=setup), tuple(zip(PARTS, _places(), strict=False)))
    raise BadInput(
        f"no pile of {len(PARTS)} parts with seed {seed} came to lie beside the tray so that it can be sorted, in {ATTEMPTS} attempts."
    )


def _places() -> list[str]:
    """Destinations `in:x0,y0,x1,y1`, the farthest from the robot first, so that what stands in the tray is in nobody's way."""
    middles = sorted(((x, y) for x in TRAY_X for y in TRAY_Y), key=lambda place: -np.hypot(*place))
    return [f"in:{x - SLACK_M:.3f},{y - SLACK_M:.3f},{x + SLACK_M:.3f},{y + SLACK_M:.3f}" for x, y in middles[-len(PARTS) :]]


def _finder() -> RangeFinder:
    """A range finder whose view holds pile and tray."""
    x, y = AREA[0] / 2, AREA[1] / 2
    cameras = tuple(replace(camera_looking_at((x + side, y, 1.1), (x, y, 0.05)), height=1080) for side in (-0.4, 0.4))
    return RangeFinder(transform(None, (*CORNER, 0.0)), AREA, laser=np.array([x, y, 1.2]), cameras=cameras)


def _rails() -> tuple[Block, ...]:
    """Four low rails around the tray."""
    thick, high = RAIL
    low, top = (TRAY_X[0] - 0.05, TRAY_Y[0] - 0.05), (TRAY_X[-1] + 0.05, TRAY_Y[-1] + 0.05)
    middle, size = ((low[0] + top[0]) / 2, (low[1] + top[1]) / 2), (top[0] - low[0], top[1] - low[1])
    rails = []
    for number, y in enumerate((low[1], top[1])):
        rails.append(Block(f"rail{number + 1}", np.array([size[0], thick, high]), transform(None, (middle[0], y, high / 2))))
    for number, x in enumerate((low[0], top[0])):
        rails.append(Block(f"rail{number + 3}", np.array([thick, size[1], high]), transform(None, (x, middle[1], high / 2))))
    return tuple(rails)


def _dropped(workcell: Workcell, library: Library, rng: np.random.Generator) -> tuple[SolidBody, ...] | None:
    """The parts after their fall; None if one left the pile's space, does not rest, or lies so that nobody can tell how."""
    heaps = [(x, y) for x in np.linspace(*PILE_X, 5)[1:4] for y in np.linspace(*PILE_Y, 5)[1:4]]
    falling = []
    for k, name in enumerate(PARTS):
        place = np.array([*heaps[k % len(heaps)], 0.06 + 0.07 * (k // len(heaps))]) + rng.normal(0.0, 0.012, 3) * (1.0, 1.0, 0.0)
        count = PARTS[:k].count(name) + 1
        pose = transform(Rotation.random(rng=rng).as_matrix(), place)
        falling.append(solid_body(TrueBody(f"{name}#{count}", pose, part=name), library.part))
    fixed = fixed_bodies(workcell)
    rested = settle([*fixed, *falling])
    bodies = tuple(rested.bodies[len(fixed) :])
    return bodies if rested.resting and all(map(_inside, bodies)) else None


def _sortable(workcell: Workcell, hand: Hand, bodies: tuple[SolidBody, ...]) -> bool:
    """Whether the parts can be taken away one after the other, each in view and with room for the hand; what leaned on it falls anew."""
    fixed, left = fixed_bodies(workcell), bodies
    while left:
        standing = (*fixed, *left)
        free = (
            body for body in left if graspable(hand, body, standing, UPRIGHT) and visible_share(workcell.finder, standing, body) >= VISIBLE
        )
        taken = next(free, None)
        if taken is None:
            return False
        left = settle([*fixed, *(body for body in left if body is not taken)]).bodies[len(fixed) :]
    return True


def _inside(body: SolidBody) -> bool:
    corners: NDArray = body.corners_world
    low, top = corners.min(axis=0), corners.max(axis=0)
    return bool(PILE_X[0] - 0.03 <= low[0] and top[0] <= PILE_X[1] + 0.03 and PILE_Y[0] - 0.03 <= low[1] and top[1] <= PILE_Y[1] + 0.03)
