"""§2: MOVE object TO destination — the options, their search, the plan, its execution."""

from handey_studio.task.carrying import Start
from handey_studio.task.destination import format_pose, goal_poses, parse_destination
from handey_studio.task.move import MoveOptions, check_command, plan_move
from handey_studio.task.performance import Check, Incident, Performance, Performed, Recovery
from handey_studio.task.plan import Attempt, GraspChoice, MoveCommand, MovePlan, MoveResult, Step
from handey_studio.task.ruled_out import RuledOut
from handey_studio.task.run import Station, execute_in, plan_in, run_move, sense
from handey_studio.task.search import SearchOptions
from handey_studio.task.sense import Scene, believed_world

__all__ = [
    "Attempt",
    "Check",
    "GraspChoice",
    "Incident",
    "MoveCommand",
    "MoveOptions",
    "MovePlan",
    "MoveResult",
    "Performance",
    "Performed",
    "Recovery",
    "RuledOut",
    "Scene",
    "SearchOptions",
    "Start",
    "Station",
    "Step",
    "believed_world",
    "check_command",
    "execute_in",
    "format_pose",
    "goal_poses",
    "parse_destination",
    "plan_in",
    "plan_move",
    "run_move",
    "sense",
]
