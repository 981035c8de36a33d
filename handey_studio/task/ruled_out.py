"""What was carried out and failed is not tried again: the search takes these as it takes the geometry."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import pose_difference

SAME_GRASP_M, SAME_GRASP_RAD = 0.008, np.deg2rad(15.0)
SAME_PLACE_M = 0.02
NEAR_WAY_RAD = 0.12  # a way that comes so near, in every joint, to where the arm was stopped would be stopped again
TURNED = np.diag([-1.0, -1.0, 1.0, 1.0])  # the hand looks the same with its fingers swapped


@dataclass(frozen=True, eq=False)
class RuledOut(Value):
    """An option that failed, and `why`. A `grasp` is told by `T_option` = T_part_hand (4, 4), a `place` by T_world_part, a `way` by the
    configuration `q_rad` (joints,) [rad] in which the arm was stopped."""

    kind: Literal["grasp", "place", "way"]
    why: str
    T_option: NDArray = field(default_factory=lambda: np.eye(4))
    q_rad: NDArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_option", frozen_array(self.T_option))
        object.__setattr__(self, "q_rad", frozen_array(self.q_rad))


def grasp_ruled_out(T_part_hand: NDArray, symmetries: NDArray, ruled_out: tuple[RuledOut, ...]) -> RuledOut | None:
    """What rules out a grasp of a part with `symmetries` (k, 4, 4): one nearly the same, either way round; None if nothing does."""
    for one in ruled_out:
        if one.kind == "grasp":
            alike = (pose_difference(S @ one.T_option @ turn, T_part_hand) for S in symmetries for turn in (np.eye(4), TURNED))
            if any(metres < SAME_GRASP_M and radians < SAME_GRASP_RAD for metres, radians in alike):
                return one
    return None


def place_ruled_out(T_world_part: NDArray, ruled_out: tuple[RuledOut, ...]) -> RuledOut | None:
    """What rules out a place: one within `SAME_PLACE_M`, however the part stands there; None if nothing does."""
    near = (one for one in ruled_out if one.kind == "place")
    return next((one for one in near if np.linalg.norm(one.T_option[:3, 3] - T_world_part[:3, 3]) < SAME_PLACE_M), None)


def way_ruled_out(q_rad: NDArray, ruled_out: tuple[RuledOut, ...]) -> RuledOut | None:
    """What rules out an arm motion (m, joints) [rad]: a place on it at which the arm was stopped; None if nothing does."""
    for one in ruled_out:
        if one.kind == "way" and np.abs(_nearest_on(q_rad, one.q_rad)).max() < NEAR_WAY_RAD:
            return one
    return None


def _nearest_on(q_rad: NDArray, point: NDArray) -> NDArray:
    """The least difference (joints,) from a point to the straight pieces between configurations (m, joints)."""
    starts, along = q_rad[:-1], np.diff(q_rad, axis=0)
    if not len(along):
        return q_rad[0] - point
    share = ((point - starts) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    off = starts + np.clip(share, 0.0, 1.0)[:, None] * along - point
    return off[np.argmin(np.abs(off).max(axis=1))]
