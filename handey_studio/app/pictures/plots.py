"""What was measured while a plan was carried out, over the timeline's own axis: wrist force, finger width, tracking error.

The pictures stay as they are while the time goes on; only `cursor` moves.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import RGB, css
from handey_studio.app.scene.robot import hand_off
from handey_studio.cell.protocol import TOUCH_N
from handey_studio.session import PerformedReplay
from handey_studio.task.acting.noticing import GRIP_TOLERANCE_M

ROW, WORDS, GAP, MARKS = 24, 12, 3, 14  # pixels: a plot's height, that of its words above it, what is between two, the line of contacts
WIDE = 1000.0  # units across a picture, whatever the panel's width
COLUMNS = 500  # of a curve are told apart
GUARDED = ("place", "search")  # motions that end when something is felt
LEAST_APART = 0.055  # of the width between the numbers of two contacts
LEAST_SPAN = {"N": 4.0, "mm": 1.0}  # a flat curve is not blown up into noise


@dataclass(frozen=True, eq=False)
class Curve:
    """Values (n,) in a plot's unit, their colour, and whether the line is broken."""

    values: NDArray
    colour: RGB
    dashed: bool = False


@dataclass(frozen=True, eq=False)
class Limit:
    """A level that was not to be crossed, from one time to another [s]."""

    start: float
    end: float
    value: float


