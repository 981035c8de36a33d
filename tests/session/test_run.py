"""A session's MOVE run in its cell: what was approved is what moves, and the next MOVE finds the cell as it was left."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.session import find_session, read_session, session_from_bytes, session_to_bytes
from handey_studio.session.run import PLANNED, SENSED, cell_of, is_planned, run_session
from handey_studio.task.plan import MoveCommand
from tests.session.samples import fresh_session, library


class Watching:
    """Keeps what was shown; cancels after a number of reports."""

    def __init__(self, stop_after: int = 10**9) -> None:
        self.fractions, self.shown, self._stop_after = [], [], stop_after

    def report(self, fraction: float, message: str) -> None:
        assert message
        self.fractions.append(fraction)

    def show(self, session) -> None:
        self.shown.append(session)

    @property
    def cancelled(self) -> bool:
        return len(self.fractions) >= self._stop_after


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    own = library(tmp_path_factory.mktemp("library"))
    watching = Watching()
    session = read_session(find_session(own, "figure1"))
    return own, run_session(session, own, False, watching), watching


def test_stages_are_shown_as_they_happen(planned):
    _, session, watching = planned
    assert is_planned(session) and session.cell_now is None
    assert watching.shown[0].scene is not None and not watching.shown[0].results
    assert all(0.0 <= fraction <= PLANNED for fraction in watching.fractions)
    assert min(watching.fractions) < SENSED < max(watching.fractions)


def test_a_saved_session_planned_again_gives_the_same_plan(planned):
    own, session, _ = planned
    again = run_session(session_from_bytes(session_to_bytes(session), "x"), own, False, Watching())
    assert again.scene.depth_map == session.scene.depth_map
    assert again.results[0].plan == session.results[0].plan


def test_what_was_approved_moves_and_the_cell_stays_as_it_was_left(planned):
    own, session, _ = planned
    done = run_session(session, own, True, Watching())
    assert done.results[0].status == "done", done.results[0].reason
    assert done.results[0].plan == session.results[0].plan and done.scene is session.scene
    before = {body.name: body.T_world_body for body in session.workcell.setup.bodies}
    moved = [body.name for body in done.cell_now.bodies if np.abs(body.T_world_body - before[body.name])[:3, 3].max() > 0.03]
    assert any(name.startswith("l_block") for name in moved)
    cell = cell_of(session_from_bytes(session_to_bytes(done), "x"), own)
    for body in done.cell_now.bodies:
        np.testing.assert_allclose(cell.true_pose(body.name), body.T_world_body, atol=1e-12)


def test_cancelled_early_it_comes_back_with_its_record(planned):
    own, session, _ = planned
    stopped = run_session(replace(session, results=()), own, True, Watching(stop_after=4))
    assert stopped.cell_now is None
    assert not stopped.results or stopped.results[0].status == "failed"


def test_a_command_that_means_nothing_here_is_bad_input(tmp_path):
    session = fresh_session(tmp_path)
    with pytest.raises(BadInput, match="has no MOVE"):
        run_session(replace(session, commands=()), library(tmp_path), True, Watching())
    with pytest.raises(BadInput, match='"gear" is not known'):
        run_session(replace(session, commands=(MoveCommand("gear", "0,0,0"),)), library(tmp_path), True, Watching())
