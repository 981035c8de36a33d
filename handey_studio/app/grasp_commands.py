"""What a user can ask for in the Grasp tab, as values."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.grasp_look import GraspLook
from handey_studio.app.pictures.table import layout_of
from handey_studio.app.state import State
from handey_studio.geometry.transforms import apply, transform
from handey_studio.grasping import GOAL, START
from handey_studio.session.handling import row_of

BESIDE_M = (0.35, -0.35)  # on the table, beside the scan area
AWAY_M = np.array([0.24, -0.30, 0.24])


@dataclass(frozen=True)
class ShowObstacles:
    """Whose filled cells the grasp plane shows."""

    which: str

    def apply(self, state: State) -> State:
        return replace(state, grasp_look=replace(state.grasp_look, obstacles=self.which))


@dataclass(frozen=True)
class PickClass:
    """Look at a grasp class, or no longer, if it is the one that is looked at."""

    number: int

    def apply(self, state: State) -> State:
        told, look = state.handling, looked_at(state)
        if told is None or not 0 <= self.number < len(told.classes):
            return state
        number = None if look.grasp_class == self.number else self.number
        return replace(state, grasp_look=replace(look, part=told.part, grasp_class=number))


@dataclass(frozen=True)
class PickCell:
    """Look at a row or a cell of the grasp–placement table, or no longer, if it is looked at; `code` as its picture numbers them."""

    code: int

    def apply(self, state: State) -> State:
        told, look = state.handling, looked_at(state)
        picked = None if told is None else layout_of(told, look.grasp_class).picked(told, self.code)
        if told is None or picked is None:
            return state
        row, column = (None, None) if picked == (look.row, look.column) else picked
        return replace(state, grasp_look=replace(look, part=told.part, row=row, column=column))


@dataclass(frozen=True)
class LookAway:
    """Look at no class, row or cell."""

    def apply(self, state: State) -> State:
        return replace(state, grasp_look=GraspLook(state.grasp_look.obstacles))


@dataclass(frozen=True)
class LookAtStanding:
    """One browser's camera goes to the ghost that shows the row."""

    client: int | None

    def run(self, bench: Any) -> State:
        pose, told = standing_pose(bench.state), bench.state.handling
        if pose is None or told is None:
            return bench.state.told("Click a row of the table first: it says how the part is to stand.")
        middle = apply(pose, told.part.solid.vertices.mean(axis=0))
        bench.look(middle + AWAY_M, middle, self.client)
        return bench.state


def looked_at(state: State) -> GraspLook:
    """What is looked at of the part that the tab shows; nothing of it, if it was another part."""
    look, told = state.grasp_look, state.handling
    return look if told is not None and look.part is told.part else GraspLook(look.obstacles)


def standing_pose(state: State) -> NDArray | None:
    """T_world_part of the row that is looked at: an end of the MOVE, where the plan put it down like that, else beside the scan area."""
    told, row, result = state.handling, looked_at(state).row, state.session.result
    if told is None or row is None:
        return None
    if row in (START, GOAL):
        at_end = None if result is None else (result.T_world_part_start if row == START else result.T_world_part_goal)
        return told.T_world_part if at_end is None else at_end
    carries = state.replay.plan.carries if state.replay is not None else ()
    for carry in carries[:-1]:
        if row_of(told.table, carry.T_world_part_goal) == row:
            return carry.T_world_part_goal
    aside = transform(translation=(*BESIDE_M, state.session.workcell.table_z))
    return aside @ told.table.Ts_plane_part[row]
