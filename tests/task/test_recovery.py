"""MOVEs in a cell that gets into trouble: each kind is noticed, told, put right, and never called done when it is not."""

import json
import threading

import numpy as np
import pytest

from handey_studio.cell.protocol import Moved
from handey_studio.geometry.transforms import pose_difference
from handey_studio.session import Session, session_from_bytes, session_to_bytes
from handey_studio.task import MoveCommand, MoveOptions, run_move
from handey_studio.task.acting.way_back import _reversed
from handey_studio.task.report import move_report
from tests.task.troubled import COMMAND, GOAL, LIBRARY, Troubled, moved, station, workcell

TROUBLES = ("missed", "dropped", "blocked", "early contact", "wrong place", "moved")


def off(cell: Troubled) -> tuple[float, float]:
    truth = cell.true_pose("brick")
    return min((pose_difference(truth @ S, GOAL) for S in LIBRARY.part("brick").symmetries), key=lambda one: one[1])


@pytest.fixture(scope="module")
def recovered():
    """Each trouble once, with what came of it."""
    outcomes = {}
    for trouble in TROUBLES:
        cell = Troubled(trouble)
        outcomes[trouble] = cell, moved(cell)
    return outcomes


@pytest.mark.parametrize("trouble", TROUBLES)
def test_a_trouble_is_noticed_and_put_right(recovered, trouble):
    cell, outcome = recovered[trouble]
    result = outcome.result
    assert result.status == "done", result.reason
    assert [incident.kind for incident in result.incidents] == [trouble]
    (attempt,) = result.attempts
    assert attempt.recovery.incident.kind == trouble and attempt.recovery.why
    metres, radians = off(cell)
    assert metres < 0.002 and radians < np.deg2rad(1.0)
    assert cell.held_truly() is None and outcome.after is not None
    assert np.allclose(cell.joints(), station().robot.home, atol=0.01)


def test_what_failed_is_ruled_out_and_the_ledger_tells(recovered):
    result = recovered["missed"][1].result
    ruled_out = result.attempts[0].recovery.ruled_out
    assert ruled_out is not None and ruled_out.kind == "grasp"
    before, now = result.attempts[0].plan.carries[0].grasp, result.plan.carries[0].grasp
    metres, radians = pose_difference(before.T_hand_part, now.T_hand_part)
    assert metres > 0.008 or radians > np.deg2rad(15.0)
    assert any(entry.stage == "recovery" for entry in result.ledger)
    assert any((entry.reason or "").startswith("ruled out") for entry in result.ledger)
    assert any(entry.stage == "step" and entry.reason and "closed on nothing" in entry.reason for entry in result.ledger)


def test_a_part_that_is_still_held_is_put_back_before_anything_else(recovered):
    for trouble in ("blocked", "early contact"):
        recovery = recovered[trouble][1].result.attempts[0].recovery
        assert recovery.actions[0] == "the part is put back where it was taken up"
    assert "the hand opens" in recovered["dropped"][1].result.attempts[0].recovery.actions


def test_without_a_budget_the_reason_is_told_and_nothing_is_called_done():
    for trouble in ("missed", "wrong place"):
        cell = Troubled(trouble)
        result = moved(cell, attempts=1).result
        assert result.status == "failed" and "the budget of 1 attempts is spent" in result.reason
        assert result.incidents[-1].kind == trouble and off(cell)[0] > 0.002


def test_fingers_that_stick_for_a_while_are_overcome_on_the_spot():
    cell = Troubled("hand stuck", times=2)
    result = moved(cell).result
    assert result.status == "done", result.reason
    (incident,) = result.incidents
    assert incident.kind == "hand stuck" and incident.overcome and not result.attempts


def test_fingers_that_do_not_let_go_end_the_move_with_the_part_in_the_hand():
    cell = Troubled("hand stuck", times=10**6)
    result = moved(cell).result
    assert result.status == "failed" and "do not let go" in result.reason
    assert cell.held_truly() == "brick"


def test_the_budget_ends_a_trouble_that_stays():
    cell = Troubled("missed", times=10**6)
    result = moved(cell, attempts=2).result
    assert result.status == "failed" and [incident.kind for incident in result.incidents] == ["missed", "missed"]
    assert np.linalg.norm(cell.true_pose("brick")[:2, 3] - GOAL[:2, 3]) > 0.1


