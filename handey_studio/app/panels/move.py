"""The left panel: what to do next, and the MOVE command."""

from typing import Any

import numpy as np
import viser

from handey_studio.app import html, palette
from handey_studio.app.actions import CancelMove, StartMove
from handey_studio.app.commands import Redo, Undo
from handey_studio.app.guidance import next_step, stages
from handey_studio.app.page_style import in_a_row
from handey_studio.app.panels.commands import CommandsPanel
from handey_studio.app.scene.destination import ghost_pose
from handey_studio.app.setting_up import (
    POSE_LABEL,
    ChoosePart,
    ChooseRobot,
    FreePose,
    ResetCell,
    SetAttempts,
    SetDestination,
    SetImprove,
    SetSeed,
)
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click, on_user, set_to
from handey_studio.geometry.transforms import from_xyz_rpy, to_xyz_rpy
from handey_studio.session.checks import MAX_ATTEMPTS, MAX_IMPROVE
from handey_studio.session.destination import anywhere, destinations_on_parts
from handey_studio.task.destination import format_pose
from handey_studio.task.plan import MoveCommand

NO_PART = "–"


class MovePanel:
    """MOVE part TO destination, with Plan, MOVE and Cancel."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._next = gui.add_html("")
        self._part = gui.add_dropdown("Part", (NO_PART,))
        self._to = gui.add_dropdown("Destination", (POSE_LABEL,))
        self._xyz = gui.add_vector3("Position (mm)", (0.0, 0.0, 0.0), step=1.0)
        self._rpy = gui.add_vector3("Turn (deg)", (0.0, 0.0, 0.0), step=1.0, hint="Roll, pitch and yaw about the part's origin")
        self._why = gui.add_html("")
        self._plan = gui.add_button("Plan", icon=viser.Icon.ROUTE, color=palette.ARM_DARK, hint="Sense and plan; nothing moves")
        self._move = gui.add_button("MOVE", icon=viser.Icon.PLAYER_PLAY_FILLED, color=palette.BLUE, hint="Sense, plan and carry it out")
        self._cancel = gui.add_button("Cancel", icon=viser.Icon.PLAYER_STOP, color=palette.VERMILLION, visible=False)
        self._bar = gui.add_progress_bar(0.0, animated=True, color=palette.BLUE, visible=False)
        self._undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP, color="gray", visible=False)
        self._redo = gui.add_button("Redo", icon=viser.Icon.ARROW_FORWARD_UP, color="gray", visible=False)
        with gui.add_folder("Options", expand_by_default=False):
            self._seed = gui.add_number("Seed", 0, min=0, max=2**31 - 1, step=1, hint="The same seed gives the same plan")
            self._robot = gui.add_dropdown("Robot", (NO_PART,), hint="The arm in the workcell; what was planned for another goes")
            self._reset = gui.add_button("Reset the cell", icon=viser.Icon.REFRESH, color="gray", hint="As it was before the first MOVE")
            self._attempts = gui.add_number(
                "Attempts", 3, min=1, max=MAX_ATTEMPTS, step=1, hint="How often a MOVE is tried after something went wrong"
            )
            self._improve = gui.add_number(
                "Better plan", 0, min=0, max=MAX_IMPROVE, step=1, hint="How many more plans are looked at, to take the quickest"
            )
        with gui.add_folder("Commands"):
            self._commands = CommandsPanel(gui, send)
        gui.add_html(in_a_row([element_id(self._plan), element_id(self._move)]))
        self._wire(send)

    def _wire(self, send: Send) -> None:
        on_user(self._part, send, lambda event: ChoosePart(event.target.value))
        on_user(self._to, send, lambda event: FreePose() if event.target.value == POSE_LABEL else SetDestination(event.target.value))
        on_user(self._xyz, send, lambda _: self._typed())
        on_user(self._rpy, send, lambda _: self._typed())
        on_user(self._robot, send, lambda event: ChooseRobot(event.target.value))
        on_user(self._seed, send, lambda event: SetSeed(int(event.target.value)))
        on_user(self._attempts, send, lambda event: SetAttempts(int(event.target.value)))
        on_user(self._improve, send, lambda event: SetImprove(int(event.target.value)))
        on_click(self._plan, send, lambda _: StartMove(execute=False))
        on_click(self._move, send, lambda _: StartMove(execute=True))
        on_click(self._cancel, send, lambda _: CancelMove())
        on_click(self._undo, send, lambda _: Undo())
        on_click(self._reset, send, lambda _: ResetCell())
        on_click(self._redo, send, lambda _: Redo())

    def _typed(self) -> SetDestination:
        T = from_xyz_rpy(np.array(self._xyz.value) / 1e3, np.deg2rad(self._rpy.value))
        return SetDestination(format_pose(T), "type destination")

    def render(self, old: State | None, new: State) -> None:
        self._commands.render(old, new)
        if old is not None and _looks(old) == _looks(new):
            return
        row = html.stage_chips(stages(new.job)) if new.job else ""
        set_to(self._next, content=html.card(*next_step(new), testid="next-step") + row)
        self._show_command(new)
        self._show_job(new)
        undo, redo = new.undo[-1:], new.redo[-1:]
        set_to(self._undo, label=f"Undo: {undo[0].label}" if undo else "Undo", visible=bool(undo), disabled=new.job is not None)
        set_to(self._redo, label=f"Redo: {redo[0].label}" if redo else "Redo", visible=bool(redo), disabled=new.job is not None)

    def _show_command(self, state: State) -> None:
        session, command, busy = state.session, state.command, state.job is not None
        names = part_choices(state)
        choose(self._part, names, command.part if command and command.part in names else names[0], busy)
        part = session.part(command.part) if command else None
        mates = destinations_on_parts(session, part) if part else ()
        free = command is None or not command.to.startswith(("on:", "in:"))
        offered = (*mates, anywhere(session))
        extra = () if free or command is None or command.to in offered else (command.to,)
        choose(self._to, (*offered, *extra, POSE_LABEL), POSE_LABEL if free or command is None else command.to, busy or part is None)
        pose = ghost_pose(state)
        set_to(self._xyz, visible=free and pose is not None, disabled=busy)
        set_to(self._rpy, visible=free and pose is not None, disabled=busy)
        if pose is not None:
            xyz, rpy = to_xyz_rpy(pose)
            set_to(self._xyz, value=rounded(1e3 * xyz, 2))
            set_to(self._rpy, value=rounded(np.rad2deg(rpy), 2))
        set_to(self._why, content=_about_destination(free, pose is not None, command), visible=not free)
        set_to(self._seed, value=session.seed, disabled=busy)
        set_to(self._attempts, value=session.attempts, disabled=busy)
        set_to(self._improve, value=session.improve, disabled=busy)
        robots = tuple(sorted({*state.library.robot_folders(), session.workcell.robot}))
        choose(self._robot, robots, session.workcell.robot, busy)

    def _show_job(self, state: State) -> None:
        job = state.job
        ready = state.command is not None and bool(state.session.workcell.parts)
        set_to(self._plan, visible=job is None, disabled=not ready)
        set_to(self._move, visible=job is None, disabled=not ready)
        set_to(self._cancel, visible=job is not None, disabled=bool(job and job.cancelling))
        set_to(self._bar, visible=job is not None, value=100.0 * min(1.0, max(0.0, job.fraction)) if job else 0.0)


def part_choices(state: State) -> tuple[str, ...]:
    """Parts of the workcell, and their instances once several are located."""
    instances = tuple(placed.name for placed in state.session.located if "#" in placed.name)
    return (*state.session.workcell.parts, *instances) or (NO_PART,)


def choose(dropdown: Any, options: tuple[str, ...], value: str, disabled: bool) -> None:
    """Options and choice of a dropdown, without disturbing one that is right already."""
    if tuple(dropdown.options) != options:
        dropdown.options = options
    set_to(dropdown, value=value, disabled=disabled)


def rounded(values: Any, digits: int) -> tuple[float, ...]:
    """Numbers as shown in fields, with no minus zero."""
    return tuple(float(round(float(value), digits)) + 0.0 for value in values)


def _about_destination(free: bool, known: bool, command: MoveCommand | None) -> str:
    if free or command is None:
        return ""
    text = "It goes where it fits onto that part." if known else "The ghost appears once that part is located."
    if command.to.startswith("in:"):
        text = "It goes to a free place in this area of the table (x and y from, x and y to, in metres), standing as it may."
    return f'<div style="margin:0 14px 4px;font-size:12px;color:var(--muted)">{html.esc(text)}</div>'


def _looks(state: State) -> tuple:
    session = state.session
    return (
        state.loads,
        state.command,
        (session.seed, session.attempts, session.improve),
        session.located,
        session.workcell,
        session.result,
        state.job,
        state.undo,
        state.redo,
    )
