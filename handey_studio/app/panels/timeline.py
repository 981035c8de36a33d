"""The timeline: one time drives everything that is shown."""

from typing import Any

import viser

from handey_studio.app import html
from handey_studio.app.palette import STEP_COLOURS, css
from handey_studio.app.playback import Seek, SeekStep, SetPlayback, TogglePlay
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_click, on_user, set_to
from handey_studio.session import Replay

FIRST, BACK, PLAY, ON, LAST = "|◀", "◀ Step", "Play / Pause", "Step ▶", "▶|"
SPEEDS = {"½×": 0.5, "1×": 1.0, "3×": 3.0}
WIDTH = 640


class TimelinePanel:
    """A strip of the plan's steps, a slider in seconds, and the playing."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        panel = gui.add_panel()
        with panel.add_tab("Timeline", viser.Icon.MOVIE):
            self._strip = gui.add_html("")
            self._slider = gui.add_slider("Time (s)", min=0.0, max=1.0, step=0.01, initial_value=0.0, visible=False)
            self._buttons = gui.add_button_group("Play", (FIRST, BACK, PLAY, ON, LAST, *SPEEDS), visible=False)
        panel.float(x=14, y=-14, width=WIDTH)
        on_user(self._slider, send, lambda event: Seek(float(event.target.value)))
        on_click(self._buttons, send, _pressed)

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        replay = new.replay
        time_s = new.session.view.time_s
        set_to(self._slider, visible=replay is not None)
        set_to(self._buttons, visible=replay is not None)
        if replay is not None:
            set_to(self._slider, max=round(replay.duration, 2))
        set_to(self._slider, value=round(min(time_s, self._slider.max), 2))
        self._strip.content = strip(replay, time_s, new.playing, new.speed) if replay else html.empty(NO_PLAN, "timeline-empty")


NO_PLAN = "No plan yet. Press Plan or MOVE; then this plays it, step by step."


def strip(replay: Replay, time_s: float, playing: bool, speed: float) -> str:
    """The steps side by side, as long as they take, with the time as a line across."""
    total = max(replay.duration, 1e-9)
    now = replay.step_at(time_s)
    boxes = []
    for number, (step, start, end) in enumerate(zip(replay.plan.steps, replay.starts, replay.starts[1:], strict=False)):
        share = 100.0 * (end - start) / total
        name = step.kind if share > 100 * 6.5 * len(step.kind) / (WIDTH - 40) else ""
        boxes.append(
            f'<div title="{html.esc(step.kind)} {end - start:.1f} s" style="width:{share:.3f}%;background:{css(STEP_COLOURS[step.kind])};'
            f'opacity:{1.0 if number == now else 0.55};overflow:hidden;white-space:nowrap;text-align:center;border-right:1px solid #fff">'
            f"{html.esc(name)}</div>"
        )
    cursor = f'<div style="position:absolute;left:{100 * time_s / total:.3f}%;top:-3px;bottom:-3px;width:2px;background:#202935"></div>'
    step = replay.plan.steps[now]
    held = f", holding {step.held}" if step.held else ""
    words = f"{'▶' if playing else '❚❚'} {time_s:.2f} of {total:.2f} s · step {now + 1} of {len(replay.plan.steps)}: {step.kind}{held}"
    bar = "position:relative;display:flex;height:22px;line-height:22px;color:#fff;font-size:11px"
    line = "display:flex;justify-content:space-between;font-size:12px;margin-top:5px;font-variant-numeric:tabular-nums"
    return (
        f'<div data-testid="timeline" style="margin:6px 14px 2px"><div style="{bar}">{"".join(boxes)}{cursor}</div>'
        f'<div style="{line}"><span data-testid="step-name">{html.esc(words)}</span><span>{speed:g}×</span></div></div>'
    )


def _pressed(event: Any) -> Any:
    value = event.target.value
    if value in SPEEDS:
        return SetPlayback(speed=SPEEDS[value])
    return {FIRST: SeekStep(-99), BACK: SeekStep(-1), ON: SeekStep(1), LAST: SeekStep(99)}.get(value, TogglePlay())


def _looks(state: State) -> tuple:
    return state.loads, state.session.result, state.session.view.time_s, state.playing, state.speed
