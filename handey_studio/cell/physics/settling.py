"""Bodies fall until they rest: MuJoCo, with the exact convex pieces of each body."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress, Silent
from handey_studio.cell.bodies import SolidBody
from handey_studio.geometry.transforms import to_wxyz, transform

mujoco: Any = import_module("mujoco")  # compiled, its types are incomplete

STEP_S = 0.002
CONTACT_TIME_S = 0.004  # stiffest that two steps per time constant allow: keeps what sinks into contacts below 0.1 mm
BODIES, ARM, FINGERS = 1, 2, 4  # who may touch whom: arm and bodies meet; fingers meet what is fixed, and bodies by pairs of their own
EVERYTHING = BODIES | ARM | FINGERS


@dataclass(frozen=True)
class SettleOptions:
    """When bodies count as resting: slower than `speed` [m/s] and `turn` [rad/s] for `calm_steps`. `max_steps` bounds the work."""

    max_steps: int = 4000
    calm_steps: int = 100
    speed: float = 0.002
    turn: float = 0.05


@dataclass(frozen=True)
class Settled:
    """The bodies where they came to rest, in the order given; `resting` is False when they still moved at the last step."""

    bodies: tuple[SolidBody, ...]
    resting: bool
    steps: int


def settle(bodies: Sequence[SolidBody], options: SettleOptions | None = None, progress: Progress | None = None) -> Settled:
    """Let the free bodies fall from their poses among the fixed ones until they rest. The same bodies give the same rest."""
    options, progress = options or SettleOptions(), progress or Silent()
    free = [body for body in bodies if not body.fixed]
    if not free:
        return Settled(tuple(bodies), True, 0)
    model = _model(bodies)
    data = mujoco.MjData(model)
    calm = step = 0
    while step < options.max_steps and calm < options.calm_steps and not progress.cancelled:
        mujoco.mj_step(model, data)
        step += 1
        velocity = data.qvel.reshape(-1, 6)
        calm = calm + 1 if np.abs(velocity[:, :3]).max() < options.speed and np.abs(velocity[:, 3:]).max() < options.turn else 0
        if step % 200 == 0:
            progress.report(step / options.max_steps, f"bodies fall, step {step}")
    poses = iter(data.qpos.reshape(-1, 7).copy())
    rested = tuple(body if body.fixed else body.at(pose_of(next(poses))) for body in bodies)
    return Settled(rested, calm >= options.calm_steps, step)


def pose_of(qpos: NDArray) -> NDArray:
    """The pose (4, 4) of a free body from its place and quaternion (7,)."""
    w, x, y, z = qpos[3:] / np.linalg.norm(qpos[3:])
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return transform(R, qpos[:3])


def _model(bodies: Sequence[SolidBody]) -> Any:
    """A MuJoCo model of bodies alone."""
    spec = new_spec()
    add_bodies(spec, bodies)
    return spec.compile()


def new_spec() -> Any:
    """An empty model with the settings that resting and gripped bodies need."""
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP_S
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0  # friction as stiff as this keeps resting bodies from creeping
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec


class Touching(NamedTuple):
    """What a piece is (`own`) and what it meets (`others`), how dense it is [kg/m³], its friction."""

    own: int
    others: int = 0
    density: float = 0.0
    friction: float = 0.5


def add_bodies(spec: Any, bodies: Sequence[SolidBody], ghosts: bool = False) -> None:
    """Bodies `body0` … in the order given, one geom `body0_0` … a convex piece; those that are not fixed are free.

    `ghosts` are called `ghost0` … and stand wherever they are put.
    """
    kind = "ghost" if ghosts else "body"
    for number, body in enumerate(bodies):
        T = body.T_world_body
        node = spec.worldbody.add_body(name=f"{kind}{number}", pos=T[:3, 3], quat=to_wxyz(T), mocap=ghosts)
        if not (body.fixed or ghosts):
            node.add_freejoint()
        touching = Touching(BODIES, EVERYTHING if body.fixed or ghosts else BODIES | ARM, body.density, body.friction)
        for k, piece in enumerate(body.pieces):
            add_piece(spec, node, f"{kind}{number}_{k}", piece, touching)


def add_piece(spec: Any, node: Any, name: str, piece: NDArray, touching: Touching) -> None:
    """Adds a convex piece, corners (k, 3) [m] in the frame of its body `node`."""
    lower, upper = piece.min(axis=0), piece.max(axis=0)
    common = {
        "name": name,
        "density": touching.density,
        "friction": [touching.friction, 0.005, 0.0001],
        "condim": 4,
        "contype": touching.own,
        "conaffinity": touching.others,
        "solref": [CONTACT_TIME_S, 1.0],
        "solimp": [0.95, 0.99, 0.0005, 0.5, 2.0],
    }
    if _is_box(piece, lower, upper):
        node.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(upper - lower) / 2, pos=(lower + upper) / 2, **common)
        return
    spec.add_mesh(name=name, uservert=piece.ravel().astype(np.float32))
    node.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **common)


def _is_box(piece: NDArray, lower: NDArray, upper: NDArray) -> bool:
    """Whether the corners are those of a box along the body's axes, whose contacts MuJoCo knows best."""
    return len(piece) == 8 and bool((np.isclose(piece, lower, atol=1e-9) | np.isclose(piece, upper, atol=1e-9)).all())
