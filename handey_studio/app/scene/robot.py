"""The arm as it is, solid, and as it was to be, pale: what the planner plans with is what is shown."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.scene.arm_model import ArmModel
from handey_studio.app.state import State
from handey_studio.session import Moment
from handey_studio.world import Robot, arm_of

ROOT, PLANNED = "/robot", "/planned_robot"
GHOST_OPACITY = 0.28
SEEN_M = 0.004  # a ghost nearer than this to the arm would only stain its faces


class RobotScene:
    """The arm at the time that is looked at."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._model: ArmModel | None = None

    def render(self, old: State | None, new: State) -> None:
        if self._model is None or old is None or old.robot != new.robot:
            self._server.scene.remove_by_name(ROOT)
            self._model, old = ArmModel(self._server, ROOT, new.robot), None
        if old is None or _hidden(old) != _hidden(new):
            self._model.root.visible = not _hidden(new)
        if old is None or _pose(old) != _pose(new):
            self._model.move(*_configuration(new))


class PlannedArmScene:
    """While what really happened is played: the arm where its command had it, wherever that can be told from the arm itself."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._model: ArmModel | None = None
        self._robot: Robot | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _pose(old) == _pose(new) and old.session.view == new.session.view and old.robot == new.robot:
            return
        moment = new.moment
        shown = moment is not None and "planned arm" not in new.session.view.hidden_layers and hand_off(new.robot, moment) > SEEN_M
        if shown and moment is not None:
            self._of(new.robot).move(moment.q_command_rad, moment.hand_opening_m)
        if self._model is not None and self._model.root.visible != shown:
            self._model.root.visible = shown

    def _of(self, robot: Robot) -> ArmModel:
        """The ghost, made when it is first needed: few MOVEs ever show it."""
        if self._model is None or self._robot != robot:
            self._server.scene.remove_by_name(PLANNED)
            self._model, self._robot = ArmModel(self._server, PLANNED, robot, palette.BLUE, GHOST_OPACITY), robot
        return self._model


def hand_off(robot: Robot, moment: Moment) -> float:
    """How far [m] the hand's origin is from where its command had it."""
    poses = arm_of(robot).hand_pose(np.array([moment.q_rad, moment.q_command_rad]))
    return float(np.linalg.norm(poses[0, :3, 3] - poses[1, :3, 3]))


def _configuration(state: State) -> tuple[NDArray, float]:
    """Joints [rad] and opening [m] at the time that is looked at; at home when there is no plan."""
    moment = state.moment
    return (state.robot.home, state.robot.hand.opening_max) if moment is None else (moment.q_rad, moment.hand_opening_m)


def _pose(state: State) -> tuple:
    return id(state.replay), state.session.view.time_s


def _hidden(state: State) -> bool:
    return "robot" in state.session.view.hidden_layers
