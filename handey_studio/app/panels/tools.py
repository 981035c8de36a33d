"""The modeller's tools as a row of chips; the active one is filled."""

from handey_studio.app import html, palette
from handey_studio.app.modelling.look import POINTS, SELECT
from handey_studio.app.modelling.tool_clicks import BOX, CUT, EXTRUDE, MEASURE, MIRROR, SKETCH
from handey_studio.app.palette import css

TOOLS = (SELECT, BOX, SKETCH, EXTRUDE, CUT, MIRROR, MEASURE, POINTS)
LABELS = {
    SELECT: ("↖ Select", "Click a face, an edge or a corner: move it, or type its size"),
    BOX: ("▣ Box", "Three clicks on its upper face"),
    SKETCH: ("✎ Sketch", "An outline on a face or on the support, by clicks"),
    EXTRUDE: ("⇧ Extrude", "Draw the last sketch out: join it, or cut it away"),
    CUT: ("◪ Cut", "By the plane of a face, or through three points"),
    MIRROR: ("◫ Mirror", "In the plane of a face, or through three points"),
    MEASURE: ("↔ Measure", "Between two clicks"),
    POINTS: ("⊹ Align points", "Pairs of clicks, on the aligned scans and on the new one"),
}


def toolbar(active: str, usable: tuple[str, ...], field: str) -> str:
    """The tools; a click puts the tool's number into a number field (an element's id)."""
    chips = "".join(_chip(number, tool, tool == active, tool in usable, field) for number, tool in enumerate(TOOLS))
    return (
        f'<div role="toolbar" aria-label="Tools" style="display:grid;grid-template-columns:repeat(3,1fr);gap:4px;margin:4px 12px">'
        f"{chips}</div>"
    )


def _chip(number: int, tool: str, active: bool, usable: bool, field: str) -> str:
    label, hint = LABELS[tool]
    blue = css(palette.BLUE)
    look = (
        f"background:{blue};color:#fff;border-color:{blue}" if active else "background:var(--row);color:var(--ink);border-color:var(--rim)"
    )
    click = f'onclick="{html.esc(html.picking(field, str(number)))}"' if usable else "disabled"
    return (
        f'<button type="button" data-testid="tool-{tool}" aria-pressed="{str(active).lower()}" title="{html.esc(hint)}" {click} '
        f'style="font:inherit;font-size:12px;padding:4px 2px;border:1px solid;border-radius:5px;{look};'
        f'cursor:{"pointer" if usable else "default"};opacity:{1 if usable else 0.4}">{html.esc(label)}</button>'
    )
