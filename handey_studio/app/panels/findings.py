"""What was found: the result in numbers, the path with its certificate."""

import numpy as np
import viser

from handey_studio.app import html, palette
from handey_studio.app.cspace import slice_html
from handey_studio.app.exporting import ExportPlan, ExportReplay
from handey_studio.app.guidance import UNSEEN, unseen
from handey_studio.app.panels.running import HappenedPanel
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_click, set_to
from handey_studio.app.wording import move_words
from handey_studio.geometry.transforms import pose_difference
from handey_studio.task.carrying import TOLD_M
from handey_studio.task.plan import MovePlan, MoveResult

EXPORTS = {"URScript": "urscript", "ROS 2": "ros2", "YAML": "ros2-yaml", "CSV": "csv"}
NO_RESULT = "No MOVE was tried yet. Set the part and its destination on the left, then press Plan or MOVE."
NO_PATH = "No path yet. A plan shows here what was proved of it, and the arm's way through the configuration space."
NO_SPACE = "This plan kept no picture of its configuration space."


class ResultPanel:
    """The outcome, the certificate, what happened, the time each stage took, the plan for controllers."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._pane = gui.add_html("")
        self._happened = HappenedPanel(gui, send)
        self._timing = gui.add_html("")
        self._export = gui.add_button_group("Export", tuple(EXPORTS), visible=False, hint="Download the plan, after a dry check")
        self._replay = gui.add_button(
            "Replay as a page", icon=viser.Icon.MOVIE, color="gray", visible=False, hint="One file that any browser plays by itself"
        )
        on_click(self._replay, send, lambda event: ExportReplay(event.client_id))
        on_click(self._export, send, lambda event: ExportPlan(EXPORTS[event.target.value], event.client_id))

    def render(self, old: State | None, new: State) -> None:
        self._happened.render(old, new)
        if old is not None and old.session.result is new.session.result and old.loads == new.loads:
            return
        result = new.session.result
        self._pane.content = result_html(result) if result else html.empty(NO_RESULT, "result-empty")
        self._timing.content = timing_html(result) if result else ""
        set_to(self._export, visible=new.attempt is not None)
        set_to(self._replay, visible=new.attempt is not None)


class PathPanel:
    """The path's certificate, and the slice of the configuration space that the arm is in."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._pane = gui.add_html("")

    def render(self, old: State | None, new: State) -> None:
        replay = new.replay
        if replay is None:
            set_to(self._pane, content=html.empty(NO_PATH, "path-empty"))
        elif old is None or old.replay is not replay or old.session.view.time_s != new.session.view.time_s:
            moment = replay.at(new.session.view.time_s)
            space = replay.carry_at(moment.time_s).space
            picture = slice_html(space, moment.q_rad) if space is not None else html.empty(NO_SPACE)
            now = html.facts([("Clearance now", clearance_words(replay.clearance(moment.time_s)))], "clearance-now")
            self._pane.content = html.facts(path_facts(replay.plan), "path") + now + clearance_legend() + picture


def clearance_words(clearance: float | None) -> str:
    """How near anything comes to anything that it may not touch."""
    if clearance is None:
        return "this plan did not keep it"
    return f"over {html.millimetres(TOLD_M)}" if clearance >= TOLD_M else html.millimetres(clearance, 1)


def clearance_legend() -> str:
    """The scale of the beads along the hand's path."""
    stops = ", ".join(f"{palette.css(c)} {100 * at:.0f}%" for c, at in zip(palette.CLEARANCE, palette.CLEARANCE_AT, strict=True))
    return html.scale("Clearance along the path (mm)", stops, [f"{1e3 * TOLD_M * share:.0f}" for share in (0.0, 0.5, 1.0)])


def result_html(result: MoveResult) -> str:
    """Status, reason, poses, certificate."""
    tone = {"planned": "info", "done": "good", "failed": "bad"}[result.status]
    title = move_words(result.command)
    done = UNSEEN if unseen(result) else "Done."
    said = {"planned": "Planned, not carried out yet.", "done": done}.get(result.status, html.sentence(result.reason))
    pane = html.card(title, said, tone, "result")
    if result.plan is None:
        return pane
    facts = [*plan_facts(result.plan), *path_facts(result.plan)[:3]]
    if result.T_world_part_reached is not None:
        metres, radians = pose_difference(result.T_world_part_reached, result.plan.T_world_part_goal)
        facts.append(("Reached", f"within {1e3 * metres:.2f} mm and {np.rad2deg(radians):.2f}° of the command"))
    return pane + html.facts(facts)


def timing_html(result: MoveResult) -> str:
    """How long each stage kept the computer busy."""
    timing = [(stage, f"{seconds:.2f} s") for stage, seconds in result.timing_s.items()]
    return html.heading("Computing time") + html.facts(timing, "timing")


def plan_facts(plan: MovePlan) -> list[tuple[str, str]]:
    """A plan's steps."""
    regrasps = {0: "no regrasp", 1: "1 regrasp"}.get(plan.regrasps, f"{plan.regrasps} regrasps")
    return [("Steps", " → ".join(step.kind for step in plan.steps)), ("As planned", f"{plan.duration:.1f} s, {regrasps}")]


def path_facts(plan: MovePlan) -> list[tuple[str, str]]:
    """What was proved of the arm's path."""
    certificate = plan.certificate
    proof = "proved collision-free between all samples" if certificate.proved else f"not proved: {certificate.reason}"
    return [
        ("Path", proof),
        ("Margin", f"{html.millimetres(certificate.margin, 1)} to everything that may not touch"),
        ("Closest", f"{html.millimetres(certificate.least_clearance, 1)} between {' and '.join(certificate.bodies) or 'nothing'}"),
        ("Exact checks", f"{certificate.checks}"),
    ]
