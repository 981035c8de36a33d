"""The Part tab as HTML: the model in numbers, what is wrong with it, its history, and the library's thumbnails."""

from collections.abc import Sequence

import numpy as np

from handey_studio.app import html, palette
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.parts import known_part
from handey_studio.app.palette import RESIDUAL, RESIDUAL_AT, css
from handey_studio.app.pictures.classes import OPEN, class_svg, class_view
from handey_studio.app.pictures.thumbnail import part_thumbnail
from handey_studio.app.scene.modelling.scans import distance_limit
from handey_studio.app.state import State
from handey_studio.base import describe, measured
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.doubts import DOUBTS
from handey_studio.modeling.replay import Step
from handey_studio.modeling.truth_values import Check, Truth
from handey_studio.session.graspable import Graspable
from handey_studio.session.model_look import assumed_faces
from handey_studio.world import Part

TOLD_THROUGH = 0.005
MOST_GRASPS = 6
NO_MODEL = (
    "No model yet. Model, on the left, makes one of a scan or of a mesh file. "
    "Parts of the library are below: edit one, or find it in the cell."
)
NO_SOLID = "No solid yet. Take the model that is suggested, or draw one: this then shows how true it is, and makes a part of it."
CARD = "cursor:pointer;border:1px solid;border-radius:6px;padding:4px"
CLIPPED = "overflow:hidden;text-overflow:ellipsis;white-space:nowrap"


def numbers_html(state: State) -> str:
    """Size, volume, mass, centre of mass, how well it agrees with the scans, what the hand can grasp of it."""
    shown, judged, found = derived.built(state), derived.truth(state), derived.grasps(state)
    if shown is None or shown.solid is None:
        return ""
    rows = solid_facts(shown.solid, state.model.material.density)
    assumed = len(assumed_faces(shown.sources))
    rows.append(("Faces", f"{len(shown.solid.faces)}, {assumed} of them assumed" if assumed else f"{len(shown.solid.faces)}, none assumed"))
    rows += truth_facts(judged)
    if found is not None:
        rows.append(("Grasps", _grasp_words(found)))
    return html.facts(rows, "part-numbers")


def _grasp_words(found: Graspable) -> str:
    if found.classes:
        classes, groups = len(found.classes), found.group_count
        return f"{classes} class{'es'[: 2 * (classes != 1)]}, {groups} approach group{'s'[: groups != 1]}"
    miss = found.nearest_miss
    return f"nothing: {describe(miss)}" if miss is not None else "nothing: no two features lie opposite one another"


def about_html(state: State) -> str:
    """What the pane says while it shows no solid: what became of the model, and what to do."""
    draft = state.session.draft
    if draft is None:
        return html.empty(NO_MODEL, "part-empty")
    if state.modelling:
        return html.empty(NO_SOLID, "part-empty")
    words = f'Its part "{draft.name}" is in the workcell; Move, on the left, has it. ' if known_part(state) is not None else ""
    return html.card(
        "The model is put aside", f"{words}Continue the model (left, Model) to look at it or change it.", "quiet", "part-aside"
    )


def solid_facts(solid: Polyhedron, density: float) -> list[tuple[str, str]]:
    """What a solid measures [mm] along its own sides, and what it weighs; its centre of mass from the middle of what it stands on."""
    axes = _own_axes(solid)
    volume, centre = solid.volume_and_centroid
    low, high = (solid.vertices @ axes.T).min(axis=0), (solid.vertices @ axes.T).max(axis=0)
    size = " × ".join(f"{1e3 * side:.1f}" for side in high - low)
    off = axes @ centre - ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, low[2])
    return [
        ("Size", f"{size} mm"),
        ("Volume", f"{1e6 * volume:.2f} cm³"),
        ("Mass", f"{1e3 * density * volume:.1f} g"),
        ("Centre of mass", f"{', '.join(f'{x:.1f}' for x in np.round(1e3 * off, 1) + 0.0)} mm from the middle of its base"),
    ]


