"""Where to look from, what to show, and what the colours mean."""

import viser

from handey_studio.app import html, palette
from handey_studio.app.looking_at import SetDark, ShowLayer
from handey_studio.app.palette import ELEVATION, ELEVATION_AT
from handey_studio.app.ruler import ToggleRuler, ruler_words
from handey_studio.app.scene.depth import elevation_span
from handey_studio.app.state import State
from handey_studio.app.viewpoints import LookFrom
from handey_studio.app.wire import Send, on_click, on_user, set_to
from handey_studio.session import LAYERS

VIEWS = (("View", ("Workcell", "Pile", "Top")), ("Close-up", ("Grasp", "Hand", "C-space")))


class LookingPanel:
    """View buttons, layers, legend."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        for label, views in VIEWS:
            on_click(gui.add_button_group(label, views), send, lambda event: LookFrom(event.target.value, event.client_id))
        self._ruler = gui.add_button("Ruler", icon=viser.Icon.RULER_MEASURE, color="gray", hint="How far are two spots apart? (R)")
        on_click(self._ruler, send, lambda _: ToggleRuler())
        self._measured = gui.add_html("", visible=False)
        self._legend = gui.add_html("")
        self._dark = gui.add_checkbox("Dark page", False, hint="For everyone who looks at this workbench")
        on_user(self._dark, send, lambda event: SetDark(bool(event.target.value)))
        self._layers = {}
        with gui.add_folder("Show", expand_by_default=True):
            for layer in LAYERS:
                box = gui.add_checkbox(layer[0].upper() + layer[1:], True)
                on_user(box, send, lambda event, layer=layer: ShowLayer(layer, bool(event.target.value)))
                self._layers[layer] = box

    def render(self, old: State | None, new: State) -> None:
        set_to(self._dark, value=new.dark)
        if old is None or old.ruler is not new.ruler:
            set_to(self._ruler, label="Ruler" if new.ruler is None else "Put the ruler away")
            told = html.card("Ruler", ruler_words(new.ruler), "info", "ruler") if new.ruler is not None else ""
            set_to(self._measured, content=told, visible=bool(told))
        hidden = new.session.view.hidden_layers
        if old is None or old.session.view.hidden_layers != hidden:
            for layer, box in self._layers.items():
                set_to(box, value=layer not in hidden)
        if old is None or old.session.scan is not new.session.scan:
            self._legend.content = legend(new)


def legend(state: State) -> str:
    """The elevation scale, when there is a scan, and the meaning of colours."""
    scan = state.session.scan
    stops = ", ".join(f"{palette.css(colour)} {100 * at:.0f}%" for colour, at in zip(ELEVATION, ELEVATION_AT, strict=True))
    bar = ""
    if scan is not None:
        span = 1e3 * elevation_span(scan)
        ticks = "".join(f"<span>{span * share:.0f}</span>" for share in (0.0, 0.5, 1.0))
        bar = (
            f'<div style="margin-bottom:8px">Elevation (mm)<div style="height:10px;border-radius:3px;margin-top:3px;'
            f'background:linear-gradient(90deg,{stops})"></div><div style="display:flex;justify-content:space-between">{ticks}</div></div>'
        )
    chips = (
        (palette.ORANGE, "located part"),
        (palette.BLUE, "destination"),
        (palette.TEAL, "grasp"),
        (palette.SKY, "hypothesis"),
        (palette.VERMILLION, "collision"),
    )
    row = "".join(html.swatch(colour, label) for colour, label in chips)
    return f'<div data-testid="legend" style="margin:4px 14px;font-size:12px;line-height:1.7">{bar}{row}</div>'
