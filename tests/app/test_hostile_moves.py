"""Whatever is pressed while MOVEs run, in whatever order: a sound state, one sentence, and nothing lost."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from handey_studio.app.actions import CancelMove, StartMove
from handey_studio.app.commands import Redo, Undo
from handey_studio.app.disturbing import KINDS, AddFault, ClearFaults, SetPhysics
from handey_studio.app.happened import LookAtHappening
from handey_studio.app.jobs import JobDone, JobFailed, JobProgress, JobShows
from handey_studio.app.panels.commands import commands_html
from handey_studio.app.panels.running import happened_html
from handey_studio.app.playback import LookAtAttempt, Seek, SeekStep, Tick, TogglePlay
from handey_studio.app.sequence import AddCommand, ChooseCommand, RemoveCommand, RunCommands, ShiftCommand, SkipCommand, StartOver
from handey_studio.app.session_actions import NewSession
from handey_studio.app.setting_up import ChoosePart, ChooseRobot, ResetCell, SetAttempts, SetDestination
from handey_studio.app.state import BUSY, opened
from handey_studio.base import BadInput
from handey_studio.session import CommandState, session_from_bytes, session_to_bytes
from handey_studio.session.sequence import next_command, states_of
from handey_studio.task.plan import MoveResult
from tests.session.samples import fresh_session, library, performed_session


class Studio:
    """A workbench whose planner answers when, and as often as, it is told to."""

    def __init__(self, folder) -> None:
        self.state, self.planner = opened(library(folder), fresh_session(folder), None), self
        self._performed, self.orders = performed_session(folder), []

    def order(self, number, session, library, execute, run=None) -> None:
        self.orders.append((number, session, execute, run is not None))

    def cancel(self) -> None:
        pass

    def client(self, number) -> None:
        pass

    def look(self, position, look_at, client) -> None:
        pass

    def do(self, command) -> None:
        self.state = command.run(self) if hasattr(command, "run") else command.apply(self.state)

    def answer(self, kind: int, order: int):
        """What the planner says about one of the orders, the last or one that is long over."""
        number, session, execute, listed = self.orders[order]
        if kind < 2:
            return JobProgress(number, 0.3, "step 2 of 5: close") if kind else JobFailed(number, "The planner broke down.")
        found = self._found(session, execute, listed, "cancelled" if kind == 2 else "")
        return JobShows(number, found) if kind == 3 else JobDone(number, found)

    def _found(self, session, execute: bool, listed: bool, reason: str):
        """What the planner would bring back: the MOVE as it was performed once, or by another arm nothing."""
        at = next_command(session) if listed else len(session.commands) - 1
        command, done = session.commands[at or 0], self._performed.results[0]
        ended = replace(done, command=command, reason=reason, status="failed" if reason else "done" if execute else "planned")
        if session.workcell.robot != "ur5":
            ended = MoveResult(command, "failed", "none of 12 options works")
        found = replace(session, scene=self._performed.scene, results=(*session.results, ended) if listed else (ended,))
        found = replace(found, cell_now=replace(session.workcell.setup, seed=5)) if execute else found
        if not listed or at is None:
            return found
        states = list(states_of(session))
        states[at] = CommandState() if reason else CommandState("done" if ended.status == "done" else "failed", len(found.results) - 1)
        return replace(found, states=tuple(states))


def pressed(studio: Studio, rng: np.random.Generator):
    """What a hand presses next, or what the planner says."""
    small, kind = int(rng.integers(-1, 5)), KINDS[rng.integers(len(KINDS))]
    if studio.orders and rng.random() < 0.35:
        return studio.answer(int(rng.integers(5)), -1 if rng.random() < 0.8 else int(rng.integers(len(studio.orders))))
    choices = [
        StartMove(True), StartMove(True), StartMove(False), RunCommands(), RunCommands(step=True), CancelMove(), CancelMove(),
        Undo(), Undo(), Redo(), SetPhysics(bool(rng.integers(2))), AddFault(kind.name, float(rng.uniform(-10, 90)), kind.call, small, 0.1),
        ClearFaults(), ChooseRobot(str(rng.choice(("ur5", "panda", "nonsense")))), ChoosePart("brick"), SetAttempts(small), ResetCell(),
        SetDestination(str(rng.choice(("0.4,0.3,0", "on:nothing", "0.4,0.2,0,0,0,90", "rubbish")))), AddCommand(), RemoveCommand(),
        ShiftCommand(small), ChooseCommand(small), SkipCommand(), StartOver(), NewSession(),
        Seek(float(rng.uniform(-1, 20))), SeekStep(small), Tick(0.2), TogglePlay(), LookAtAttempt(small), LookAtHappening(small),
    ]  # fmt: skip
    return choices[rng.integers(len(choices))]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("hostile")


def check_sound(studio: Studio) -> None:
    state, session = studio.state, studio.state.session
    assert state.robot.name == session.workcell.robot and 0 <= state.command_number < len(session.commands)
    if state.replay is not None:
        assert 0.0 <= session.view.time_s <= state.replay.duration + 1e-9 and state.moment is not None
        assert len(state.moment.q_rad) == len(state.robot.home), "a plan for another arm is not played"
    if session.cell_now is not None:
        setup = session.workcell.setup
        assert (session.cell_now.physics, session.cell_now.faults) == (setup.physics, setup.faults)
    commands_html(state, 0, ["b"] * len(session.commands))
    happened_html(state, ["b"] * 9)


@settings(
    max_examples=40, deadline=None, phases=(Phase.explicit, Phase.generate), suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 10**6))
def test_hostile_hands_while_moves_run_get_sentences_and_lose_nothing(folder, seed):
    rng, studio = np.random.default_rng(seed), Studio(folder)
    for _ in range(40):
        before = studio.state
        try:
            studio.do(pressed(studio, rng))
        except BadInput as error:
            assert studio.state is before and str(error).endswith(".")
        check_sound(studio)
    session = studio.state.session
    assert session_from_bytes(session_to_bytes(session), "copy").commands == session.commands


def test_the_cell_stays_as_it_is_while_the_planner_is_at_work(folder):
    studio = Studio(folder)
    for command in (ChooseRobot("panda"), ChooseRobot("ur5"), SetPhysics(False), StartMove(True)):
        studio.do(command)
    for command in (Undo(), ChooseRobot("panda"), SetPhysics(True), AddFault("slip", 0.0, "follow", 4, 0.1)):
        with pytest.raises(BadInput, match=BUSY):
            studio.do(command)
    studio.do(SetAttempts(5))
    studio.do(Undo())
    studio.do(studio.answer(4, -1))
    assert studio.state.session.result is not None and studio.state.job is None
    studio.do(Undo())
    now = studio.state.session.cell_now
    assert now is not None and now.physics and studio.state.session.workcell.setup.physics