def _own_axes(solid: Polyhedron) -> np.ndarray:
    """Rows (3, 3): along the longest level edge, level across it, and upright."""
    ways = np.array([solid.vertices[edge.end] - solid.vertices[edge.start] for edge in solid.edges])
    level = ways[np.abs(ways[:, 2]) < 1e-4 + 1e-3 * np.linalg.norm(ways, axis=1)]
    x = level[int(np.argmax(np.linalg.norm(level, axis=1)))] if len(level) else np.array([1.0, 0.0, 0.0])
    x = np.array([x[0], x[1], 0.0]) / np.hypot(x[0], x[1])
    return np.stack([x, np.array([-x[1], x[0], 0.0]), np.array([0.0, 0.0, 1.0])])


def truth_facts(judged: Truth | None) -> list[tuple[str, str]]:
    """How the model agrees with its scans."""
    if judged is None or not judged.scans or not np.isfinite(judged.rms):
        return []
    rows = [
        ("Residual", f"{1e3 * judged.rms:.2f} mm rms"),
        ("Explained", f"{100 * judged.explained:.0f} % of the readings"),
        ("Surface seen", f"{100 * judged.seen:.0f} %"),
    ]
    through = [scan for scan in judged.scans if scan.seen_through > TOLD_THROUGH]
    rows += [
        (f"Seen through in {scan.name}", f"{100 * scan.seen_through:.0f} %, {1e3 * scan.seen_through_m:.1f} mm deep") for scan in through
    ]
    return rows


def legend_html(judged: Truth | None) -> str:
    """What the colours of distances mean."""
    if judged is None or not judged.scans:
        return ""
    stops = ", ".join(f"{css(colour)} {50 * (at + 1):.0f}%" for colour, at in zip(RESIDUAL, RESIDUAL_AT, strict=True))
    limit = 1e3 * distance_limit([scan.noise for scan in judged.scans])
    return html.scale("Readings' distance from the model (mm), behind to in front", stops, [f"−{limit:.1f}", "0", f"+{limit:.1f}"])


def findings_html(judged: Truth | None, chosen: int, field: str) -> str:
    """What is broken, and what the scans say against the model, each with its sentence and the fix; a click points at it in the scene."""
    if judged is None:
        return ""
    rows = "".join(_finding(number, check, number == chosen, field) for number, check in enumerate(judged.findings) if not check.ok)
    listed = f'<div style="margin:4px 12px;font-size:12px;line-height:1.35">{rows}</div>' if rows else ""
    return f'<div data-testid="checks">{_verdict(judged)}{listed}</div>'


def _verdict(judged: Truth) -> str:
    broken = sum(not check.ok for check in judged.checks)
    if broken:
        return html.card("Not yet a part", f"{broken} of {len(judged.checks)} checks failed. Click one: the scene shows where.", "bad")
    sound = f"All {len(judged.checks)} checks hold: closed, flat, one body, nowhere too thin."
    if judged.doubts:
        return html.card("A part, but not what was scanned", f"{sound} The scans speak against it; click to see where.", "warn")
    return html.card("A part", sound, "good")


def _finding(number: int, check: Check, chosen: bool, field: str) -> str:
    colour = css(palette.ORANGE if check.name in DOUBTS else palette.VERMILLION)
    look = f"background:{colour}1c" if chosen else ""
    return (
        f'<div role="button" tabindex="0" data-testid="check-{number}" onclick="{html.esc(html.picking(field, str(number)))}" '
        f'style="cursor:pointer;border-left:3px solid {colour};padding:3px 8px;margin-bottom:2px;{look}">'
        f'{html.esc(check.sentence)} <span style="color:var(--muted)">{html.esc(check.fix)}</span></div>'
    )


def grasps_html(found: Graspable | None) -> str:
    """The best grasp classes as small pictures: the part seen along the closing fingers, where they touch, and the ways in."""
    if found is None or not found.classes:
        return ""
    cards = "".join(_grasp(found, place) for place in range(min(len(found.classes), MOST_GRASPS)))
    left = len(found.classes) - MOST_GRASPS
    more = f'<div style="color:var(--muted);font-size:11.5px">and {left} more; all are in Grasp once it is found</div>' if left > 0 else ""
    grid = f'<div style="display:grid;grid-template-columns:repeat(3,1fr);gap:6px">{cards}</div>'
    return f'<div data-testid="part-grasps" style="margin:4px 12px">{grid}{more}</div>'


