"""Which run leads the part in hand out of its place or into another at a time of a plan (Handey 1987 §5.2, with the part in hand)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import BumpRun
from handey_studio.session.replay import Replay
from handey_studio.world import arm_of


@dataclass(frozen=True, eq=False)
class Led(Value):
    """The run, the number of the point of its path that the hand is nearest to, and its pose (y, z, angle) where the part stands."""

    run: BumpRun
    at: int
    place: NDArray


def led_at(replay: Replay, time_s: float) -> Led | None:
    """What leads the part at a time: from the lift to the end of its way out, from the begin of its way in until it stands; else None."""
    moment, carry = replay.at(time_s), replay.carry_at(time_s)
    before, now, after = ("", *(step.kind for step in replay.plan.steps), "")[moment.step : moment.step + 3]
    lifting = now == "lift" or (now == "transfer" and before == "lift")
    lowering = now == "place" or (now == "transfer" and after == "place")
    run = carry.lifting if lifting and carry.lifting is not None else carry.lowering if lowering else None
    if run is None:
        return None
    hand = inverse(run.plane.T_world_plane) @ arm_of(replay.robot).hand_pose(moment.q_rad)
    at = int(np.argmin(np.linalg.norm(run.path[:, :2] - hand[1:3, 3], axis=1)))
    return Led(run, at, run.path[0 if run is carry.lifting else -1])
