"""§2: MOVE object TO destination — the options, their search, the plan, its execution."""

from handey_studio.task.acting.execution import Order, Outcome, carry_out
from handey_studio.task.acting.performance import Check, Incident, Performance, Performed, Recovery
from handey_studio.task.acting.recover import RecoveryOptions
from handey_studio.task.carrying import Start
from handey_studio.task.destination import format_pose, goal_poses, parse_destination
from handey_studio.task.move import MoveOptions, check_command, plan_move
from handey_studio.task.plan import Attempt, GraspChoice, MoveCommand, MovePlan, MoveResult, Step
from handey_studio.task.planning import Station, plan_in, sense, understood
from handey_studio.task.ruled_out import RuledOut
from handey_studio.task.run import execute_in, run_move
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
    "Order",
    "Outcome",
    "Performance",
    "Performed",
    "Recovery",
    "RecoveryOptions",
    "RuledOut",
    "Scene",
    "SearchOptions",
    "Start",
    "Station",
    "Step",
    "believed_world",
    "carry_out",
    "check_command",
    "execute_in",
    "format_pose",
    "goal_poses",
    "parse_destination",
    "plan_in",
    "plan_move",
    "run_move",
    "sense",
    "understood",
]
