"""Calibrate the range finder: start, the residual of each pose as a picture, the frame beside the paper's answer, Accept or Discard."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from handey_studio.app import html, palette
from handey_studio.app.actions import CancelMove
from handey_studio.app.calibrating import MISPLACED_HINT, AcceptCalibration, DiscardCalibration, Misplace, StartCalibration
from handey_studio.app.compared import is_misplaced
from handey_studio.app.outcome import Outcome
from handey_studio.app.page_style import in_a_row
from handey_studio.app.palette import css
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click, on_user, set_to
from handey_studio.sensing.frame_fit import FitOptions, FrameFit
from handey_studio.task.calibrating.calibrate import RangeCalibration
from handey_studio.task.calibrating.report import calibration_lines

HOW = "The hand holds a cube and shows it here and there; its upper face is found in each scan. The first three poses are the paper's (§6)."
WIDTH, ROW, LEFT = 270.0, 15.0, 26.0


class CalibrationPanel:
    """Top to bottom: how, start, progress, what was found, what becomes of it."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        gui.add_html(f'<div style="margin:0 14px 4px;font-size:12px;line-height:1.4;color:var(--muted)">{HOW}</div>')
        self._misplaced = gui.add_checkbox("Misplaced", False, hint=MISPLACED_HINT)
        self._poses: Any = gui.add_number("Poses", 10, min=3, max=100, step=1)
        self._start = gui.add_button("Calibrate", icon=viser.Icon.CUBE, color=palette.ARM_DARK)
        self._progress = gui.add_html("", visible=False)
        self._cancel = gui.add_button("Cancel the calibration", icon=viser.Icon.PLAYER_STOP, color=palette.VERMILLION, visible=False)
        self._accept = gui.add_button("Accept", icon=viser.Icon.CHECK, color=palette.BLUE, visible=False)
        self._discard = gui.add_button("Discard", color="gray", visible=False)
        gui.add_html(in_a_row([element_id(self._accept), element_id(self._discard)]))
        self._found = gui.add_html("")
        self._outcomes = gui.add_html("")
        on_user(self._misplaced, send, lambda event: Misplace(bool(event.target.value)))
        on_click(self._start, send, lambda _: StartCalibration(int(self._poses.value)))
        on_click(self._cancel, send, lambda _: CancelMove())
        on_click(self._accept, send, lambda _: AcceptCalibration())
        on_click(self._discard, send, lambda _: DiscardCalibration())

    def render(self, old: State | None, new: State) -> None:
        job, found = new.job, new.calibration
        running = job is not None and job.title == "Calibrating"
        set_to(self._misplaced, value=is_misplaced(new), disabled=job is not None)
        set_to(self._start, disabled=job is not None)
        set_to(self._cancel, visible=running, disabled=bool(job and job.cancelling))
        set_to(self._progress, visible=running, content=html.card(f"{100 * job.fraction:.0f} %", job.message) if job and running else "")
        if old is None or old.calibration is not found:
            self._found.content = found_html(found) if found is not None else ""
        if old is None or old.outcomes != new.outcomes:
            self._outcomes.content = outcomes_html(new.outcomes)
        set_to(self._accept, visible=found is not None and found.fit is not None, disabled=job is not None)
        set_to(self._discard, visible=found is not None)


def found_html(found: RangeCalibration) -> str:
    """The residuals, the frame in words, warnings first."""
    fit = found.fit
    if fit is None:
        return html.card("Not calibrated", found.reason, "bad", "calibration")
    warnings = list(dict.fromkeys((*fit.warnings, *(found.free.warnings if found.free else ()))))
    cards = "".join(html.card("Mind", warning, "bad", "calibration-warning") for warning in warnings)
    lines = [line.strip() for line in calibration_lines(found) if not line.startswith(("pose", "  note"))]
    rows = "".join(f"<li>{html.esc(line)}</li>" for line in lines)
    words = f'<ul data-testid="calibration" style="margin:4px 14px 6px;padding-left:16px;font-size:12px;line-height:1.45">{rows}</ul>'
    return cards + residuals_svg(fit) + words