@dataclass(frozen=True, eq=False)
class Plot:
    """One picture: what it shows, its unit, its curves and limits."""

    title: str
    unit: str
    curves: tuple[Curve, ...]
    limits: tuple[Limit, ...] = ()

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest value drawn."""
        values = [curve.values for curve in self.curves] + [np.array([limit.value for limit in self.limits])]
        low, high = float(min(0.0, np.concatenate(values).min())), float(np.concatenate(values).max())
        high = max(high, low + LEAST_SPAN[self.unit])
        return low - 0.06 * (high - low), high + 0.06 * (high - low)


def plots_of(replay: PerformedReplay) -> tuple[Plot, ...]:
    """What is plotted of an attempt."""
    traces = replay.traces
    force = (Curve(traces.up_N, palette.BLUE), Curve(traces.sideways_N, palette.ORANGE, True))
    return (
        Plot("wrist force, up ― and sideways ┄", "N", force, _guards(replay)),
        Plot("between the fingers", "mm", (Curve(1e3 * traces.opening_m, palette.TEAL),), _widths(replay)),
        Plot("hand off its command", "mm", (Curve(1e3 * traces.off_m, palette.INK),)),
    )


def plots_html(replay: PerformedReplay, field: str = "") -> str:
    """All plots, one below the other, with the contacts above; a click puts its time into a field (an element's id)."""
    rows = "".join(_row(plot, replay.traces.time_s, replay.duration) for plot in plots_of(replay))
    click = html.esc(html.picking_share(field, replay.duration))
    style = "position:relative;margin:2px 14px 0;cursor:pointer"
    return f'<div data-testid="plots" style="{style}" onclick="{click}">{_marks(replay)}{rows}</div>'


def cursor(replay: PerformedReplay, time_s: float) -> str:
    """The line at the time that is looked at. It stands before the plots on the page, and hangs down over them."""
    left = 100.0 * time_s / max(replay.duration, 1e-9)
    height = MARKS + 3 * (WORDS + ROW + GAP)
    line = f"position:absolute;left:{left:.3f}%;top:2px;height:{height}px;width:2px;background:{css(palette.INK)};z-index:2"
    mark = f'<div data-testid="plot-cursor" style="{line};pointer-events:none"></div>'
    return f'<div style="position:relative;height:0;margin:0 14px">{mark}</div>'


def now_words(replay: PerformedReplay, time_s: float) -> str:
    """What was measured at a time."""
    traces, moment = replay.traces, replay.at(time_s)
    up, sideways, finger = (float(np.interp(time_s, traces.time_s, c)) for c in (traces.up_N, traces.sideways_N, traces.finger_N))
    turned = np.rad2deg(np.abs(moment.q_rad - moment.q_command_rad).max())
    wrist = f"wrist {abs(up):.1f} N {'up' if up > 0 else 'down'}, {sideways:.1f} N sideways"
    fingers = f"fingers {1e3 * moment.hand_opening_m:.1f} mm, {abs(finger):.0f} N"
    return f"{wrist} · {fingers} · off by {1e3 * hand_off(replay.robot, moment):.1f} mm, {turned:.2f}°"


def _guards(replay: PerformedReplay) -> tuple[Limit, ...]:
    """A guarded motion ends when the force has changed so much since its start; the levels of the force up."""
    limits = []
    for stretch in replay.stretches:
        if stretch.what in GUARDED:
            first = float(np.interp(stretch.start + 1e-6, replay.traces.time_s, replay.traces.up_N))
            limits += [Limit(stretch.start, stretch.end, first + TOUCH_N)]
    return tuple(limits)


def _widths(replay: PerformedReplay) -> tuple[Limit, ...]:
    """How wide the fingers may be while they hold the part."""
    limits = []
    for hold in replay.holds:
        width = replay.carry_at(hold.start).grasp.width
        end = min(hold.end, replay.duration)
        limits += [Limit(hold.start, end, 1e3 * (width + off)) for off in (-GRIP_TOLERANCE_M, GRIP_TOLERANCE_M)]
    return tuple(limits)


def _row(plot: Plot, times: NDArray, duration: float) -> str:
    """One plot; its words stand above it, so that they neither hide it nor are stretched with it."""
    low, high = plot.span

    def down(value: float) -> float:
        return ROW * (high - value) / (high - low)

    lines = [_line(*_thinned(times, curve.values, duration), down, curve.colour, curve.dashed, duration) for curve in plot.curves]
    lines += [_level(limit, down(limit.value), duration) for limit in plot.limits]
    zero = f'<line x1="0" x2="{WIDE:g}" y1="{down(0.0):.1f}" y2="{down(0.0):.1f}" stroke="#cfd6de" vector-effect="non-scaling-stroke"/>'
    svg = (
        f'<svg width="100%" height="{ROW}" viewBox="0 0 {WIDE:g} {ROW}" preserveAspectRatio="none" style="display:block;background:#f5f7f9;'
        f'border-radius:3px">{zero}{"".join(lines)}</svg>'
    )
    words = f"display:flex;justify-content:space-between;font-size:10px;line-height:{WORDS}px;height:{WORDS}px;color:var(--body)"
    most = f"at most {_number(max(np.abs(curve.values).max() for curve in plot.curves))} {plot.unit}"
    return (
        f'<div style="margin-bottom:{GAP}px"><div style="{words}"><span>{html.esc(plot.title)}</span><span>{most}</span></div>{svg}</div>'
    )


def _line(times: NDArray, values: NDArray, down, colour: RGB, dashed: bool, duration: float) -> str:
    points = " ".join(f"{WIDE * t / duration:.1f},{down(v):.1f}" for t, v in zip(times, values, strict=True))
    dash = ' stroke-dasharray="4 3"' if dashed else ""
    return f'<polyline points="{points}" fill="none" stroke="{css(colour)}" stroke-width="1.5"{dash} vector-effect="non-scaling-stroke"/>'


def _level(limit: Limit, y: float, duration: float) -> str:
    a, b = (WIDE * t / duration for t in (limit.start, limit.end))
    line = f'x1="{a:.1f}" x2="{b:.1f}" y1="{y:.1f}" y2="{y:.1f}" stroke="{css(palette.VERMILLION)}"'
    return f'<line data-limit="{limit.value:.1f}" {line} stroke-dasharray="2 2" vector-effect="non-scaling-stroke"/>'


def _marks(replay: PerformedReplay) -> str:
    """Contacts where they were felt, with their force where there is room."""
    told, last = [], -1.0
    for performed in replay.performance.performed:
        for event in performed.recording.events:
            share = (performed.start_s + event.time_s) / max(replay.duration, 1e-9)
            number = f" {event.force_N:.0f} N" if share - last > LEAST_APART else ""
            last = share if number else last
            sign = "△" if event.what == "release" else "▼"
            side = f"right:{100 * (1 - share):.2f}%" if share > 0.9 else f"left:{100 * share:.2f}%"
            said = html.esc(f"{event.what} at {performed.start_s + event.time_s:.2f} s, {event.force_N:.1f} N")
            told.append(f'<span title="{said}" style="position:absolute;{side};transform:translateX(-3px)">{sign}{number}</span>')
    style = f"position:relative;height:{MARKS}px;font-size:10px;line-height:{MARKS}px;color:{palette.text(palette.TEAL)};white-space:nowrap"
    return f'<div data-testid="contacts" style="{style}">{"".join(told)}</div>'


def _thinned(times: NDArray, values: NDArray, duration: float) -> tuple[NDArray, NDArray]:
    """Of each column's samples the first, the lowest, the highest and the last: a short jerk is never lost."""
    if len(times) <= 2 * COLUMNS:
        return times, values
    column = np.minimum((times / max(duration, 1e-9) * COLUMNS).astype(int), COLUMNS - 1)
    firsts = np.flatnonzero(np.diff(column, prepend=-1))
    keep: list[int] = []
    for start, end in zip(firsts, [*firsts[1:], len(times)], strict=True):
        piece = values[start:end]
        keep += sorted({int(start), int(start + piece.argmin()), int(start + piece.argmax()), int(end) - 1})
    return times[keep], values[keep]


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 10 else f"{value:.1f}"