def _grasp(found: Graspable, place: int) -> str:
    grasp_class, groups = found.classes[place]
    view = class_view(found.part, grasp_class, np.eye(4))
    picture = class_svg(found.part, grasp_class, [(group, OPEN) for group in groups], view)
    words = f"{grasp_class.name}: {len(groups)} approach groups"
    return (
        f'<div title="{html.esc(words)}" style="border:1px solid var(--line);border-radius:6px;overflow:hidden">{picture}'
        f'<div style="font-size:11px;text-align:center;padding:1px 3px 2px;{CLIPPED}">{html.esc(grasp_class.name)}</div></div>'
    )


def history_html(steps: Sequence[Step], looked_at: int | None, field: str) -> str:
    """The steps with a tick, or the sentence why one fell; a click shows the model as after it."""
    if not steps:
        return html.empty("No step yet. Each one that you do is listed here; it can be looked at, changed and taken out.", "history-empty")
    rows = "".join(_step(step, looked_at == step.number + 1, field) for step in steps)
    return f'<div data-testid="history" style="margin:2px 12px 6px;font-size:12px;line-height:1.3">{rows}</div>'


def _step(step: Step, chosen: bool, field: str) -> str:
    colour, sign = (palette.VERMILLION, "✕") if step.reason else (palette.TEAL, "✓")
    look = html.row_look(chosen)
    words = f'<span style="flex:1;{CLIPPED}" title="{html.esc(step.told)}">{html.esc(step.told)}</span>'
    why = (
        f'<div style="color:{palette.text(colour)};padding-left:34px;font-size:11.5px">{html.esc(step.reason)}</div>' if step.reason else ""
    )
    return (
        f'<div data-testid="step-{step.number}" role="button" tabindex="0" aria-pressed="{str(chosen).lower()}" '
        f'onclick="{html.esc(html.picking(field, str(step.number)))}" '
        f'style="cursor:pointer;{look};padding:3px 8px;margin-bottom:2px;border-radius:3px">'
        f'<div style="display:flex;gap:6px"><span style="color:{palette.text(colour)};width:12px">{sign}</span>'
        f'<span style="color:var(--faint);width:16px">{step.number + 1}</span>{words}</div>{why}</div>'
    )


def library_html(parts: Sequence[Part], chosen: str, drafts: Sequence[str], field: str) -> str:
    """The library's parts as thumbnails; a click picks one. Those that have their history are marked."""
    if not parts:
        return html.empty("The library has no parts yet.", "library-empty")
    cards = "".join(_thumbnail(number, part, part.name == chosen, part.name in drafts, field) for number, part in enumerate(parts))
    return f'<div data-testid="library" style="display:grid;grid-template-columns:repeat(3,1fr);gap:6px;margin:4px 12px">{cards}</div>'


def _thumbnail(number: int, part: Part, chosen: bool, has_draft: bool, field: str) -> str:
    blue = css(palette.BLUE)
    look = f"border-color:{blue};background:{blue}14" if chosen else "border-color:var(--line);background:var(--row)"
    size = " × ".join(measured(float(side), "m").removesuffix(" mm") for side in np.ptp(part.solid.vertices, axis=0))
    return (
        f'<div data-testid="part-{html.esc(part.name)}" role="button" tabindex="0" title="{html.esc(f"{part.name}: {size} mm")}" '
        f'onclick="{html.esc(html.picking(field, str(number)))}" style="{CARD};{look}">'
        f'<div style="height:64px">{part_thumbnail(part)}</div>'
        f'<div style="font-size:11.5px;text-align:center;{CLIPPED}">{html.esc(part.name)}{" ✎" if has_draft else ""}</div></div>'
    )
