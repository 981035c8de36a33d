"""Judging poses in a simulated scene, whose truth is known."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.cell.scenes.pile_scenes import TruePose
from handey_studio.geometry.transforms import pose_difference
from handey_studio.task.bench.locate.judgement import Instance, Verdict
from handey_studio.world.part import Part

RIGHT_MM, RIGHT_DEG = 5.0, 5.0  # a gripper that closes on the part still gets it
STRICT_MM, STRICT_DEG = 3.0, 2.0


@dataclass(frozen=True, eq=False)
class TruthJudge(Value):
    """A pose is right if its origin lies within 5 mm and its attitude within 5° of a true instance, under the part's symmetries. Each
    instance is found once: a second pose on it is false."""

    truth: tuple[TruePose, ...]
    T_world_sensor: NDArray
    parts: dict[str, Part]

    def instances(self, part: str) -> tuple[Instance, ...]:
        """The true instances of a part, hidden ones too."""
        return tuple(Instance(true.visible_fraction, true.visible_px) for true in self._of(part))

    def verdicts(self, part: str, Ts_sensor_part: Sequence[NDArray]) -> tuple[Verdict, ...]:
        """Each pose against the nearest instance that no earlier pose has found."""
        free = dict(enumerate(self._of(part)))
        verdicts = []
        for T_sensor_part in Ts_sensor_part:
            T = self.T_world_sensor @ T_sensor_part
            errors = {number: pose_error(T, true.T_world_part, self.parts[part].symmetries) for number, true in free.items()}
            verdict = _verdict(errors)
            if verdict.matches is not None:
                del free[verdict.matches]
            verdicts.append(verdict)
        return tuple(verdicts)

    def _of(self, part: str) -> tuple[TruePose, ...]:
        return tuple(true for true in self.truth if true.part == part)


def pose_error(T: NDArray, T_true: NDArray, symmetries: NDArray) -> tuple[float, float]:
    """How far a pose is off in mm and degrees, under the symmetry (k, 4, 4) that makes it look best."""
    differences = [pose_difference(T, T_true @ S) for S in symmetries]
    metres, radians = min(differences, key=lambda difference: difference[0] * 1e3 / RIGHT_MM + np.rad2deg(difference[1]) / RIGHT_DEG)
    return 1e3 * metres, float(np.rad2deg(radians))


def _verdict(errors: dict[int, tuple[float, float]]) -> Verdict:
    """The instance with the least error, and whether that is small enough."""
    if not errors:
        return Verdict(False, False, None)
    nearest = min(errors, key=lambda number: errors[number][0] / RIGHT_MM + errors[number][1] / RIGHT_DEG)
    mm, degrees = errors[nearest]
    right = mm <= RIGHT_MM and degrees <= RIGHT_DEG
    return Verdict(right, mm <= STRICT_MM and degrees <= STRICT_DEG, nearest if right else None, mm, degrees)
