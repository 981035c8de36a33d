"""The grasp plane as a picture (Handey 1987, Figures 8, 9 and 10): filled cells, the hand with its bump lines and vectors, its way in."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import FILLED, RGB
from handey_studio.app.pictures.part import part_in_plane
from handey_studio.app.pictures.svg import PlaneView, arrow, circle, picture_uri, polygon, polyline, svg, words
from handey_studio.base import frozen_array
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import BumpIterations, BumpOptions, BumpRun, GraspPlane, bump_lines, hand_in_plane, hand_outline, outline_with
from handey_studio.grasping.hand_outline import Outline, hand_rectangles
from handey_studio.task.plan import GraspChoice
from handey_studio.world import Hand, Held, Part

SIZE = 300
VIEW_M = 0.30  # how much of the plane is shown, up and across, or
ROUND_M = 0.22  # so much round the path if that is more
DIAL = np.array([256.0, 44.0])  # where the unit circle of Figure 10 stands
UNIT = 12.0  # pixels of a multiplier of one on it
LEVER_M = 0.06  # a radian of turn counts as so much way when poses are compared
PICKUP, PUTDOWN, BOTH = "pickup", "putdown, carried back", "both"
OBSTACLES = (PICKUP, PUTDOWN, BOTH)
PALE_PUTDOWN: RGB = (216, 208, 236)
RULES = ("goes along the free motion vector", "takes a stairstep along the bump vector nearest to it", "turns on the spot")
FOUND = {
    "bump lines": "Bump lines led the hand in.",
    "another start": "Bump lines led the hand in, from another start.",
    "plane search": "Bump lines got stuck; a search of all motions in the plane found the way.",
    "straight back": "Straight along the fingers.",
}
FOUND_CARRIED = FOUND | {
    "bump lines": "Bump lines led the hand with the part in it straight back.",
    "another start": "Bump lines led the hand with the part in it; straight back they got stuck.",
}


def grasp_plane_svg(
    run: BumpRun,
    hand: Hand,
    at: int = -1,
    grasp: GraspChoice | None = None,
    part: Part | None = None,
    putdown: GraspPlane | None = None,
    obstacles: str = PICKUP,
    way_out: NDArray | None = None,
    place: NDArray | None = None,
) -> str:
    """Cells filled for the fingers (dark) and the crosspiece (light), the part, the hand at the start and at point `at`, its bump lines
    at the iteration nearest to that, the path. If the hand has the part in it, `place` is the pose (y, z, angle) at which it stands.

    World up is up in the picture as far as the plane allows. `putdown` is the grasp plane at the putdown, carried back by the inverse of
    the part's motion: it shares y and z with the pickup's; `way_out` (n, 2) [m] is how the hand leaves there, carried back as well.
    """
    wide = max(VIEW_M, ROUND_M + float(np.ptp(run.path[:, :2], axis=0).max()))
    view = PlaneView(run.plane.T_world_plane, (run.path[-1, :2] + run.path[0, :2]) / 2.0, wide, SIZE)
    layers = [] if obstacles == PUTDOWN and putdown is not None else [_cells(view, run.plane, FILLED, palette.PALE)]
    if putdown is not None and obstacles != PICKUP:
        layers.append(_cells(view, putdown, palette.PUTDOWN, PALE_PUTDOWN, 0.75 if layers else 1.0))
    pose, outline = run.path[at], hand_outline(hand)
    if grasp is not None and part is not None:
        moved = np.eye(4) if place is None else hand_in_plane(place[:2], place[2], 1) @ inverse(hand_in_plane(pose[:2], pose[2], 1))
        layers.append(part_in_plane(part, grasp.T_part_plane @ moved, view))
        outline = outline if place is None else carried_outline(hand, grasp, part, place)
    if way_out is not None and len(way_out):
        layers.append(polyline(view.pixels(way_out), palette.PUTDOWN, 2.5, dash="5 3"))
    layers += [_hand(view, hand, run.path[0], palette.GREY, 0.10), polyline(view.pixels(run.path[:, :2]), palette.BLUE, 2.5)]
    layers += [_hand(view, hand, pose, palette.TEAL, 0.45), *_iteration(view, run, outline, pose)]
    layers.append(circle(view.pixels(run.goal[None])[0], 4, palette.VERMILLION))
    return svg("grasp-plane", "Grasp plane", SIZE, SIZE, *layers)


def plane_chips(obstacles: str, carried: bool = False) -> list[tuple[RGB, str]]:
    """What the colours mean; `carried` if the hand has the part in it."""
    pickup = [
        (FILLED, "fingers may not go here"),
        (palette.PALE, "nor the crosspiece or the part here" if carried else "nor the crosspiece here"),
    ]
    putdown = [(palette.PUTDOWN, "the same at the putdown"), (PALE_PUTDOWN, "crosspiece there")]
    shown = [*(pickup if obstacles != PUTDOWN else []), *(putdown if obstacles != PICKUP else [])]
    rest = [(palette.TEAL, "hand"), (palette.BLUE, "its path, free motion vector"), (palette.ORANGE, "bump lines, vectors × multiplier")]
    out = [] if carried else [(palette.PUTDOWN, "dashed: its way out at the putdown")]
    return [*shown, *rest, *out, (palette.VERMILLION, "bump lines that touch; grasp point")]


def carried_outline(hand: Hand, grasp: GraspChoice, part: Part, place: NDArray) -> Outline:
    """Hand and part together; at the pose `place` (y, z, angle) of the hand the part stands where the plane was laid through it."""
    T_hand_part = frozen_array(inverse(grasp.T_part_plane @ hand_in_plane(place[:2], place[2], 1)))
    return outline_with(hand, Held(part.name, part, T_hand_part))[0]


def plane_words(run: BumpRun, outline: Outline, at: int) -> str:
    """What it took, and what the bump lines do at this point of the path; `outline` is what was led, the hand alone or with the part."""
    found_by = FOUND_CARRIED if run.plane.held.size else FOUND
    said = found_by.get(run.found_by, f"Approach: {run.status}, {html.millimetres(run.distance, 1)} from the grasp point.")
    found = iteration_at(run, outline, run.path[at])
    if found is None:
        return said
    told, k = found
    touching = int(told.colliding[k].sum())
    lines = "no bump line touches" if not touching else f"{touching} bump line{'s' if touching > 1 else ''} touch"
    return f"{said} Iteration {k + 1} of {len(told.poses)}: {lines}; the hand {RULES[int(told.rules[k])]}."


def iteration_at(run: BumpRun, outline: Outline, pose: NDArray) -> tuple[BumpIterations, int] | None:
    """The iterations of the bump lines' run, and the number of that in which the hand was nearest to a pose (y, z, angle).

    None if the run kept none, or those of something with other bump lines.
    """
    told, lines = run.iterations, len(bump_lines(outline, BumpOptions()).vectors)
    k = 0 if told is None else len(told.poses)
    shapes = [] if told is None else [told.poses.shape, told.colliding.shape, told.multipliers.shape, told.free.shape, told.rules.shape]
    if (
        told is None
        or not k
        or shapes != [(k, 3), (k, lines), (k, lines), (k, 2), (k,)]
        or not np.isin(told.rules, range(len(RULES))).all()
    ):
        return None
    return told, int(np.argmin(((told.poses - pose) ** 2 * (1.0, 1.0, LEVER_M**2)).sum(axis=1)))


@lru_cache(maxsize=16)
def _image(plane: GraspPlane, dark: RGB, light: RGB) -> str:
    """The grids as one image with a pixel a cell; where only what is held may not go it is as light as where the crosspiece may not."""
    image = np.zeros((*plane.fingers.shape, 4), dtype=np.uint8)
    if plane.held.size:
        image[plane.held] = (*light, 255)
    image[plane.crosspiece] = (*light, 255)
    image[plane.fingers] = (*dark, 255)
    return picture_uri(image)


def _cells(view: PlaneView, plane: GraspPlane, dark: RGB, light: RGB, opacity: float = 1.0) -> str:
    """The image laid into the picture by an affine map."""
    corners = plane.origin + plane.cell * np.array([[0, 0], [1, 0], [0, 1]])  # cell (i, k) is row i, column k of the image
    (ox, oy), (ix, iy), (kx, ky) = view.pixels(corners)
    matrix = " ".join(f"{number:.5f}" for number in (kx - ox, ky - oy, ix - ox, iy - oy, ox, oy))
    rows, columns = plane.fingers.shape
    look = f'opacity="{opacity:g}" style="image-rendering:pixelated"'
    return f'<image href="{_image(plane, dark, light)}" width="{columns}" height="{rows}" transform="matrix({matrix})" {look}/>'


def _axes(angle: float) -> NDArray:
    """Rows: the hand's directions across and along its fingers, in the plane's y, z."""
    along = np.array([np.cos(angle), np.sin(angle)])
    return np.array([[-along[1], along[0]], along])


def _hand(view: PlaneView, hand: Hand, pose: NDArray, colour: RGB, opacity: float) -> str:
    """The hand's rectangles at a pose (y, z, angle)."""
    shapes = []
    for _, half, low, high in hand_rectangles(hand):
        corners = np.array([[-half, low], [half, low], [half, high], [-half, high]]) @ _axes(pose[2]) + pose[:2]
        shapes.append(polygon(view.pixels(corners), colour, opacity, colour))
    return "".join(shapes)


