"""What speaks for and against the hypothesis that is looked at, in numbers, with the legends of what the scene shows of it."""

from collections.abc import Sequence

from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import css
from handey_studio.app.panels.rows import percent, reason_of
from handey_studio.app.scene.hypothesis import STATE_COLOURS
from handey_studio.app.scene.pair import DATA, MODEL, parameters
from handey_studio.app.state import State
from handey_studio.localization.explain import STATE_NAMES, Explanation

CHOOSE = "Click a hypothesis above, or press N: you see the edges that it predicts, the pair that it came from, how far readings lie off."
WAIT = "Looking at the depth map once more …"
UNKNOWN = "The session has no model of this part, so nothing can be said about its edges."
SURFACE = (("agrees", palette.FOUND), ("seen through", palette.MISSING), ("hidden", palette.HIDDEN), ("no reading", palette.PALE))


def explained_html(state: State) -> str:
    """The verdict first, then edges, surface, residuals and Figure 3."""
    scene, hypothesis = state.session.scene, state.hypothesis
    if scene is None or hypothesis is None:
        return html.empty(CHOOSE, "hypothesis-none")
    tone = "bad" if hypothesis.reason else "good"
    title = f"Hypothesis {state.session.view.hypothesis + 1}: {hypothesis.part}, {percent(hypothesis.score)} probable"
    head = html.card(title, ("Fell: " if hypothesis.reason else "") + reason_of(scene, hypothesis), tone, "hypothesis")
    said = state.explanation
    if said is None:
        known = state.session.part(hypothesis.part) is not None
        return head + html.empty(WAIT if known else UNKNOWN, "explanation-wait")
    inner = _edges(said) + _surface(said) + _residuals(said) + _pair(said, hypothesis.data)
    return f'{head}<div data-testid="explanation" style="margin:2px 14px;font-size:12px;line-height:1.5">{inner}</div>'


def _edges(said: Explanation) -> str:
    lengths = said.lengths_m
    words = [f"{name} {html.millimetres(lengths[k])} ({said.edges[k]})" for k, name in enumerate(STATE_NAMES)]
    note = "Length of predicted edge, and how many edges."
    if said.ragged_m > 0.0:
        note += f" {html.millimetres(said.ragged_m)} found only as the surface's end: half."
    return _head("Predicted edges") + _stacked(lengths, STATE_COLOURS, words) + _note(note)


def _surface(said: Explanation) -> str:
    shares = said.surface_shares
    words = [f"{name} {100 * share:.0f} %" for (name, _), share in zip(SURFACE, shares, strict=True)]
    return _head("Faces that look at the sensor") + _stacked(shares, [colour for _, colour in SURFACE], words)


def _residuals(said: Explanation) -> str:
    if not len(said.distance):
        return _head("Residuals") + _note("No reading lies where this pose would show: it is hidden, or was not scanned.")
    limit = 1e3 * said.limit_m
    stops = ", ".join(f"{css(colour)} {50 * (1 + at):.0f}%" for colour, at in zip(palette.RESIDUAL, palette.RESIDUAL_AT, strict=True))
    ticks = "".join(f"<span>{word}</span>" for word in (f"−{limit:.1f} mm, behind", "0", f"in front, +{limit:.1f} mm"))
    rms = "none is within the limit" if said.rms_m is None else f"{1e3 * said.rms_m:.2f} mm rms of those within the limit"
    return (
        _head("Residuals of readings to the model")
        + f'<div style="height:9px;border-radius:3px;border:1px solid var(--line);background:linear-gradient(90deg,{stops})"></div>'
        + f'<div style="display:flex;justify-content:space-between;color:var(--muted)">{ticks}</div>'
        + _note(f"{len(said.distance)} readings; {rms}.")
    )


def _pair(said: Explanation, numbers: Sequence[int]) -> str:
    """Figure 3 as a table: data beside model."""
    rows = parameters(said)
    if not rows:
        return ""
    cell = "padding:1px 14px 1px 0;font-variant-numeric:tabular-nums"
    heads = (html.swatch(DATA, f"data {' and '.join(map(str, numbers))}"), html.swatch(MODEL, "model"))
    lines = "".join(
        f'<tr><td style="{cell};color:var(--muted)">{html.esc(name)}</td><td style="{cell}">{html.esc(data)}</td>'
        f'<td style="{cell}">{html.esc(model or "not kept")}</td></tr>'
        for name, data, model in rows
    )
    note = _note("Parallel edges: the perpendicular may stand anywhere along them.") if len(rows) == 2 else ""
    top = "".join(f'<td style="{cell}">{head}</td>' for head in heads)
    return _head("The pair of edges that it came from") + f'<table data-testid="pair"><tr><td></td>{top}</tr>{lines}</table>{note}'


def _stacked(values: NDArray, colours: Sequence[palette.RGB], words: Sequence[str]) -> str:
    """One bar of several colours, and what they mean."""
    total = max(float(sum(values)), 1e-12)
    bar = "".join(f'<span style="width:{100 * v / total:.2f}%;background:{css(c)}"></span>' for v, c in zip(values, colours, strict=True))
    chips = "".join(html.swatch(colour, word) for colour, word in zip(colours, words, strict=True))
    look = "display:flex;height:9px;border-radius:3px;overflow:hidden;background:var(--track);margin:1px 0 2px"
    return f'<div style="{look}">{bar}</div>{chips}'


def _head(text: str) -> str:
    return f'<div style="font-weight:650;margin-top:7px">{html.esc(text)}</div>'


def _note(text: str) -> str:
    return f'<div style="color:var(--muted)">{html.esc(text)}</div>'
