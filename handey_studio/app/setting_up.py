"""Setting up a MOVE: what goes where, with which arm, how often it is tried. Each is a step that can be undone."""

from dataclasses import dataclass, replace

from numpy.typing import NDArray

from handey_studio.app.jobs import check_idle
from handey_studio.app.settings import with_robot
from handey_studio.app.state import State, with_view
from handey_studio.base import BadInput
from handey_studio.geometry.transforms import is_rigid
from handey_studio.session.checks import MAX_ATTEMPTS, MAX_IMPROVE
from handey_studio.session.command_list import with_commands
from handey_studio.session.destination import check_command, destination_pose, destinations_on_parts, snapped
from handey_studio.task.destination import format_pose
from handey_studio.task.plan import MoveCommand

POSE_LABEL = "a pose on the table"
FREE_TABLE = "0.35,-0.35,0,0,0,0"  # beside the scan area, in every robot's reach


@dataclass(frozen=True)
class ChoosePart:
    """MOVE this part, to where parts of its kind can go."""

    part: str

    def apply(self, state: State) -> State:
        part = state.session.part(self.part)
        if part is None:
            raise BadInput(f'part "{self.part}" is not in this workcell; it has {", ".join(state.session.workcell.parts) or "none"}.')
        mates = destinations_on_parts(state.session, part)
        free = state.command is not None and not state.command.to.startswith("on:")
        to = state.command.to if state.command and free else (mates[0] if mates else FREE_TABLE)
        return _with_command(state, f"choose {self.part}", MoveCommand(self.part, to))


@dataclass(frozen=True)
class SetDestination:
    """TO these words: `x,y,z[,roll,pitch,yaw]`, `on:PART[:POSE]` or `in:x0,y0,x1,y1`."""

    to: str
    label: str = "set destination"

    def apply(self, state: State) -> State:
        if state.command is None:
            raise BadInput("choose a part to move first.")
        return _with_command(state, self.label, MoveCommand(state.command.part, self.to))


@dataclass(frozen=True, eq=False)
class DropGhost:
    """The ghost was let go at this pose; it snaps."""

    T_world_part: NDArray

    def apply(self, state: State) -> State:
        part = state.session.part(state.command.part) if state.command else None
        if part is None or not is_rigid(self.T_world_part, 1e-3):
            return state
        to = format_pose(snapped(part, self.T_world_part, state.session.workcell.table_z))
        return SetDestination(to, "drag destination").apply(state)


@dataclass(frozen=True)
class FreePose:
    """The destination becomes a pose of its own, where the ghost is now, or on free table if it has no place yet."""

    def apply(self, state: State) -> State:
        pose = destination_pose(state.session, state.command) if state.command else None
        to = format_pose(pose) if pose is not None else FREE_TABLE
        return SetDestination(to, f"choose {POSE_LABEL}").apply(state)


@dataclass(frozen=True)
class SetSeed:
    seed: int

    def apply(self, state: State) -> State:
        if not 0 <= self.seed < 2**31:
            raise BadInput(f"the seed is {self.seed}; it must be a whole number from 0 to {2**31 - 1}.")
        return state.changed("set seed", replace(state.session, seed=self.seed))


@dataclass(frozen=True)
class SetAttempts:
    """How often a MOVE is tried, the first time among them."""

    attempts: int

    def apply(self, state: State) -> State:
        return state.changed("set attempts", replace(state.session, attempts=min(max(1, self.attempts), MAX_ATTEMPTS)))


@dataclass(frozen=True)
class SetImprove:
    """How many more plans are looked at once there is one."""

    improve: int

    def apply(self, state: State) -> State:
        return state.changed("look for a better plan", replace(state.session, improve=min(max(0, self.improve), MAX_IMPROVE)))


@dataclass(frozen=True)
class ChooseRobot:
    """Another arm of the library stands in the workcell."""

    robot: str

    def apply(self, state: State) -> State:
        lost = bool(state.session.results) and self.robot != state.session.workcell.robot
        changed = state.changed("choose robot", with_robot(state.session, self.robot))
        return changed.told("What was planned for the arm before is gone; what was scanned stays.") if lost else changed


@dataclass(frozen=True)
class ResetCell:
    """The cell as it was before the first MOVE, and nothing sensed or planned."""

    def apply(self, state: State) -> State:
        check_idle(state)
        state = replace(state, session=state.session.without_findings(), playing=False)
        return state.told("The cell is as it was before the first MOVE; nothing is scanned or planned.")


def _with_command(state: State, label: str, command: MoveCommand) -> State:
    """The MOVE set up anew; whoever sets it up looks at its ghost, no longer at a hypothesis."""
    check_command(state.session, command)
    session = with_view(state, hypothesis=-1).session
    commands = list(session.commands) or [command]
    commands[state.command_number] = command
    return state.changed(label, with_commands(session, tuple(commands)))