def _iteration(view: PlaneView, run: BumpRun, outline: Outline, pose: NDArray) -> list[str]:
    """Bump lines, near solid and far dashed; bump vectors as long as their multipliers; the free motion vector; the unit circle."""
    lines, found = bump_lines(outline, BumpOptions()), iteration_at(run, outline, pose)
    at = pose if found is None else found[0].poses[found[1]]
    touching = np.zeros(len(lines.vectors), dtype=bool) if found is None else found[0].colliding[found[1]]
    axes, drawn = _axes(at[2]), []
    for ends, far, red in zip(lines.ends @ axes + at[:2], lines.far, touching, strict=True):
        look = (palette.VERMILLION, 2.4) if red else (palette.ORANGE, 1.0)
        drawn.append(polyline(view.pixels(ends), *look, dash="3 3" if far and not red else ""))
    if found is None:
        return drawn
    told, k = found
    near = ~lines.far
    roots = view.pixels(lines.ends[near].mean(axis=1) @ axes + at[:2])
    units, multipliers = view.directions(lines.vectors[near] @ axes), told.multipliers[k][near]
    reach = zip(roots, 4.5 * units * multipliers[:, None], strict=True)
    drawn += [arrow(root, root + vector, palette.ORANGE, 1.2) for root, vector in reach]
    free = view.directions(told.free[k])
    tip = view.pixels(at[None, :2])[0]
    return [*drawn, arrow(tip, tip + 24.0 * free, palette.BLUE, 3.0), _unit_circle(units, multipliers, free)]