def test_a_place_that_nobody_sees_is_told():
    cell = Troubled()
    result = moved(cell, command=MoveCommand("brick", "0.48,0.30,0.015,0,0,60")).result
    assert result.status == "done" and result.check is not None and result.check.found == "hidden"
    assert "not seen" in result.reason and "by the arm's joints" in result.reason


def test_what_happened_is_in_the_json_and_in_a_session(recovered):
    result = recovered["dropped"][1].result
    (move,) = move_report([result], station().robot, recordings=True)["moves"]
    json.dumps(move, allow_nan=False)
    assert move["attempts"] == 2 and move["incidents"][0]["kind"] == "dropped" and move["incidents"][0]["attempt"] == 1
    assert move["recovery"][0]["ruled_out"]["kind"] == "grasp" and move["check"]["off_m"] < 0.002
    whats = [one["what"] for one in move["recordings"] if one["attempt"] == 2]
    assert whats[-3:] == ["open", "retreat", "free"] and "transfer" in whats
    assert all(len(one["time_s"]) == len(one["q_rad"]) == len(one["force_N"]) for one in move["recordings"])
    told = {entry.id: entry for entry in result.ledger}
    assert told[result.incidents[0].entry].reason == result.incidents[0].sentence == result.attempts[0].recovery.incident.sentence
    assert result.attempts[0].recovery.incident.entry == result.incidents[0].entry == move["incidents"][0]["entry"]
    assert result.attempts[0].scan is not None and [placed.name for placed in result.attempts[0].located] == ["brick#1"]
    session = Session(
        "kept", workcell(), (LIBRARY.part("brick"),), (result.command,), scene=recovered["dropped"][1].scene, results=(result,)
    )
    data = session_to_bytes(session)
    assert session_from_bytes(data, "x").results[0].attempts == result.attempts
    assert len(data) < 3_500_000


def test_the_way_back_begins_at_rest_wherever_on_a_step_the_arm_was_stopped(recovered):
    transfer = next(step for step in recovered["blocked"][1].result.plan.steps if step.kind == "transfer")
    for k in (len(transfer.time_s) // 3, len(transfer.time_s) // 2, len(transfer.time_s) - 1):
        back = _reversed(transfer, transfer.q_rad[k])
        assert np.array_equal(back.q_rad, transfer.q_rad[: k + 1][::-1]) and (np.diff(back.time_s) > 0).all()
        speed = np.abs(np.diff(back.q_rad, axis=0) / np.diff(back.time_s)[:, None]).max(axis=1)
        planned = np.abs(np.diff(transfer.q_rad, axis=0) / np.diff(transfer.time_s)[:, None]).max()
        assert speed.max() <= 0.5 * planned + 1e-9 and speed[0] < 0.1 * planned


class Endless(Troubled):
    """Its transfer ends only when the cell is told to stop."""

    def __init__(self, broken_off: bool = False) -> None:
        super().__init__()
        self.halt, self.broken_off = threading.Event(), broken_off

    def stop(self) -> None:
        self.halt.set()

    def follow(self, motion):
        done = super().follow(motion)
        if self.carried != 2:
            return done
        if self.broken_off:
            raise KeyboardInterrupt
        return Moved("stopped", done.recording) if self.halt.wait(20.0) else done


class Impatient:
    """Cancels a moment after a step of this kind began."""

    def __init__(self, kind: str) -> None:
        self._kind, self._cancelled = kind, threading.Event()

    def report(self, fraction: float, message: str) -> None:
        if message.startswith("step") and message.endswith(self._kind):
            threading.Timer(0.05, self._cancelled.set).start()

    @property
    def cancelled(self) -> bool:
        return self._cancelled.is_set()


def test_a_cancel_stops_the_arm_in_the_middle_of_a_motion():
    cell = Endless()
    result = run_move(station(), cell, COMMAND, MoveOptions(seed=1), progress=Impatient("transfer")).result
    assert cell.halt.is_set() and (result.status, result.reason) == ("failed", "cancelled")
    assert result.performance is not None and result.performance.performed[-1].what == "transfer"
    assert cell.held_truly() == "brick", "what is held is not let go of, and nothing else is begun"


def test_an_interrupted_program_leaves_no_arm_moving():
    cell = Endless(broken_off=True)
    with pytest.raises(KeyboardInterrupt):
        run_move(station(), cell, COMMAND, MoveOptions(seed=1))
    assert cell.halt.is_set()
