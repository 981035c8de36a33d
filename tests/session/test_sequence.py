"""A session's commands run as a list: step, stop, resume, skip, and go on after a failure."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.workcell import TrueBody
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.session import CommandState, Session, session_from_bytes, session_to_bytes
from handey_studio.session.run import cell_of
from handey_studio.session.sequence import from_the_start, next_command, run_list, skipped, states_of
from handey_studio.task import MoveCommand
from tests.session.test_run import Watching
from tests.task.troubled import LIBRARY, workcell

FIRST, SECOND = MoveCommand("brick", "0.48,0.08,0.015,0,0,60"), MoveCommand("brick", "0.42,-0.06,0.015,0,0,0")
NOWHERE = MoveCommand("brick", "0.48,0.08,0.5,0,0,60")


def fresh(*commands: MoveCommand) -> Session:
    return Session("list", workcell(), (LIBRARY.part("brick"),), commands)


def statuses(session: Session) -> list[str]:
    return [state.status for state in states_of(session)]


def test_a_list_is_stepped_saved_and_resumed_where_it_stopped():
    session, watching = fresh(FIRST, SECOND), Watching()
    assert statuses(session) == ["waiting", "waiting"] and next_command(session) == 0
    session = run_list(session, LIBRARY, watching, most=1)
    assert statuses(session) == ["done", "waiting"], session.results[-1].reason
    assert [statuses(shown)[0] for shown in watching.shown] == ["running", "done"]
    session = session_from_bytes(session_to_bytes(session), "x")
    session = run_list(session, LIBRARY, Watching())
    assert statuses(session) == ["done", "done"] and len(session.results) == 2 and next_command(session) is None
    assert np.linalg.norm(cell_of(session, LIBRARY).true_pose("brick")[:3, 3] - (0.42, -0.06, 0.015)) < 0.002
    assert run_list(session, LIBRARY, Watching()) == session, "what is over is not run again"
    assert statuses(from_the_start(session)) == ["waiting", "waiting"]


def test_a_failure_stops_the_list_or_not_and_can_be_skipped():
    stopped = run_list(fresh(NOWHERE, FIRST), LIBRARY, Watching())
    assert statuses(stopped) == ["failed", "waiting"] and next_command(stopped) == 0
    session = run_list(skipped(stopped, 0), LIBRARY, Watching())
    assert statuses(session) == ["skipped", "done"] and session.results[states_of(session)[1].result].command == FIRST
    assert statuses(run_list(fresh(NOWHERE, NOWHERE), LIBRARY, Watching(), go_on=True)) == ["failed", "waiting"], "it is the same brick"


def buried(*commands: MoveCommand) -> Session:
    """A brick with a wedge on it."""
    bare = workcell()
    brick = bare.setup.bodies[0]
    wedge = TrueBody("wedge", brick.T_world_body @ from_xyz_rpy((-0.03, -0.02, 0.015), (0.0, 0.0, 0.0)), part="wedge")
    setup = replace(bare.setup, bodies=(brick, wedge))
    parts = LIBRARY.part("brick"), LIBRARY.part("wedge")
    return Session("list", replace(bare, parts=("brick", "wedge"), setup=setup), parts, commands)


def test_what_lies_under_something_is_postponed_and_comes_back():
    session, watching = buried(FIRST, MoveCommand("wedge", "0.36,-0.02,0")), Watching()
    stepped = run_list(session, LIBRARY, watching, most=1)
    assert statuses(stepped) == ["postponed", "waiting"] and next_command(stepped) == 1
    assert "lies or leans on" in stepped.results[0].reason
    session = session_from_bytes(session_to_bytes(stepped), "x")
    ended = run_list(session, LIBRARY, watching)
    assert statuses(ended) == ["done", "done"], [result.reason for result in ended.results]
    assert [result.command.part for result in ended.results] == ["brick", "wedge", "brick"]


def test_what_nothing_helps_has_failed_and_what_needs_it_waits():
    alone = run_list(buried(FIRST, SECOND), LIBRARY, Watching())
    assert statuses(alone) == ["failed", "waiting"], "SECOND is about the same brick"
    upon = replace(
        alone, commands=(FIRST, MoveCommand("wedge", "on:brick:top")), states=(CommandState("postponed", 0),), results=alone.results
    )
    assert next_command(upon) is None, "it stands on the part that the first one moves"
    other = replace(upon, commands=(FIRST, MoveCommand("wedge", SECOND.to)))
    assert next_command(other) == 1


def test_cancelled_the_command_waits_again():
    session = run_list(fresh(FIRST), LIBRARY, Watching(stop_after=3))
    assert statuses(session) == ["waiting"] and next_command(session) == 0


def test_a_changed_command_waits_and_states_that_fit_nothing_do_no_harm():
    session = replace(fresh(FIRST, SECOND), states=(CommandState("done", 7), CommandState("skipped"), CommandState("failed", 0)))
    assert statuses(session) == ["waiting", "skipped"]
    assert session_from_bytes(session_to_bytes(session), "x").states == session.states


def test_nothing_moves_when_a_later_command_means_nothing():
    with pytest.raises(BadInput, match="gear"):
        run_list(fresh(FIRST, MoveCommand("gear", "0,0,0")), LIBRARY, Watching())
