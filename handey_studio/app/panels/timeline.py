"""The timeline: one time drives everything that is shown."""

from typing import Any

import viser

from handey_studio.app import html
from handey_studio.app.looking_at import ToggleLayer
from handey_studio.app.palette import STEP_COLOURS, css, words_on
from handey_studio.app.pictures.plots import cursor, now_words, plots_html
from handey_studio.app.playback import Seek, SeekStep, SetPlayback, TogglePlay
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click, on_user, set_to
from handey_studio.session import PerformedReplay, Stretch

FIRST, BACK, PLAY, ON, LAST, PLOTS = "|◀", "◀ Step", "Play / Pause", "Step ▶", "▶|", "Plots"
SPEEDS = {"½×": 0.5, "1×": 1.0, "3×": 3.0}
PRESSED = {
    FIRST: SeekStep(-99),
    BACK: SeekStep(-1),
    PLAY: TogglePlay(),
    ON: SeekStep(1),
    LAST: SeekStep(99),
    **{label: SetPlayback(speed=speed) for label, speed in SPEEDS.items()},
    PLOTS: ToggleLayer("plots"),
}
BUTTONS = tuple(label for label in PRESSED if label != PLOTS)
WIDTH = 574  # what a window 1280 pixels wide leaves between the other panels
LETTER = 6.5  # pixels
OTHER = "free"  # whose colour motions have that no plan names: what leads back after something went wrong


class TimelinePanel:
    """A strip of what was done or is planned, a slider in seconds, the playing, and if asked the plots of what was measured."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._panel = panel = gui.add_panel()
        with panel.add_tab("Timeline", viser.Icon.MOVIE):
            self._strip = gui.add_html("")
            self._seek: Any = gui.add_number("Time picked (s)", 0.0, step=0.001)  # set by a click into a picture, which hides it
            self._cursor = gui.add_html("")
            self._plots = gui.add_html("")
            self._slider = gui.add_slider("Time (s)", min=0.0, max=1.0, step=0.01, initial_value=0.0, visible=False)
            self._buttons = gui.add_button_group("Play", BUTTONS, visible=False)
        panel.float(x=14, y=-14, width=WIDTH)
        on_user(self._slider, send, lambda event: Seek(float(event.target.value)))
        on_user(self._seek, send, lambda event: Seek(float(event.target.value)))
        on_click(self._buttons, send, lambda event: PRESSED[event.target.value])

    def render(self, old: State | None, new: State) -> None:
        if old is not None and old.modelling != new.modelling:
            self._panel.minimize() if new.modelling else self._panel.expand()
        if old is not None and _looks(old) == _looks(new):
            return
        replay, time_s = new.replay, new.session.view.time_s
        set_to(self._slider, visible=replay is not None)
        set_to(self._buttons, visible=replay is not None)
        if replay is not None:
            set_to(self._slider, max=round(replay.duration, 2))
            set_to(self._buttons, options=(*BUTTONS, PLOTS) if isinstance(replay, PerformedReplay) else BUTTONS)
        set_to(self._slider, value=round(min(time_s, self._slider.max), 2))
        field = element_id(self._seek)
        self._strip.content = html.unseen([field]) + (strip(new, field) if replay else html.empty(NO_PLAN, "timeline-empty"))
        self._plot(old, new)

    def _plot(self, old: State | None, new: State) -> None:
        """The plots are sent once for each attempt; then only the line of the time moves over them."""
        replay = new.replay
        shown = replay if isinstance(replay, PerformedReplay) and "plots" not in new.session.view.hidden_layers else None
        if shown is None:
            set_to(self._plots, content="")
            set_to(self._cursor, content="")
            return
        before = old is not None and old.replay is replay and self._plots.content
        if not before:
            self._plots.content = plots_html(shown, element_id(self._seek))
        self._cursor.content = cursor(shown, new.session.view.time_s)


NO_PLAN = "No plan yet. Press Plan or MOVE; then this plays it, step by step."


def strip(state: State, field: str = "") -> str:
    """The stretches side by side, as long as they take, with the time as a line across; a click puts its time into a field."""
    replay, time_s = state.replay, state.session.view.time_s
    if replay is None:
        return ""
    total, now = max(replay.duration, 1e-9), replay.stretch_at(time_s)
    before = (None, *replay.stretches)
    boxes = "".join(_box(s, s is now, total, b is None or b.step != s.step) for s, b in zip(replay.stretches, before, strict=False))
    line = f"position:absolute;left:{100 * time_s / total:.3f}%;top:-3px;bottom:-3px;width:2px;background:var(--ink)"
    at = f'<div style="{line};pointer-events:none"></div>'
    bar = "position:relative;display:flex;height:22px;line-height:22px;font-size:11px;cursor:pointer"
    line = "display:flex;justify-content:space-between;font-size:12px;margin-top:5px;font-variant-numeric:tabular-nums;white-space:nowrap"
    click = html.esc(html.picking_share(field, total))
    said = f'<span data-testid="step-name">{html.esc(now_playing(state))}</span><span>{state.speed:g}×</span>'
    performed = isinstance(replay, PerformedReplay)
    measured = (
        f'<div data-testid="measured" style="{line};color:var(--body)">{html.esc(now_words(replay, time_s))}</div>' if performed else ""
    )
    return (
        f'<div data-testid="timeline" style="margin:6px 14px 2px"><div style="{bar}" onclick="{click}">{boxes}{at}</div>'
        f'<div style="{line}">{said}</div>{measured}</div>'
    )


def now_playing(state: State) -> str:
    """What happens at the time that is looked at, in words."""
    replay, moment = state.replay, state.moment
    if replay is None or moment is None:
        return ""
    stretch = replay.stretch_at(moment.time_s)
    count = len(state.attempts)
    attempt = f"attempt {state.attempt_number + 1} of {count} · " if count > 1 else ""
    step = stretch.what if stretch.back else f"step {stretch.step + 1} of {len(replay.plan.steps)}: {stretch.what}"
    held = f", holding {moment.held}" if moment.held else ", nobody knows where the part is" if moment.lost else ""
    return f"{'▶' if state.playing else '❚❚'} {moment.time_s:.2f} of {replay.duration:.2f} s · {attempt}{step}{held}"


def _box(stretch: Stretch, now: bool, total: float, first: bool) -> str:
    """A stretch with its name, where that is too long with the step's number if it is its `first` stretch, as far as either fits."""
    share = 100.0 * (stretch.end - stretch.start) / total
    words = (stretch.what, "" if stretch.back or not first else str(stretch.step + 1), "")
    name = next(word for word in words if share > 100 * LETTER * len(word) / (WIDTH - 40) or not word)
    colour = STEP_COLOURS.get(stretch.what.split(",")[0], STEP_COLOURS[OTHER])
    look = f"background:{css(colour)};color:{words_on(colour)};font-weight:650" if now else f"background:{css(colour)}55"
    return (
        f'<div title="{html.esc(stretch.what)} {stretch.end - stretch.start:.1f} s" style="width:{share:.3f}%;{look};'
        f'overflow:hidden;white-space:nowrap;text-align:center;border-right:1px solid var(--mantine-color-body)">'
        f"{html.esc(name)}</div>"
    )


def _looks(state: State) -> tuple:
    view = state.session.view
    return state.loads, id(state.replay), view.time_s, state.playing, state.speed, "plots" in view.hidden_layers
