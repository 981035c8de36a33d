"""The simulated physics of a whole cell: bodies, robot and hand in one MuJoCo model, stepped under joint control."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.driver import Drive, Reference
from handey_studio.cell.physics.robot_model import add_robot
from handey_studio.cell.physics.settling import CONTACT_TIME_S, STEP_S, add_bodies, mujoco, new_spec, pose_of
from handey_studio.cell.physics.touches import Touches
from handey_studio.geometry.transforms import to_wxyz
from handey_studio.world.arm import Arm
from handey_studio.world.robot import FINGERS

ARM_RATE = 100.0  # rad/s of the joint controller's error, critically damped: what a stiff industrial arm reaches
FINGER_RATE = 60.0  # rad/s of the fingers' drive
FINGER_INTEGRAL = 4e5  # N/(m s): how fast the drive leans on what stops it, up to its force
GRIP_STIFF = (0.99, 0.999, 0.0005, 0.5, 2.0)  # impedance of the pads: a held part may not creep out of them
JAM = 1e5  # friction [N m, N] of what is jammed
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
NOWHERE = np.array([0.0, 0.0, -50.0])  # where bodies wait that are not there yet


class Simulation:
    """Arm, hand and bodies in one model. Not a value: it is stepped. `ghosts` are bodies that wait outside until `appear` is called."""

    dt = STEP_S

    def __init__(self, arm: Arm, bodies: Sequence[SolidBody], ghosts: Sequence[SolidBody] = ()) -> None:
        self.bodies, self._ghosts, self._arm = tuple(bodies), tuple(ghosts), arm
        self.model = _compiled(arm, self.bodies, self._ghosts)
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(f"joint{i + 1}") for i in range(arm.n)]
        self._q_at = np.array([joint.qposadr[0] for joint in joints])
        self.arm_dofs = np.array([joint.dofadr[0] for joint in joints])
        self._finger_at = np.array([self.model.joint(name).qposadr[0] for name in FINGERS])
        self.finger_dofs = np.array([self.model.joint(name).dofadr[0] for name in FINGERS])
        self._site = self.model.site("hand").id
        self._hand_bodies = np.array([self.model.body(name).id for name in ("hand", *FINGERS)])
        self._is_pad = np.isin(np.arange(self.model.nbody), self._hand_bodies[1:])
        self._base = self.model.body("link0").id
        self._touches = Touches(np.arange(self.model.nbody) >= self._base, self._hand_bodies[1:].tolist())
        limits = np.array(arm.model.effortLimit, dtype=float)
        self._effort = np.where((limits > 0) & np.isfinite(limits), limits, np.inf)
        self._finger_gain = FINGER_RATE**2 * float(self.model.dof_armature[self.finger_dofs[0]])
        self._finger_damping = 2.0 * self._finger_gain / FINGER_RATE
        self._integral = 0.0
        self.finger_force = 0.0
        """What each finger's drive closes with now [N]."""
        self._moves, self._turns = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        self._wanted, self._torque = np.zeros(self.model.nv), np.zeros(self.model.nv)
        self._there: set[int] = set()
        for number in range(len(self._ghosts)):
            self.appear(number, False)
        self._free = {body.name: self.model.body(f"body{k}") for k, body in enumerate(self.bodies) if not body.fixed}

    def place(self, q: NDArray, opening: float, grip_N: float = 0.0) -> None:
        """Put arm and fingers somewhere at rest, the fingers closing with a force."""
        self.data.qpos[self._q_at], self.data.qpos[self._finger_at] = q, opening / 2
        self.data.qvel[:] = 0.0
        self._integral, self.finger_force = -grip_N, grip_N
        mujoco.mj_forward(self.model, self.data)
        self._touches.stands(self.model.geom_bodyid[self.data.contact.geom])

    def step(self, to: Reference, fingers: Drive) -> None:
        """One time step: torques that bring the error of each joint down at the controller's rate, on the arm's own inertia.

        `to` is where the joints are to be at its end, so at its start they were to be a step's way before that.
        """
        model, data = self.model, self.data
        mujoco.mj_step1(model, data)
        owners = model.geom_bodyid[data.contact.geom]
        self._turn_with_hand(owners)
        dofs = self.arm_dofs
        error = to.q - to.velocity * self.dt - data.qpos[self._q_at]
        behind = to.velocity - to.acceleration * self.dt - data.qvel[dofs]
        self._wanted[dofs] = to.acceleration + ARM_RATE**2 * error + 2.0 * ARM_RATE * behind
        mujoco.mj_mulM(model, data, self._torque, self._wanted)
        torque = self._torque[dofs] + data.qfrc_bias[dofs]
        data.qfrc_applied[dofs] = np.clip(torque, -self._effort, self._effort)
        data.qfrc_applied[self.finger_dofs] = self._finger_push(fingers) + data.qfrc_bias[self.finger_dofs]
        mujoco.mj_step2(model, data)
        self._touches.feel(owners, data.efc_force, data.contact.efc_address)

    def _turn_with_hand(self, owners: NDArray) -> None:
        """Tell the grip's contacts, between bodies `owners` (n, 2), how pad and body would accelerate apart if no joint's rate changed.

        The engine leaves that term out (the Jacobian's own change), and a body held by a turning arm would slide out of the pads by
        millimetres. Half of it: then pad and body go together in the middle of the step, which is how far they get.
        """
        contacts = self.data.contact
        rows = np.flatnonzero(self._is_pad[owners].any(axis=1) & (contacts.efc_address >= 0))
        if not len(rows):
            return
        points, frames = contacts.pos[rows], contacts.frame[rows].reshape(-1, 3, 3)
        (a, turn_a), (b, turn_b) = (self._coasting(bodies, points) for bodies in owners[rows].T)
        first = contacts.efc_address[rows]
        self.data.efc_aref[first[:, None] + np.arange(3)] -= 0.5 * np.einsum("kij,kj->ki", frames, b - a)
        self.data.efc_aref[first + 3] -= 0.5 * np.einsum("kj,kj->k", frames[:, 0], turn_b - turn_a)

    def _coasting(self, bodies: NDArray, points: NDArray) -> tuple[NDArray, NDArray]:
        """How points (n, 3) of bodies (n,) accelerate, and how the bodies turn faster, while all joints keep their rates."""
        data, spin = self.data, self.data.cvel[bodies, :3]
        of_hand = self._is_pad[bodies][:, None]
        mujoco.mj_jacDot(self.model, data, self._moves, self._turns, data.site_xpos[self._site], self._hand_bodies[0])
        turn = np.where(of_hand, self._turns @ data.qvel, 0.0)
        lever = points - np.where(of_hand, data.site_xpos[self._site], data.xpos[bodies])
        start = np.where(of_hand, self._moves @ data.qvel, 0.0)
        return start + _cross(turn, lever) + _cross(spin, _cross(spin, lever)), turn

    def _finger_push(self, to: Drive) -> float:
        """The drive's force outwards on each finger: as a spring that leans on what stops it, up to its force."""
        data = self.data
        error = (to.opening - self.opening) / 2
        behind = (to.speed - float(data.qvel[self.finger_dofs].sum())) / 2
        self._integral = min(max(self._integral + FINGER_INTEGRAL * error * self.dt, -to.force), to.force)
        push = min(max(self._finger_gain * error + self._finger_damping * behind + self._integral, -to.force), to.force)
        self.finger_force = -push
        return push

    @property
    def q(self) -> NDArray:
        return self.data.qpos[self._q_at]

    @property
    def velocity(self) -> NDArray:
        return self.data.qvel[self.arm_dofs]

    @property
    def opening(self) -> float:
        return float(self.data.qpos[self._finger_at].sum())

    def wrench(self) -> tuple[NDArray, NDArray]:
        """Force (3,) and torque (3,) about the hand's origin that all contacts put on crosspiece and fingers together."""
        mujoco.mj_rnePostConstraint(self.model, self.data)
        total = self.data.cfrc_ext[self._hand_bodies].sum(axis=0)
        force = total[3:]
        lever = self.data.subtree_com[self._base] - self.data.site_xpos[self._site]
        return force, total[:3] + _cross(lever, force)

    def body_poses(self) -> dict[str, NDArray]:
        """T_world_body (4, 4) of the free bodies by name."""
        poses = {}
        for name, body in self._free.items():
            start = self.model.jnt_qposadr[body.jntadr[0]]
            poses[name] = pose_of(self.data.qpos[start : start + 7])
        return poses

    def true_bodies(self) -> tuple[SolidBody, ...]:
        """All bodies where they are now, the ghosts that have come among them."""
        poses, ghosts = self.body_poses(), tuple(self._ghosts[number] for number in sorted(self._there))
        return tuple(body if body.fixed else body.at(poses[body.name]) for body in self.bodies) + ghosts

    def calm(self, speed: float, turn: float) -> bool:
        """Whether every free body is slower than `speed` [m/s] and `turn` [rad/s]."""
        rates = np.array([self.data.qvel[body.dofadr[0] : body.dofadr[0] + 6] for body in self._free.values()]).reshape(-1, 6)
        return bool((np.abs(rates[:, :3]) < speed).all() and (np.abs(rates[:, 3:]) < turn).all())

    def held(self) -> str | None:
        """Name of the free body that both fingers press on, the one pressed most if several."""
        pressed: dict[str, dict[int, float]] = {}
        owner = {body.id: name for name, body in self._free.items()}
        force = np.zeros(6)
        for k, contact in enumerate(self.data.contact):
            pair = self.model.geom_bodyid[contact.geom]
            for finger, other in (pair, pair[::-1]):
                if finger in self._hand_bodies[1:] and other in owner:
                    mujoco.mj_contactForce(self.model, self.data, k, force)
                    by_finger = pressed.setdefault(owner[other], {})
                    by_finger[finger] = by_finger.get(finger, 0.0) + float(force[0])
        both = {name: min(forces.values()) for name, forces in pressed.items() if len(forces) == 2 and min(forces.values()) > 0}
        return max(both, key=both.__getitem__, default=None)

    def touched(self) -> dict[tuple[str, str], float]:
        """What of the robot (`link3`, `hand`, `finger_left` …), or which body that it held, has touched which body so far, and how hard at
        most [N]. What a held body stood against before anything moved is left out."""
        names = {number: self.model.body(number).name for number in range(self.model.nbody)}
        names |= {self.model.body(f"body{k}").id: body.name for k, body in enumerate(self.bodies)}
        names |= {self.model.body(f"ghost{k}").id: body.name for k, body in enumerate(self._ghosts)}
        return {(names[a], names[b]): force for (a, b), force in self._touches.most.items()}

    def rub(self, name: str, share: float) -> None:
        """The friction between the fingers and a body becomes a share of its own."""
        own = _pad_friction(self._arm, next(body for body in self.bodies if body.name == name))
        owners = self.model.geom_bodyid[np.array([self.model.pair_geom1, self.model.pair_geom2])]
        self.model.pair_friction[(owners == self._free[name].id).any(axis=0)] = np.array(own) * share

    def push(self, name: str, force: NDArray) -> None:
        """A force (3,) [N] acts on a free body's centre until it is set anew."""
        self.data.xfrc_applied[self._free[name].id, :3] = force

    def jam(self, dofs: NDArray, jammed: bool) -> None:
        """Jam joints, or free them."""
        self.model.dof_frictionloss[dofs] = JAM if jammed else 0.0

    def appear(self, number: int, there: bool) -> None:
        """A ghost comes to its place, or goes."""
        self._there = self._there | {number} if there else self._there - {number}
        mocap, ghost = self.model.body(f"ghost{number}").mocapid[0], self._ghosts[number]
        self.data.mocap_pos[mocap] = ghost.T_world_body[:3, 3] if there else NOWHERE
        self.data.mocap_quat[mocap] = to_wxyz(ghost.T_world_body)


