"""The grasp–placement table as a picture: how the part can stand, which grasps the table leaves room for, the way used."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import RGB, css
from handey_studio.app.pictures.part import part_icon
from handey_studio.app.pictures.svg import circle, picture_uri, polyline, svg, words
from handey_studio.base import measured
from handey_studio.grasping import GOAL, START
from handey_studio.session.handling import Handling

WIDTH, LEFT, ROW, TOP = 320.0, 92.0, 27.0, 15.0
SOME: RGB = (206, 230, 226)  # legal at one hand angle; TEAL: at all of them
TABLE: RGB = (241, 206, 184)
SHORT: RGB = (222, 226, 231)
OWN: RGB = (196, 202, 210)
CHIPS = (
    (palette.TEAL, "legal at every hand angle"),
    (SOME, "at few"),
    (TABLE, "hand in the table or an obstacle"),
    (OWN, "part itself in the way"),
    (SHORT, "too little contact"),
)
LONG = 10  # letters that do not fit beside an icon
ENDS = {START: "start", GOAL: "goal"}


@dataclass(frozen=True, eq=False)
class Layout:
    """What stands where: rows of the table from top to bottom, and which of the table's columns each column of the picture stands for."""

    rows: tuple[int, ...]
    columns: tuple[tuple[int, ...], ...]
    classes: tuple[tuple[int, int], ...]

    def picked(self, told: Handling, code: int) -> tuple[int, int | None] | None:
        """Row and column of the table that a click means; a click on a row's name means no column, a code that means nothing gives None."""
        place, across = divmod(code, len(self.columns) + 1)
        if not 0 <= place < len(self.rows):
            return None
        row = self.rows[place]
        return row, best_of(told, row, self.columns[across - 1]) if across else None

    def code(self, place: int) -> int:
        """The click on the name of the row at a place."""
        return place * (len(self.columns) + 1)


def layout_of(told: Handling, grasp_class: int | None) -> Layout:
    """A column for each approach group of every class, or for each grasp of one class."""
    columns: list[tuple[int, ...]] = []
    classes = []
    for number in told.ranked() if grasp_class is None else [grasp_class]:
        first = len(columns)
        for g in sorted(told.groups_of(number)):
            own = tuple(int(c) for c in np.nonzero(told.table.group_of == g)[0])
            columns += [own] if grasp_class is None else [(c,) for c in own]
        classes.append((number, len(columns) - first))
    return Layout(told.rows, tuple(columns), tuple(classes))


def best_of(told: Handling, row: int, columns: Sequence[int]) -> int:
    """Of some columns the legal one that is nearest to crossing the edge at right angles; the middle one if none is legal."""
    legal = told.legal(row)
    off = {c: abs(float(told.table.angles[c] - told.table.groups[told.table.group_of[c]].angle)) for c in columns}
    return min(columns, key=lambda c: (not legal[c], off[c]))


def table_html(told: Handling, layout: Layout, row: int | None, column: int | None, way: Sequence[tuple[int, int]], picker: str) -> str:
    """The picture with its legend, and the cell that is looked at in words."""
    chips = [*CHIPS, *([(palette.BLUE, "the sequence that was used")] if _way(layout, way) else [])]
    return html.figure(table_svg(told, layout, row, column, way, picker), chips, cell_words(told, row, column))


def table_svg(told: Handling, layout: Layout, row: int | None, column: int | None, way: Sequence[tuple[int, int]], picker: str) -> str:
    """Rows of cells; a click puts the code of what is there (`Layout.picked`) into the number field `picker`."""
    rows, across = len(layout.rows), len(layout.columns)
    height, wide = TOP + ROW * rows, WIDTH - LEFT
    image = np.ascontiguousarray(np.stack([_colours(told, r, layout) for r in layout.rows])) if rows and across else None
    cells = _image(image, wide, ROW * rows) if image is not None else ""
    names = "".join(_name(told, layout, place, picker, r == row) for place, r in enumerate(layout.rows))
    lines = "".join(polyline(np.array([[LEFT, y], [WIDTH, y]]), (255, 255, 255), 2.0) for y in TOP + ROW * np.arange(1, rows))
    pressed = (
        f"const r=this.getBoundingClientRect(),c=Math.min({across}-1,Math.floor((event.clientX-r.left)/r.width*{across})),"
        f"w=Math.min({rows}-1,Math.floor((event.clientY-r.top)/r.height*{rows}));"
    )
    click = html.esc(pressed + html.picking(picker, f"w*{across + 1}+c+1"))
    area = (
        f'<rect data-testid="table-cells" x="{LEFT:g}" y="{TOP:g}" width="{wide:g}" height="{ROW * rows:g}" fill="#fff" fill-opacity="0" '
        f'style="cursor:crosshair" onclick="{click}"/>'
    )
    marks = _classes(told, layout, height) + lines + _way(layout, way) + _mark(layout, row, column)
    return svg(
        "grasp-placement-table",
        "Grasp–placement table",
        WIDTH,
        height,
        cells,
        names,
        marks,
        area,
        style="width:100%;display:block;background:#fbfcfd",
    )


