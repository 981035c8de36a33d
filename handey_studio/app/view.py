"""Everything on screen, made once; `render` then draws the difference between two states."""

import logging
from typing import Any, Protocol

import viser

from handey_studio.app import palette
from handey_studio.app.looking_back import looking_back
from handey_studio.app.modelling.aside import aside
from handey_studio.app.page_style import PAGE
from handey_studio.app.panels.cell import CellPanel
from handey_studio.app.panels.edges import EdgesPanel
from handey_studio.app.panels.findings import PathPanel, ResultPanel
from handey_studio.app.panels.grasp import GraspPanel
from handey_studio.app.panels.ledger import LedgerPanel
from handey_studio.app.panels.looking import LookingPanel
from handey_studio.app.panels.model import ModelPanel
from handey_studio.app.panels.move import MovePanel
from handey_studio.app.panels.part import PartPanel
from handey_studio.app.panels.sensing import SensingPanel
from handey_studio.app.panels.session import SessionPanel
from handey_studio.app.panels.timeline import TimelinePanel
from handey_studio.app.scene.cspace import CSpaceScene
from handey_studio.app.scene.depth import DepthScene
from handey_studio.app.scene.destination import DestinationScene
from handey_studio.app.scene.failure import FailureScene
from handey_studio.app.scene.findings import PlanScene
from handey_studio.app.scene.grasp import GraspScene, StandingScene
from handey_studio.app.scene.hypothesis import HypothesisScene
from handey_studio.app.scene.modelling.clicks import ClickScenes
from handey_studio.app.scene.modelling.gizmo import GizmoScene
from handey_studio.app.scene.modelling.scans import ScanScene
from handey_studio.app.scene.modelling.solid import SolidScene
from handey_studio.app.scene.pair import PairScene
from handey_studio.app.scene.parts import PartsScene
from handey_studio.app.scene.pile import PileScene
from handey_studio.app.scene.robot import PlannedArmScene, RobotScene
from handey_studio.app.scene.ruler import RulerScene
from handey_studio.app.scene.sensing import SensingScene
from handey_studio.app.scene.workcell import WorkcellScene
from handey_studio.app.scene.wrist_box import WristBoxScene
from handey_studio.app.shortcuts import add_shortcuts
from handey_studio.app.state import State
from handey_studio.app.wire import Send

log = logging.getLogger(__name__)

LEFT_WIDTH, RIGHT_WIDTH = 318, 358


class Pane(Protocol):
    """A piece of the screen."""

    def render(self, old: State | None, new: State) -> None: ...


class View:
    """All panes."""

    def __init__(self, server: viser.ViserServer, send: Send) -> None:
        self._server = server
        scenes: list[Pane] = [WorkcellScene(server), RobotScene(server), PlannedArmScene(server)]
        scenes += [DepthScene(server), PartsScene(server, send)]
        scenes += [PileScene(server), DestinationScene(server, send), SensingScene(server, send), HypothesisScene(server)]
        scenes += [PairScene(server), PlanScene(server), GraspScene(server), StandingScene(server)]
        scenes += [CSpaceScene(server), WristBoxScene(server), FailureScene(server), RulerScene(server)]
        server.gui.add_html(PAGE)
        session = SessionPanel(server, send)
        self._scenes: list[Pane] = scenes
        models: list[Pane] = [ScanScene(server), SolidScene(server), ClickScenes(server, send), GizmoScene(server, send)]
        self._panes: list[Pane] = [*models, session, *_left(server.gui, send), *_right(server.gui, send), TimelinePanel(server.gui, send)]
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(RIGHT_WIDTH)
        add_shortcuts(server.gui, send, session)

    def render(self, old: State | None, new: State) -> tuple[str, ...]:
        """Draw what differs. A pane that breaks down is left as it is, logged, and its name returned: the others are drawn all the same."""
        broken = []
        with self._server.atomic():
            if old is None or old.dark != new.dark:
                self._server.gui.configure_theme(dark_mode=new.dark, show_logo=False, show_share_button=False, brand_color=palette.BLUE)
            of_move = _of_move(old, new)
            for pane, states in [*((pane, of_move) for pane in self._scenes), *((pane, (old, new)) for pane in self._panes)]:
                try:
                    pane.render(*states)
                except Exception:
                    log.exception("%s could not be drawn", type(pane).__name__)
                    broken.append(type(pane).__name__)
        return tuple(broken)

    def draw_scene(self, old: State, new: State) -> None:
        """Draw what differs in the scene of the MOVE alone."""
        for pane in self._scenes:
            pane.render(*_of_move(old, new))


def _of_move(old: State | None, new: State) -> tuple[State | None, State]:
    """What the scene of the MOVE shows of two states."""
    return None if old is None else aside(looking_back(old)), aside(looking_back(new))


def _left(gui: viser.GuiApi, send: Send) -> list[Any]:
    panel = gui.add_panel()
    with panel.add_tab("Move"):
        move = MovePanel(gui, send)
    with panel.add_tab("Model"):
        model = ModelPanel(gui, send)
    with panel.add_tab("View"):
        looking = LookingPanel(gui, send)
    with panel.add_tab("Edges"):
        edges = EdgesPanel(gui, send)
    with panel.add_tab("Cell"):
        cell = CellPanel(gui, send)
    panel.dock_left()
    panel.set_width(LEFT_WIDTH)
    return [model, move, looking, edges, cell]


def _right(gui: viser.GuiApi, send: Send) -> list[Any]:
    tabs = gui.add_tab_group()
    with tabs.add_tab("Result"):
        result = ResultPanel(gui, send)
    with tabs.add_tab("Part"):
        part = PartPanel(gui, send)
    with tabs.add_tab("Located"):
        located = SensingPanel(gui, send)
    with tabs.add_tab("Grasp"):
        grasp = GraspPanel(gui, send)
    with tabs.add_tab("Path"):
        path = PathPanel(gui)
    with tabs.add_tab("Ledger"):
        ledger = LedgerPanel(gui, send)
    return [result, part, located, grasp, path, ledger]
