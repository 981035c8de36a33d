"""Where a browser's camera goes: named views, and along with the hypothesis that is looked at."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.actions import Bench
from handey_studio.app.commands import Command
from handey_studio.app.looking_at import ShowLayer
from handey_studio.app.scene.cspace import LAYER as CSPACE
from handey_studio.app.scene.cspace import MIDDLE_M
from handey_studio.app.state import State
from handey_studio.geometry.transforms import apply
from handey_studio.localization import Hypothesis
from handey_studio.session import ViewState

CLOSE_UP = 2.6  # diameters of a part from which one looks at it
NEEDS_PLAN = {
    "Grasp": "There is no grasp to look at yet; press Plan first.",
    "Hand": "There is no way of the hand to look at yet; press Plan first.",
    "C-space": "There is no configuration space to look at yet; press Plan first.",
}
NEAR_M = 0.03  # a camera that looks no farther past a hypothesis looks at it


@dataclass(frozen=True)
class LookFrom:
    """One browser's camera goes to a named place."""

    view: str
    client: int | None

    def run(self, bench: Bench) -> State:
        if self.view in NEEDS_PLAN and bench.state.replay is None:
            return bench.state.told(NEEDS_PLAN[self.view], client=self.client)
        if self.view == "Hypothesis" and bench.state.hypothesis is None:
            return bench.state.told("No hypothesis is looked at; press N, or choose one under Located.", client=self.client)
        position, look_at = viewpoint(self.view, bench.state)
        bench.look(position, look_at, self.client)
        return ShowLayer(CSPACE, True).apply(bench.state) if self.view == "C-space" else bench.state


@dataclass(frozen=True)
class Follow:
    """Look at another hypothesis; a camera that is close to the one before goes along."""

    command: Command
    client: int | None

    def run(self, bench: Bench) -> State:
        before, after = bench.state, self.command.apply(bench.state)
        if before.hypothesis is None or after.hypothesis is None:
            return after
        here, there = middle_of(before, before.hypothesis), middle_of(after, after.hypothesis)
        view = before.session.view
        if np.linalg.norm(view.camera_look_at - here) < NEAR_M and np.linalg.norm(there - here) > 0.0:
            bench.look(view.camera_position + there - here, view.camera_look_at + there - here, self.client)
        return after


def middle_of(state: State, hypothesis: Hypothesis) -> NDArray:
    """Where the part of a hypothesis has its middle (3,) [m]."""
    part = state.session.part(hypothesis.part)
    return apply(hypothesis.T_world_part, part.solid.vertices.mean(axis=0) if part is not None else np.zeros(3))


def viewpoint(view: str, state: State) -> tuple[NDArray, NDArray]:
    """Camera position and point to look at (3,) [m] of a named view."""
    finder, replay = state.session.workcell.finder, state.replay
    middle = finder.T_world_range[:3, 3] + finder.T_world_range[:3, :3] @ (finder.area[0] / 2, finder.area[1] / 2, 0.0)
    if view == "Top":
        return _seen_from(middle, (-0.001, 0.0, 0.85))
    if view == "Grasp" and replay is not None:
        return _seen_from(replay.plan.T_world_part_start[:3, 3], (0.22, -0.26, 0.20))
    if view == "Hand" and replay is not None:
        return _seen_from(replay.at(state.session.view.time_s).T_world_part[:3, 3], (0.30, -0.34, 0.26))
    if view == "C-space" and replay is not None and replay.plan.carries[0].space is not None:
        return _seen_from(MIDDLE_M - np.array([0.0, 0.0, 0.16]), (1.4, -2.0, 1.15))  # above the timeline
    if view == "Hypothesis" and state.hypothesis is not None:
        return _close_to(state, state.hypothesis)
    if view == "Workcell":
        return ViewState().camera_position, ViewState().camera_look_at
    return _seen_from(middle, (0.42, -0.46, 0.40))


def _close_to(state: State, hypothesis: Hypothesis) -> tuple[NDArray, NDArray]:
    """The whole part fills the middle of the view, from above and the front."""
    part = state.session.part(hypothesis.part)
    away = CLOSE_UP * (part.solid.diameter if part is not None else 0.1)
    return _seen_from(middle_of(state, hypothesis), (0.36 * away, -0.58 * away, 0.73 * away))


def _seen_from(point: NDArray, offset: tuple[float, float, float]) -> tuple[NDArray, NDArray]:
    return point + np.array(offset), point
