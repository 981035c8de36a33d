"""The hand's envelope: one box that holds the hand however far it is open, for motions that must be safe at every opening."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.world.robot import Hand, Robot


@dataclass(frozen=True, eq=False)
class HandEnvelope(Hand):
    """A hand as its envelope: the box, in the hand frame, around its boxes at the least and the greatest opening and all between."""

    def boxes(self, opening: float) -> dict[str, tuple[NDArray, NDArray]]:
        """The one box `hand`, the same at every opening."""
        ends = [box for end in (self.opening_min, self.opening_max) for box in super(HandEnvelope, self).boxes(end).values()]
        return {"hand": (np.min([lower for lower, _ in ends], axis=0), np.max([upper for _, upper in ends], axis=0))}


def enveloped(robot: Robot) -> Robot:
    """The same robot with its hand as the envelope."""
    return replace(robot, hand=HandEnvelope(**{part.name: getattr(robot.hand, part.name) for part in fields(robot.hand)}))
