"""The plan that is looked at, downloaded: for a robot controller, or as a page that plays it."""

import json
from dataclasses import dataclass, replace

import numpy as np

from handey_studio.app.actions import Bench
from handey_studio.app.state import State, with_view
from handey_studio.base import BadInput
from handey_studio.task.export import FORMS, program_from_move, program_text
from handey_studio.task.report import move_report

REPLAY_HZ = 15.0


@dataclass(frozen=True)
class ExportPlan:
    """The plan goes to one browser as a file in a format of `FORMS`, if the dry check passes."""

    form: str
    client: int | None

    def run(self, bench: Bench) -> State:
        text = exported(bench.state, self.form)
        client = bench.client(self.client)
        if client is not None:
            client.send_file_download(f"{bench.state.session.name}{FORMS[self.form].suffix}", text.encode(), save_immediately=True)
        return bench.state.told("The plan passed the dry check against the robot's limits and was sent as a file.", "good", self.client)


@dataclass(frozen=True)
class ExportReplay:
    """What the scene shows goes to one browser as a page of its own, which plays the attempt that is looked at and needs no workbench."""

    client: int | None

    def run(self, bench: Bench) -> State:
        client, states = bench.client(self.client), replay_states(bench.state)
        if client is None:
            return bench.state
        notice = client.add_notification("Handey Studio", "The replay is being recorded.", loading=True)
        page = bench.recorded(states, 1.0 / REPLAY_HZ)
        notice.remove()
        client.send_file_download(f"{bench.state.session.name}.html", page.encode(), save_immediately=True)
        return bench.state.told("The replay was sent as a page; any browser plays it, by itself.", "good", self.client)


def replay_states(state: State) -> list[State]:
    """The state at each moment of the replay. Raises BadInput when there is nothing to play."""
    if state.replay is None:
        raise BadInput("there is nothing to play yet; press Plan or MOVE first.")
    duration = state.replay.duration
    return [with_view(state, time_s=float(t)) for t in np.linspace(0.0, duration, 2 + int(duration * REPLAY_HZ))]


def exported(state: State, form: str) -> str:
    """The text of the plan that is looked at. Raises BadInput with what lies beyond the robot's limits."""
    told, result = state.attempt, state.session.result
    if told is None or result is None:
        raise BadInput("there is no plan to export yet; press Plan first.")
    planned = replace(result, status="planned", reason="", plan=told.plan, performance=None, attempts=())
    report = move_report([planned], state.robot)
    return program_text(program_from_move(json.dumps(report).encode()), state.robot, form)[0]
