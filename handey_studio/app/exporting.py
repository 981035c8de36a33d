"""The plan that is looked at, downloaded for a robot controller."""

import json
from dataclasses import dataclass, replace

from handey_studio.app.actions import Bench
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.task.export import FORMS, program_from_move, program_text
from handey_studio.task.report import move_report


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


def exported(state: State, form: str) -> str:
    """The text of the plan that is looked at. Raises BadInput with what lies beyond the robot's limits."""
    told, result = state.attempt, state.session.result
    if told is None or result is None:
        raise BadInput("there is no plan to export yet; press Plan first.")
    planned = replace(result, status="planned", reason="", plan=told.plan, performance=None, attempts=())
    report = move_report([planned], state.robot)
    return program_text(program_from_move(json.dumps(report).encode()), state.robot, form)[0]
