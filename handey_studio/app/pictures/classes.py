"""Figure 6 of Handey 1987: grasp classes and approach groups of a part as small pictures, ranked, with what became of them."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import RGB, css
from handey_studio.app.pictures.part import part_in_plane
from handey_studio.app.pictures.svg import PlaneView, arrow, polygon, polyline, svg
from handey_studio.base import Entry, describe
from handey_studio.grasping import GraspClass, GraspGroup
from handey_studio.session.handling import Handling
from handey_studio.world import Part

SIZE = 140.0
ARROW_M = 0.022
CHOSEN, STOOD, FELL, OPEN = "chosen", "stood", "fell", "not looked at"
COLOURS: dict[str, RGB] = {CHOSEN: palette.BLUE, STOOD: palette.TEAL, FELL: palette.VERMILLION, OPEN: palette.GREY}
ORDER = (CHOSEN, STOOD, FELL, OPEN)
BARE = "background:#fbfcfd;display:block;width:100%"


def fate_of(group: GraspGroup, told: Mapping[str, Entry], chosen: str) -> str:
    """Chosen, stood, fell or not looked at."""
    if group.name == chosen:
        return CHOSEN
    entry = told.get(group.name)
    return OPEN if entry is None else STOOD if entry.reason is None else FELL


def classes_html(told: Handling, entries: Mapping[str, Entry], chosen: str, looked_at: int | None, picker: str) -> str:
    """A picture for each class, the best first; a click puts its number into the number field `picker` (an element's id)."""
    cards = [_card(told, number, place, entries, chosen, number == looked_at, picker) for place, number in enumerate(told.ranked())]
    chips = "".join(html.swatch(COLOURS[fate], fate) for fate in (ORDER if entries else (OPEN,)))
    grid = f'<div style="display:grid;grid-template-columns:1fr 1fr;gap:6px;margin:4px 0">{"".join(cards)}</div>'
    about = _about(told, looked_at, entries, chosen) if looked_at is not None else ""
    inner = f"{grid}<div>{chips}</div>{about}{_fallen(told.fell)}"
    return f'<div data-testid="classes" style="margin:2px 14px 6px;font-size:12px;line-height:1.45">{inner}</div>'


def class_view(part: Part, grasp_class: GraspClass, T_world_part: NDArray) -> PlaneView:
    """A view of the grasp plane that the whole part and the arrows around it are in."""
    middle = grasp_class.T_part_plane[:3, 1:3].T @ (part.solid.vertices.mean(axis=0) - grasp_class.T_part_plane[:3, 3])
    return PlaneView(T_world_part @ grasp_class.T_part_plane, middle, part.solid.diameter + 1.6 * ARROW_M, SIZE)


def class_svg(part: Part, grasp_class: GraspClass, groups: Sequence[tuple[GraspGroup, str]], view: PlaneView) -> str:
    """The part seen along the closing direction, where the fingers touch, and an arrow for each approach that crosses an edge somewhere."""
    shapes = [part_in_plane(part, grasp_class.T_part_plane, view)]
    outline = grasp_class.outline
    if len(outline) > 2:
        shapes.append(polygon(view.pixels(outline), palette.TEAL, 0.35, palette.TEAL))
    elif len(outline):
        shapes.append(polyline(view.pixels(outline), palette.TEAL, 4.0))
    best: dict[tuple[int, float], tuple[GraspGroup, str]] = {}
    for group, fate in groups:
        key = group.edge_number, group.share
        if key not in best or ORDER.index(fate) < ORDER.index(best[key][1]):
            best[key] = group, fate
    for group, fate in sorted(best.values(), key=lambda pair: -ORDER.index(pair[1])):
        along = np.array([np.cos(group.angle), np.sin(group.angle)])
        tail, tip = view.pixels(np.array([group.point - (group.depth + ARROW_M) * along, group.point]))
        shapes.append(arrow(tail, tip, COLOURS[fate], 3.0 if fate == CHOSEN else 1.2))
    return svg("class-picture", grasp_class.name, SIZE, SIZE, *shapes, style=BARE)


def _card(told: Handling, number: int, place: int, entries: Mapping[str, Entry], chosen: str, looked_at: bool, picker: str) -> str:
    grasp_class, numbers = told.classes[number], told.groups_of(number)
    groups = [(told.groups[g], fate_of(told.groups[g], entries, chosen)) for g in numbers]
    view = class_view(told.part, grasp_class, told.T_world_part)
    counts = {fate: sum(f == fate for _, f in groups) for fate in ORDER}
    said = ", ".join(f"{counts[fate]} {fate}" for fate in ORDER if counts[fate]) if entries else f"{len(groups)} approach groups"
    seen = "seen from above or below" if view.level else "up is up"
    border = palette.BLUE if any(fate == CHOSEN for _, fate in groups) else (221, 226, 232)
    shade = "box-shadow:0 0 0 2px " + css(palette.BLUE) + "55;" if looked_at else ""
    return (
        f'<div data-testid="class-{number}" role="button" tabindex="0" aria-pressed="{str(looked_at).lower()}" '
        f'onclick="{html.esc(html.picking(picker, str(number)))}" title="{html.esc(seen)}" style="cursor:pointer;overflow:hidden;'
        f'border:1.5px solid {css(border)};{shade}border-radius:6px;background:var(--row)">'
        f"{class_svg(told.part, grasp_class, groups, view)}"
        f'<div style="padding:2px 7px 5px;line-height:1.3"><b style="font-weight:650">{place + 1}. {html.esc(grasp_class.name)}</b>'
        f'<div style="color:var(--muted);font-size:11px">{html.esc(said)}</div></div></div>'
    )


def _about(told: Handling, number: int, entries: Mapping[str, Entry], chosen: str) -> str:
    """Every group of a class with what became of it."""
    rows = "".join(_group_row(told.groups[g], entries, chosen) for g in told.groups_of(number))
    head = f'<div style="font-weight:650;margin-top:6px">{html.esc(told.classes[number].name)}: its approach groups, ranked</div>'
    return f'{head}<div data-testid="class-groups" style="max-height:190px;overflow:auto;font-size:11.5px">{rows}</div>'


def _group_row(group: GraspGroup, entries: Mapping[str, Entry], chosen: str) -> str:
    fate = fate_of(group, entries, chosen)
    sign = {CHOSEN: "★", STOOD: "●", FELL: "✕", OPEN: "○"}[fate]
    name = group.name.removeprefix(group.grasp_class.name + ", ")
    why = describe(entries[group.name]) if fate == FELL else fate
    mark = f'<span style="color:{palette.text(COLOURS[fate])};display:inline-block;width:16px">{sign}</span>{html.esc(name)}'
    said = f'<span style="color:var(--muted)">{html.esc(why)}</span>'
    return f'<div style="padding:1px 0;border-bottom:1px solid var(--line)">{mark} {said}</div>'


def _fallen(entries: Sequence[Entry]) -> str:
    """The pairs of features that are no grasp class, and the edges that no approach can cross first, with the reason."""
    fell = [entry for entry in entries if entry.reason]
    if not fell:
        return ""
    rows = "".join(
        f'<div style="padding:1px 0"><span style="color:{palette.text(palette.VERMILLION)};display:inline-block;width:16px">✕</span>'
        f'{html.esc(entry.option)}: <span style="color:var(--muted)">{html.esc(describe(entry))}</span></div>'
        for entry in fell
    )
    head = f'<div style="font-weight:650;margin-top:6px">Fell before any scene was looked at ({len(fell)})</div>'
    return f'{head}<div data-testid="classes-fallen" style="max-height:110px;overflow:auto;font-size:11.5px">{rows}</div>'
