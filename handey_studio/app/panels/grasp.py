"""The Grasp tab: the grasp of the plan in numbers, Figures 6 to 10 of Handey 1987, and the grasp–placement table."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from handey_studio.app import html
from handey_studio.app.grasp_commands import LookAtStanding, LookAway, PickCell, PickClass, ShowObstacles, looked_at
from handey_studio.app.pictures.classes import classes_html
from handey_studio.app.pictures.dial import dial_chips, dial_svg, dial_words, window_of
from handey_studio.app.pictures.plane import OBSTACLES, PICKUP, carried_outline, grasp_plane_svg, plane_chips, plane_words
from handey_studio.app.pictures.table import layout_of, table_html
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click, on_user, set_to
from handey_studio.grasping import Grip, hand_outline
from handey_studio.session.handling import fates, way_through
from handey_studio.session.leading import led_at
from handey_studio.session.way_out import way_out
from handey_studio.task.plan import GraspChoice

NO_GRASP = "No grasp yet. Press Plan: this then shows which faces are held, how the hand comes in, and what stood in its way."
NO_PART = "Choose a part on the left: this then shows how the hand can grasp it, and how it can stand on the table."
WAIT = "Working out what the hand can do with this part …"
THERE, AWAY = "Look there", "Clear"
NONE = -1


class GraspPanel:
    """Top to bottom: the grasp, the dial, the grasp plane, the classes, the table."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._grasp = gui.add_html("")
        self._above = gui.add_html(html.heading("Approach in the grasp plane", "Figures 8 to 10"), visible=False)
        self._obstacles = gui.add_dropdown("Obstacles", OBSTACLES, hint="Figure 8: those of the putdown, carried back by the part's motion")
        self._plane = gui.add_html("")
        self._classes = gui.add_html("")
        self._class: Any = gui.add_number("Class picked", NONE, step=1)  # set by a click into a picture, which hides it
        self._table = gui.add_html("")
        self._cell: Any = gui.add_number("Cell picked", NONE, step=1)
        self._look = gui.add_button_group("Table's ghost", (THERE, AWAY))
        on_user(self._obstacles, send, lambda event: ShowObstacles(event.target.value))
        on_user(self._class, send, lambda event: PickClass(int(event.target.value)))
        on_user(self._cell, send, lambda event: PickCell(int(event.target.value)))
        on_click(self._look, send, lambda event: LookAtStanding(event.client_id) if event.target.value == THERE else LookAway())

    def render(self, old: State | None, new: State) -> None:
        if old is None or _grasp_looks(old) != _grasp_looks(new):
            self._render_grasp(new)
        if old is None or _plane_looks(old) != _plane_looks(new):
            self._render_plane(new)
        if old is None or _part_looks(old) != _part_looks(new):
            self._render_part(new)

    def _render_grasp(self, state: State) -> None:
        carry = state.carry
        set_to(self._above, visible=carry is not None)
        set_to(self._obstacles, visible=carry is not None)
        if carry is None:
            self._grasp.content = html.empty(NO_GRASP, "grasp-empty")
            return
        plan = state.replay.plan if state.replay is not None else None
        part = state.session.part(plan.part) if plan is not None else None
        T_world_plane = carry.T_world_part_start @ carry.grasp.T_part_plane
        picture = dial_svg(carry.grasp, T_world_plane, carry.approach.goal, state.robot.hand, part)
        dial = html.figure(picture, dial_chips(carry.grasp), dial_words(carry.grasp))
        which = ""
        if plan is not None and plan.regrasps:
            which = html.card(f"Grasp {plan.carries.index(carry) + 1} of {plan.regrasps + 1}", "The timeline says which one is shown.")
        self._grasp.content = (
            which + html.facts(grasp_facts(carry.grasp), "grasp") + html.heading("Legal hand angles", "Figure 7 of 1987") + dial
        )

    def _render_plane(self, state: State) -> None:
        carry = state.carry
        if carry is None or state.replay is None:
            set_to(self._plane, content="")
            return
        plan, part = state.replay.plan, state.session.part(state.replay.plan.part)
        set_to(self._obstacles, value=state.grasp_look.obstacles)
        led = led_at(state.replay, state.session.view.time_s)
        if led is not None and part is not None:
            picture = grasp_plane_svg(led.run, state.robot.hand, led.at, carry.grasp, part, place=led.place)
            outline = carried_outline(state.robot.hand, carry.grasp, part, led.place)
            self._plane.content = html.figure(picture, plane_chips(PICKUP, carried=True), plane_words(led.run, outline, led.at))
            return
        at, told, number = approach_point(state), state.handling, plan.carries.index(carry)
        putdown = told.putdowns[number] if told is not None and number < len(told.putdowns) else None
        which = state.grasp_look.obstacles if putdown is not None else PICKUP
        out = way_out(state.robot, plan, carry)
        picture = grasp_plane_svg(carry.approach, state.robot.hand, at, carry.grasp, part, putdown, which, out)
        self._plane.content = html.figure(picture, plane_chips(which), plane_words(carry.approach, hand_outline(state.robot.hand), at))

    def _render_part(self, state: State) -> None:
        told, look = state.handling, looked_at(state)
        set_to(self._class, value=NONE)
        set_to(self._cell, value=NONE)
        hidden = html.unseen([element_id(self._class), element_id(self._cell)])
        set_to(self._look, visible=told is not None and look.row is not None)
        if told is None:
            self._classes.content = hidden + html.empty(WAIT if state.to_handle is not None else NO_PART, "classes-empty")
            self._table.content = ""
            return
        result = state.session.result if told.start is not None else None
        chosen = state.carry.grasp.group if state.carry is not None and result is not None else ""
        entries = fates(result.ledger) if result is not None else {}
        pictures = classes_html(told, entries, chosen, look.grasp_class, element_id(self._class))
        self._classes.content = hidden + html.heading(f"Grasp classes of {told.part.name}, ranked", "Figure 6") + pictures
        way = way_through(told.table, result.plan) if result is not None and result.plan is not None else ()
        layout = layout_of(told, look.grasp_class)
        table = table_html(told, layout, look.row, look.column, way, element_id(self._cell))
        self._table.content = html.heading("Grasp–placement table", "Section 5.3") + table


