"""The wrist box around the real wrist: what the configuration space was computed with (Handey 1987 §4)."""

import numpy as np
import viser

from handey_studio.app import palette
from handey_studio.app.scene.units import scaled
from handey_studio.app.state import State
from handey_studio.task.plan import Carry

LAYER = "wrist box"
NAME = "/robot/link{link}/wrist_box"  # it goes with the link that carries the wrist
TOUCHING = [(a, b) for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1]  # corners that a side joins


class WristBoxScene:
    """Shown while the arm carries the part across: the box is of that motion."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._lines: viser.LineSegmentsHandle | None = None
        self._carry: Carry | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is None or self._carry is not new.carry or old.robot != new.robot:
            self._build(new)
        if self._lines is not None and self._lines.visible != _shown(new):
            self._lines.visible = _shown(new)

    def _build(self, state: State) -> None:
        if self._lines is not None:
            self._lines.remove()
        self._lines, self._carry = None, state.carry
        if self._carry is None or self._carry.space is None:
            return
        space = self._carry.space
        sides = np.array([(space.wrist_box[a], space.wrist_box[b]) for a, b in TOUCHING])
        self._lines = self._server.scene.add_line_segments(
            NAME.format(link=space.wrist_box_link), scaled(sides), colors=palette.BLUE, thickness=2.0, thickness_units="screen"
        )


def _shown(state: State) -> bool:
    replay, moment = state.replay, state.moment
    if replay is None or moment is None or moment.held is None or LAYER in state.session.view.hidden_layers:
        return False
    return replay.plan.steps[replay.step_at(state.session.view.time_s)].kind == "transfer"
