"""The list of hypotheses: a row each with its rank, probability and verdict, to be clicked."""

from collections.abc import Sequence

from handey_studio.app import html, palette
from handey_studio.app.palette import css
from handey_studio.base import describe
from handey_studio.localization import Hypothesis, Rival
from handey_studio.session.looking import ACCEPTED, entry_of
from handey_studio.task.sense import Scene

NONE_LEFT = "No hypothesis of this part has this verdict; choose another above."


def hypothesis_rows(scene: Scene, page: Sequence[int], listed: Sequence[int], chosen: int, buttons: Sequence[str]) -> str:
    """The hypotheses of a page; a click on a row presses the button (an element's id) of its place."""
    if not scene.located.hypotheses:
        return html.hidden(buttons)
    if not listed:
        return html.hidden(buttons) + html.empty(NONE_LEFT, "hypotheses-none")
    rows = "".join(
        _row(scene, number, number == chosen, button) for number, button in zip(page, [*buttons, *[""] * len(page)], strict=False)
    )
    first = listed.index(page[0]) + 1
    head = f"{first} to {first + len(page) - 1} of {len(listed)}, best first; click one"
    return (
        f'{html.hidden(buttons)}<div data-testid="hypotheses" style="margin:2px 12px 6px;font-size:12px;line-height:1.3">'
        f'<div style="color:var(--muted);margin:0 2px 3px">{head}</div>{rows}</div>'
    )


def _row(scene: Scene, number: int, chosen: bool, button: str) -> str:
    hypothesis = scene.located.hypotheses[number]
    colour, sign = (palette.VERMILLION, "✕") if hypothesis.reason else (palette.TEAL, "●")
    look = html.row_look(chosen)
    click = f' role="button" tabindex="0" onclick="{html.esc(html.pressing(button))}"' if button else ""
    clipped = "overflow:hidden;text-overflow:ellipsis;white-space:nowrap"
    said = html.esc(reason_of(scene, hypothesis))
    return (
        f'<div data-testid="hypothesis-{number}"{click} aria-pressed="{str(chosen).lower()}" '
        f'style="cursor:pointer;{look};padding:3px 8px;margin-bottom:2px;border-radius:3px">'
        f'<div style="display:flex;align-items:center;gap:6px"><span style="color:{palette.text(colour)};width:12px">{sign}</span>'
        f'<span style="color:var(--faint);width:16px">{number + 1}</span>'
        f'<b style="font-weight:600;flex:1;{clipped}">{html.esc(hypothesis.part)}</b>{_bar(hypothesis, colour)}'
        f'<span style="width:40px;text-align:right;font-variant-numeric:tabular-nums">{percent(hypothesis.score)}</span></div>'
        f'<div style="color:var(--muted);padding-left:18px;font-size:11.5px">{said}</div></div>'
    )


def _bar(hypothesis: Hypothesis, colour: palette.RGB) -> str:
    width = 100.0 * min(max(hypothesis.score, 0.0), 1.0)
    return (
        '<span style="width:64px;height:7px;background:var(--track);border-radius:3px;display:inline-block">'
        f'<span style="display:block;width:{width:.0f}%;height:7px;border-radius:3px;background:{css(colour)}"></span></span>'
    )


def percent(share: float) -> str:
    """A probability as people read it, without claiming certainty."""
    return "< 1 %" if share < 0.01 else "> 99 %" if share > 0.99 else f"{100 * share:.0f} %"


def could_also_be(part: str, rivals: Sequence[Rival]) -> str:
    """What else the readings of an accepted part could be, with the probabilities; empty if nothing."""
    words = [f"{'the same, placed otherwise' if rival.part == part else rival.part} ({percent(rival.probability)})" for rival in rivals]
    return f"could also be {', '.join(words)}" if words else ""


def reason_of(scene: Scene, hypothesis: Hypothesis) -> str:
    """Accepted, with what else it could be, or the reason with the number and the limit from the ledger."""
    if hypothesis.reason is None:
        return ", ".join(filter(None, (ACCEPTED, could_also_be(hypothesis.part, hypothesis.rivals))))
    entry = entry_of(scene, hypothesis)
    return describe(entry) if entry is not None and entry.reason == hypothesis.reason else hypothesis.reason