def _cross(a: NDArray, b: NDArray) -> NDArray:
    """Cross products of (..., 3); numpy's own takes ten times as long on a handful."""
    return a[..., NEXT] * b[..., LAST] - a[..., LAST] * b[..., NEXT]


def _compiled(arm: Arm, bodies: Sequence[SolidBody], ghosts: Sequence[SolidBody]) -> Any:
    spec = new_spec()
    add_bodies(spec, bodies)
    add_bodies(spec, ghosts, ghosts=True)
    add_robot(spec, arm)
    for number, body in enumerate(bodies):
        if not body.fixed:
            for finger in FINGERS:
                for k in range(len(body.pieces)):
                    _add_grip(spec, finger, f"body{number}_{k}", _pad_friction(arm, body))
    return spec.compile()


def _add_grip(spec: Any, finger: str, piece: str, friction: list[float]) -> None:
    """How a finger's pad touches a piece."""
    spec.add_pair(
        geomname1=finger, geomname2=piece, condim=4, friction=friction, solref=[CONTACT_TIME_S, 1.0], solimp=GRIP_STIFF
    )  # fmt: skip


def _pad_friction(arm: Arm, body: SolidBody) -> list[float]:
    """Sliding twice, turning [m], rolling twice [m]: pads press with a face, so they resist turning by their size as well."""
    sliding = arm.robot.hand.pad_friction * body.friction
    return [sliding, sliding, 0.005, 0.0001, 0.0001]