def cell_words(told: Handling, row: int | None, column: int | None) -> str:
    """The cell that is looked at: placement, grasp, and what speaks against it."""
    table = told.table
    if row is None:
        return "Click a row to see the part stand like that on the table, a cell to see the hand there as well."
    said = f"{row_name(told, row)}."
    if row not in ENDS:
        placement = table.placements[table.placement_of[row]]
        said = f"{placement.name}: tips over at {measured(placement.tip, 'rad')}, centre of mass {html.millimetres(placement.height)} high."
    if column is None:
        return f"{said} {int(told.legal(row).sum())} of {len(table.angles)} grasps are legal."
    if told.legal(row)[column]:
        why = "legal"
    elif row in ENDS:
        why = "the hand meets something there" if table.sound[column] else table.reason(0, column)[0]
    else:
        reason, value, limit, unit = table.reason(row, column)
        why = f"{reason}: {measured(value, unit)}, limit {measured(limit, unit)}"
    return f"{said} {table.grasp_name(column)}: {why}."


def row_name(told: Handling, row: int) -> str:
    """The placement's name, or which end of the MOVE it is."""
    return f"{ENDS[row].capitalize()} of the MOVE" if row in ENDS else told.table.placements[told.table.placement_of[row]].name


def _colours(told: Handling, row: int, layout: Layout) -> NDArray:
    """Colours (columns, 3) uint8 of a row: by the share of angles that are legal, else by what speaks against most of them."""
    legal, table = told.legal(row), told.table
    short = table.areas < table.hand.min_contact_area
    own = ~short & (table.gaps < table.options.least_gap)
    out = np.empty((len(layout.columns), 3), dtype=np.uint8)
    for k, columns in enumerate(layout.columns):
        own_columns = list(columns)
        share = float(legal[own_columns].mean())
        kinds = {TABLE: table.sound & ~legal, OWN: own, SHORT: short}
        against = {colour: float(which[own_columns].mean()) for colour, which in kinds.items()}
        mixed = np.array(SOME) + (np.array(palette.TEAL) - SOME) * share
        out[k] = mixed if share > 0 else max(against, key=lambda colour: against[colour])
    return out


def _image(image: NDArray, width: float, height: float) -> str:
    look = 'preserveAspectRatio="none" style="image-rendering:pixelated"'
    return f'<image href="{picture_uri(image)}" x="{LEFT:g}" y="{TOP:g}" width="{width:g}" height="{height:g}" {look}/>'


def _name(told: Handling, layout: Layout, place: int, picker: str, looked_at: bool) -> str:
    """Icon and name of a row."""
    row = layout.rows[place]
    y = TOP + ROW * (place + 0.5)
    T = told.T_world_part if row in ENDS else told.table.Ts_plane_part[row]
    icon = "" if row in ENDS else part_icon(told.part, T, np.array([13.0, y]), 25.0)
    below = "legal here" if row in ENDS else f"tips at {measured(told.table.placements[told.table.placement_of[row]].tip, 'rad')}"
    name = row_name(told, row).removesuffix(" of the MOVE")
    name = name if len(name) < LONG else "slanted"
    fill = f'fill="{css(palette.BLUE)}" fill-opacity="{0.12 if looked_at else 0.0:g}"'
    click = f'onclick="{html.esc(html.picking(picker, str(layout.code(place))))}" style="cursor:pointer"'
    x = 29.0 if icon else 4.0
    return (
        f"{icon}{words((x, y - 1.5), name, 10.0, 'start', palette.INK, 650)}{words((x, y + 8.5), below, 8.5, 'start', palette.GREY)}"
        f'<rect data-testid="table-row-{place}" x="0" y="{y - ROW / 2:g}" width="{LEFT - 3:g}" height="{ROW:g}" {fill} {click}/>'
    )


def _classes(told: Handling, layout: Layout, height: float) -> str:
    """The classes' ranks above their columns, and a line between each two."""
    ranks, drawn, at = told.ranked(), [], 0
    step = (WIDTH - LEFT) / max(len(layout.columns), 1)
    for number, count in layout.classes:
        x = LEFT + step * at
        if at:
            drawn.append(polyline(np.array([[x, 2.0], [x, height]]), palette.INK, 0.8))
        label = f"{ranks.index(number) + 1}" if len(layout.classes) > 1 else f"{ranks.index(number) + 1}. {told.classes[number].name}"
        drawn.append(words((x + step * count / 2.0, TOP - 4.0), label, 9.5, "middle", palette.INK, 650))
        at += count
    return "".join(drawn)


def _spot(layout: Layout, row: int, column: int) -> NDArray | None:
    """Where a cell has its middle; None if the picture does not show it."""
    across = next((k for k, columns in enumerate(layout.columns) if column in columns), None)
    if across is None or row not in layout.rows:
        return None
    step = (WIDTH - LEFT) / len(layout.columns)
    return np.array([LEFT + step * (across + 0.5), TOP + ROW * (layout.rows.index(row) + 0.5)])


def _way(layout: Layout, way: Sequence[tuple[int, int]]) -> str:
    """The sequence as a path through the table: down a column while the part is carried, across where it is put down and taken anew."""
    spots = [spot for spot in (_spot(layout, *cell) for cell in way) if spot is not None]
    if len(spots) < 2:
        return ""
    line = np.array(spots)
    dots = "".join(circle(spot, 3.6, palette.BLUE, (255, 255, 255), 1.2) for spot in spots)
    return polyline(line, (255, 255, 255), 4.4) + polyline(line, palette.BLUE, 2.4) + dots


def _mark(layout: Layout, row: int | None, column: int | None) -> str:
    spot = _spot(layout, row, column) if row is not None and column is not None else None
    return "" if spot is None else circle(spot, 6.0, None, palette.INK, 2.0)