def _unit_circle(units: NDArray, multipliers: NDArray, free: NDArray) -> str:
    """Figure 10: the free motion vector on the unit circle, and in each direction the bump vector with the least multiplier."""
    least: dict[tuple[float, ...], float] = {}
    for unit, multiplier in zip(np.round(units, 3).tolist(), multipliers.tolist(), strict=True):
        least[tuple(unit)] = min(multiplier, least.get(tuple(unit), np.inf))
    arrows = "".join(arrow(DIAL, DIAL + UNIT * m * np.array(unit), palette.ORANGE, 1.4) for unit, m in least.items())
    shut = "".join(circle(DIAL + UNIT * np.array(unit), 2.2, palette.VERMILLION) for unit, m in least.items() if m == 0.0)
    panel = f'<rect x="{DIAL[0] - 42}" y="{DIAL[1] - 41}" width="84" height="93" rx="6" fill="#fff" fill-opacity=".88" stroke="#dde2e8"/>'
    rings = circle(DIAL, UNIT, None, palette.GREY, 1.0) + circle(DIAL, 3 * UNIT, None, palette.PALE, 1.0, "2 3")
    return (
        panel
        + rings
        + arrows
        + shut
        + arrow(DIAL, DIAL + UNIT * free, palette.BLUE, 2.6)
        + words(DIAL + np.array([0.0, 47.0]), "unit circle", 8.5)
    )