def outcomes_html(outcomes: Sequence[Outcome]) -> str:
    """The MOVEs of this session side by side: a row each, the last one first."""
    if not outcomes:
        return ""
    head = _row(("finder", "MOVE", "tries", "noticed", "seen off", "truly off"), "color:var(--muted)")
    rows = "".join(_row(_words(one)) + _why(one) for one in reversed(outcomes))
    note = "Off its command, as the scan afterwards saw it, and truly: known only because the cell is simulated."
    style = "margin:2px 14px 6px;font-size:11px;line-height:1.35;font-variant-numeric:tabular-nums"
    table = f'<table>{head}{rows}</table><div style="color:var(--muted)">{note}</div>'
    return f'{html.heading("MOVEs before and after")}<div data-testid="outcomes" style="{style}">{table}</div>'


def _words(one: Outcome) -> tuple[str, ...]:
    where = "misplaced" if one.misplaced else "in place"
    return where, one.status, str(one.attempts), str(one.noticed), off_words(one.seen_off), off_words(one.truly_off)


def _why(one: Outcome) -> str:
    return f'<tr><td></td><td colspan="5" style="color:var(--muted)">{html.esc(one.reason)}</td></tr>' if one.status == "failed" else ""


def _row(words: Sequence[str], look: str = "") -> str:
    cells = "".join(f'<td style="padding:1px 6px 1px 0;white-space:nowrap;{look}">{html.esc(word)}</td>' for word in words)
    return f"<tr>{cells}</tr>"


def off_words(off: tuple[float, float] | None) -> str:
    """A distance and an angle."""
    return "–" if off is None else f"{1e3 * off[0]:.1f} mm {np.rad2deg(off[1]):.1f}°"


def residuals_svg(fit: FrameFit) -> str:
    """A bar a pose, as long as its residual [mm]; poses that had no say are hollow; the line is where a pose counts as an outlier."""
    sizes, limit = 1e3 * np.linalg.norm(fit.residuals_m, axis=1), 1e3 * FitOptions().outlier_m
    most = max(float(sizes.max()), 1.15 * limit)
    across = (WIDTH - LEFT - 44.0) / most
    bars = "".join(_bar(k, float(size), bool(used), across) for k, (size, used) in enumerate(zip(sizes, fit.used, strict=True)))
    height, at = ROW * len(sizes) + 14.0, LEFT + across * limit
    line = f'<line x1="{at:.1f}" x2="{at:.1f}" y1="0" y2="{height - 13:.0f}" stroke="{css(palette.VERMILLION)}" stroke-dasharray="3 2"/>'
    told = f'<text x="{at:.1f}" y="{height - 3:.0f}" font-size="9" text-anchor="middle" fill="var(--body)">outlier from {limit:g} mm</text>'
    title = '<div style="font-size:12px;margin-bottom:2px">Residual of each pose (mm)</div>'
    svg = f'<svg viewBox="0 0 {WIDTH:g} {height:g}" width="100%" style="background:var(--row);border-radius:4px">{bars}{line}{told}</svg>'
    return f'<div data-testid="residuals" style="margin:6px 14px">{title}{svg}</div>'


def _bar(number: int, size: float, used: bool, across: float) -> str:
    y, colour = ROW * number, css(palette.TEAL if used else palette.VERMILLION)
    look = f'fill="{colour}"' if used else f'fill="none" stroke="{colour}"'
    end = LEFT + across * size
    return (
        f'<text x="{LEFT - 6:g}" y="{y + 11:g}" font-size="10" text-anchor="end" fill="var(--body)">{number + 1}</text>'
        f'<rect x="{LEFT:g}" y="{y + 3:g}" width="{max(end - LEFT, 1.0):.1f}" height="{ROW - 5:g}" {look}/>'
        f'<text x="{end + 4:.1f}" y="{y + 11:g}" font-size="10" fill="var(--ink)">{size:.2f}{"" if used else " left out"}</text>'
    )