def approach_point(state: State) -> int:
    """How far along the approach in the grasp plane the hand is: a number of a point of its path."""
    replay = state.replay
    if replay is None:
        return 0
    time_s = state.session.view.time_s
    return round(replay.share_of("approach", time_s) * (len(replay.carry_at(time_s).approach.path) - 1))


def grasp_facts(grasp: GraspChoice) -> list[tuple[str, str]]:
    """The grasp as the paper speaks of it. Angles count from crossing the first edge at right angles, where that is known."""
    zero = float(np.mean(window_of(grasp))) if grasp.forbidden else 0.0
    ranges = ", ".join(f"{low:.0f}° to {high:.0f}°" for low, high in np.rad2deg(grasp.ranges.reshape(-1, 2) - zero) + 0.0)
    return [
        ("Grasp class", grasp.name),
        ("Approach group", grasp.group.removeprefix(f"{grasp.name}, ")),
        ("Legal angles", ranges or "none"),
        ("Chosen angle", f"{round(float(np.rad2deg(grasp.angle - zero)), 1) + 0.0:.1f}°"),
        ("Tilt", f"{np.rad2deg(grasp.tilts[0]):.0f}° at pickup, {np.rad2deg(grasp.tilts[1]):.0f}° at putdown"),
        ("Fingers", f"{html.millimetres(grasp.width, 1)} held, {html.millimetres(grasp.opening)} open"),
        ("Contact", f"{1e6 * grasp.contact_area:.0f} mm² each"),
        *([("Grip", grip_words(grasp.grip))] if grasp.grip else []),
        ("Joint limits", f"{np.rad2deg(grasp.joint_margin):.0f}° away"),
    ]


def grip_words(grip: Grip) -> str:
    """How much more than its weight the fingers would hold of the part."""
    return (
        f"{grip.force_margin:.1f} N and {grip.torque_margin:.2f} N m to spare at the worst turn, where it {grip.limit} first; "
        f"{grip.needed_force:.1f} N would just hold"
    )


def _grasp_looks(state: State) -> tuple:
    return id(state.carry), state.loads


def _plane_looks(state: State) -> tuple:
    led = led_at(state.replay, state.session.view.time_s) if state.replay is not None else None
    return id(state.carry), approach_point(state), (id(led.run), led.at) if led else None, id(state.handling), state.grasp_look.obstacles


def _part_looks(state: State) -> Sequence[object]:
    return id(state.handling), id(state.carry), looked_at(state), id(state.session.result), state.to_handle is None
