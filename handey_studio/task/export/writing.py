"""A program in the words of a robot controller, checked before and after it is sampled anew."""

from collections.abc import Callable
from typing import NamedTuple

from handey_studio.base import BadInput
from handey_studio.task.export.dry_check import check_program
from handey_studio.task.export.program import Program
from handey_studio.task.export.resampling import at_rate
from handey_studio.task.export.ros2 import ros2_json, ros2_yaml
from handey_studio.task.export.table import csv_text
from handey_studio.task.export.urscript import GUARDED_SHARE, urscript
from handey_studio.world import Robot

URSCRIPT_HZ = 125.0  # formats without a rate of their own keep the plan's samples unless told otherwise


class Form(NamedTuple):
    """A format: how its files end, samples a second unless told otherwise, the share of a guarded descent's speed, the text."""

    suffix: str
    rate_hz: float | None
    guarded_share: float
    write: Callable[[Program, Robot, float | None], str]


FORMS = {
    "urscript": Form(".script", URSCRIPT_HZ, GUARDED_SHARE, lambda program, robot, hz: urscript(program, robot, hz or URSCRIPT_HZ)),
    "ros2": Form(".ros2.json", None, 1.0, lambda program, robot, _: ros2_json(program, robot)),
    "ros2-yaml": Form(".ros2.yaml", None, 1.0, lambda program, robot, _: ros2_yaml(program, robot)),
    "csv": Form(".csv", None, 1.0, lambda program, robot, _: csv_text(program)),
}


def program_text(program: Program, robot: Robot, form: str, rate_hz: float | None = None) -> tuple[str, Program]:
    """The text of a program in a format, and the program as sampled for it. Raises BadInput with what is beyond the robot's limits."""
    if form not in FORMS:
        raise BadInput(f'format "{form}" is unknown; choose {", ".join(FORMS)}.')
    told = FORMS[form]
    check_program(program, robot)
    rate = rate_hz or told.rate_hz
    if rate is not None:
        program = at_rate(program, rate, told.guarded_share)
        check_program(program, robot)
    return told.write(program, robot, rate), program
