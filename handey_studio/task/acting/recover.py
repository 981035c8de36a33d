"""What follows from an incident: what is ruled out, whether to try again, and why. By rules, each with its reason."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.protocol import Wrench
from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.task.acting.looking import PlaceLimits
from handey_studio.task.acting.performance import Incident
from handey_studio.task.destination import Area
from handey_studio.task.plan import Carry, MovePlan
from handey_studio.task.ruled_out import RuledOut
from handey_studio.world import Block, Held, Robot, hand_hulls

FELT_N = 15.0  # the wrist feels a thing in the way with more than this; less is weight and jerk
FELT_SIDE_M = 0.04  # nobody knows how large it is: as large as a hand could have passed beside


@dataclass(frozen=True)
class RecoveryOptions:
    """`attempts` at a MOVE in all, the first among them; 1 never recovers. `looks`: scans that a plan is looked for in, as readings come
    and go with the sensor's noise. `look_again`: scan once more before anything moves, and compare. `place` tells how far off the part
    may stand at the end."""

    attempts: int = 3
    looks: int = 2
    look_again: bool = True
    place: PlaceLimits = field(default_factory=PlaceLimits)


@dataclass(frozen=True)
class Lesson:
    """What an incident teaches: what is ruled out, if anything, and why the next attempt may fare better; `hopeless` if none would."""

    why: str
    ruled_out: RuledOut | None = None
    hopeless: bool = False


def lesson_of(incident: Incident, plan: MovePlan, q: NDArray, destination: object) -> Lesson:
    """The rule for an incident; `q` (joints,) [rad] is where the arm was."""
    carry = plan.carry_at(min(max(incident.step, 0), len(plan.steps) - 1))
    said = str(incident)
    if incident.kind in ("missed", "slipped", "dropped"):
        return Lesson("another grasp is taken, from a new scan", _grasp(carry, said))
    if incident.kind == "blocked":
        return Lesson("another way is taken, from a new scan that may show what was in the way", RuledOut("way", said, q_rad=q))
    if incident.kind in ("early contact", "late contact", "wrong place"):
        if isinstance(destination, Area):
            return Lesson("another place in the area is taken", RuledOut("place", said, carry.T_world_part_goal))
        return Lesson("another grasp is taken, from a new scan, as the place is given", _grasp(carry, said))
    if incident.kind == "moved":
        return Lesson("the new scan is looked at instead")
    if incident.kind == "hand stuck":
        return Lesson("no plan can be carried out without the fingers", hopeless=True)
    return Lesson("nothing can be tried", hopeless=True)


def felt_block(wrench: Wrench, T_world_hand: NDArray, robot: Robot, opening: float, held: Held | None) -> Block | None:
    """Where the hand, or what it holds, touched something that nobody saw, as a block that the planner keeps clear of.

    The force's line of action, by force and torque at the wrist, enters the hand's bodies where it was touched. None if the wrist felt
    too little: then a link of the arm was touched.
    """
    force = wrench.force_N
    size = float(np.linalg.norm(force))
    if size < FELT_N:
        return None
    along = force / size
    middle = np.cross(force, wrench.torque_Nm) / size**2 + T_world_hand[:3, 3]
    corners = [apply(T_world_hand, hull) for hull in hand_hulls(robot, opening).values()]
    if held is not None:
        corners.append(apply(T_world_hand @ held.T_hand_part, held.part.solid.vertices))
    reach = min(float(((points - middle) @ along).min()) for points in corners)
    centre = middle + along * (reach - FELT_SIDE_M / 2)
    return Block("felt", np.full(3, FELT_SIDE_M), transform(None, centre))


def _grasp(carry: Carry, why: str) -> RuledOut:
    return RuledOut("grasp", why, inverse(carry.grasp.T_hand_part))
