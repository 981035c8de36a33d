"""The robot in the simulated physics: its links with the URDF's inertias and convex pieces, and a hand of two sliding fingers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.physics.settling import ARM, Touching, add_piece, mujoco
from handey_studio.cell.physics.settling import FINGERS as FINGER_BIT
from handey_studio.geometry.transforms import to_wxyz
from handey_studio.world.arm import Arm, hand_hulls
from handey_studio.world.robot import FINGERS, Hand

ARMATURE = 0.1  # kg m², what a geared motor's rotor adds at its joint
FINGER_ARMATURE_KG = 2.0  # what the fingers' spindle adds: it hardly gives way
HAND_DENSITY = 1500.0  # kg/m³ of the hand's boxes: aluminium, in part hollow
JAMMED = {"solref_friction": [0.004, 1.0], "solimp_friction": [0.9999, 0.9999, 0.001, 0.5, 2.0]}  # a joint that is jammed does not creep
LEAST_MASS_KG, LEAST_INERTIA = 0.01, 1e-5  # of links for which the URDF gives none
SIDES = {"finger_left": -1.0, "finger_right": 1.0}


def add_robot(spec: Any, arm: Arm) -> None:
    """Adds links `link0` … with joints `joint1` …, the body `hand`, and the fingers with joints of their own names."""
    T_base = arm.robot.T_world_base
    node = spec.worldbody.add_body(name="link0", pos=T_base[:3, 3], quat=to_wxyz(T_base))
    _add_link_pieces(spec, node, arm, 0)
    for i in range(1, arm.n + 1):
        T = arm.T_links[i - 1]
        node = node.add_body(name=f"link{i}", pos=T[:3, 3], quat=to_wxyz(T), **_inertia(arm, i))
        node.add_joint(name=f"joint{i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=arm.axes[i - 1], armature=ARMATURE, **JAMMED)
        _add_link_pieces(spec, node, arm, i)
    _add_hand(spec, node, arm)


def _inertia(arm: Arm, i: int) -> dict[str, Any]:
    """A moving link's mass, centre and moments."""
    given = arm.model.inertias[i]
    moments = np.asarray(given.inertia) + LEAST_INERTIA * np.eye(3)
    full = [moments[0, 0], moments[1, 1], moments[2, 2], moments[0, 1], moments[0, 2], moments[1, 2]]
    mass = max(float(given.mass), LEAST_MASS_KG)
    return {"explicitinertial": True, "mass": mass, "ipos": np.array(given.lever), "fullinertia": full}


def _add_link_pieces(spec: Any, node: Any, arm: Arm, link: int) -> None:
    hulls = [hull for body in arm.bodies if body.link == link for hull in body.hulls]
    for k, hull in enumerate(hulls):
        add_piece(spec, node, f"link{link}_{k}", hull, Touching(ARM))


def _add_hand(spec: Any, last: Any, arm: Arm) -> None:
    """Crosspiece and mount on the last link; the fingers slide along x, as far out one as the other."""
    T, hand = arm.T_last_hand, arm.robot.hand
    node = last.add_body(name="hand", pos=T[:3, 3], quat=to_wxyz(T))
    node.add_site(name="hand")
    closed = hand_hulls(arm.robot, 0.0)
    for name, corners in closed.items():
        if name not in FINGERS:
            add_piece(spec, node, name, corners, Touching(ARM, density=HAND_DENSITY))
            continue
        finger = node.add_body(name=name)
        finger.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=(SIDES[name], 0.0, 0.0),
            armature=FINGER_ARMATURE_KG,
            range=_reach(hand),
            limited=True,
            **JAMMED,
        )
        add_piece(spec, finger, name, corners, Touching(FINGER_BIT, density=HAND_DENSITY))
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=FINGERS[0], name2=FINGERS[1],
        data=[0.0, 1.0] + 10 * [0.0], solref=[0.004, 1.0], solimp=[0.99, 0.999, 0.0005, 0.5, 2.0],
    )  # fmt: skip


def _reach(hand: Hand) -> NDArray:
    """How far out each finger goes [m]."""
    return np.array([hand.opening_min / 2 - 1e-4, hand.opening_max / 2 + 1e-4])
