"""The Cell tab: the outside world, disturbed on purpose and calibrated."""

import viser

from handey_studio.app.panels.calibration import CalibrationPanel
from handey_studio.app.panels.disturbing import DisturbingPanel
from handey_studio.app.state import State
from handey_studio.app.wire import Send


class CellPanel:
    """One folder each."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        with gui.add_folder("Disturb the cell"):
            self._disturbing = DisturbingPanel(gui, send)
        with gui.add_folder("Calibrate the range finder"):
            self._calibration = CalibrationPanel(gui, send)

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        self._disturbing.render(old, new)
        self._calibration.render(old, new)


def _looks(state: State) -> tuple:
    setup, plan = state.session.workcell.setup, state.attempt.plan if state.attempt is not None else None
    return state.loads, state.job, setup.physics, setup.faults, id(setup), id(plan), id(state.calibration), state.outcomes
