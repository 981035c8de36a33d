"""What really happened in a motion, sampled: for planned-against-actual, the plots of force and width, and the tracking error."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.world.arm import Arm

SAMPLE_S = 0.008  # no more than 125 samples a second are kept


@dataclass(frozen=True)
class Event:
    """Something felt at `time_s`: fingers or held part `touch` something or leave it (`release`), with the wrist's force then [N]."""

    time_s: float
    what: str
    force_N: float


@dataclass(frozen=True, eq=False)
class Recording(Value):
    """Samples at `time_s` (n,) of what was measured: joints `q_rad` and what was commanded of them then, `q_command_rad` (n, joints);
    the fingers' `opening_m` (n,) and each drive's `finger_force_N` (n,); the wrist's `force_N` and `torque_Nm` (n, 3), as in `Wrench`."""

    time_s: NDArray
    q_rad: NDArray
    q_command_rad: NDArray
    opening_m: NDArray
    finger_force_N: NDArray
    force_N: NDArray
    torque_Nm: NDArray
    events: tuple[Event, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name != "events":
                object.__setattr__(self, field.name, frozen_array(getattr(self, field.name)))


def joined(recordings: Sequence[Recording]) -> Recording:
    """One recording of several motions, one after the other in time."""
    starts = np.concatenate([[0.0], np.cumsum([recording.time_s[-1] for recording in recordings])])
    events = [Event(start + e.time_s, e.what, e.force_N) for start, r in zip(starts, recordings, strict=False) for e in r.events]
    names = [field.name for field in fields(Recording) if field.name not in ("time_s", "events")]
    columns = {name: np.concatenate([getattr(recording, name) for recording in recordings]) for name in names}
    times = np.concatenate([start + recording.time_s for start, recording in zip(starts, recordings, strict=False)])
    return Recording(time_s=times, events=tuple(events), **columns)


def as_commanded(time_s: NDArray, q_rad: NDArray, opening_m: float, finger_force_N: float = 0.0, events: Sequence[Event] = ()) -> Recording:
    """The recording of a motion that was followed exactly and in which the wrist felt nothing: (n,), (n, joints)."""
    n = len(time_s)
    none = np.zeros((n, 3))
    return Recording(time_s, q_rad, q_rad, np.full(n, opening_m), np.full(n, finger_force_N), none, none, tuple(events))


@dataclass(frozen=True)
class Tracking:
    """How far the arm was off its command at most: any joint [rad], and the hand's origin [mm]."""

    joint_rad: float
    hand_mm: float


def tracking_error(recording: Recording, arm: Arm) -> Tracking:
    """The greatest differences between measured and commanded in a recording, at its samples."""
    places = [arm.hand_pose(q)[:, :3, 3] for q in (recording.q_rad, recording.q_command_rad)]
    off = np.linalg.norm(places[0] - places[1], axis=1)
    return Tracking(float(np.abs(recording.q_rad - recording.q_command_rad).max()), float(1e3 * off.max()))
