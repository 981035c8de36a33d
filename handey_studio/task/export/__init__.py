"""Plans for robot controllers: URScript, ROS 2 trajectories, CSV; checked against the robot's limits before, read back after."""

from handey_studio.task.export.dry_check import check_program
from handey_studio.task.export.program import Program, ProgramStep, program_from_move, read_program
from handey_studio.task.export.resampling import at_rate
from handey_studio.task.export.ros2 import read_ros2, ros2_json, ros2_yaml
from handey_studio.task.export.table import csv_text, read_csv
from handey_studio.task.export.urscript import GUARDED_SHARE, read_urscript, urscript
from handey_studio.task.export.writing import FORMS, program_text

__all__ = [
    "FORMS",
    "GUARDED_SHARE",
    "Program",
    "ProgramStep",
    "at_rate",
    "check_program",
    "csv_text",
    "program_from_move",
    "program_text",
    "read_csv",
    "read_program",
    "read_ros2",
    "read_urscript",
    "ros2_json",
    "ros2_yaml",
    "urscript",
]
