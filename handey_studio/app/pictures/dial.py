"""The hand angles about a grasp point as a dial (Handey 1987, Figure 7): what forbids which, what is legal, what was chosen."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import RGB, css
from handey_studio.app.pictures.part import part_in_plane
from handey_studio.app.pictures.svg import PlaneView, arrow, circle, polygon, polyline, svg, words
from handey_studio.grasping import ForbiddenRange
from handey_studio.task.plan import GraspChoice
from handey_studio.world import Hand, Part

WIDTH, HEIGHT = 300.0, 268.0
VIEW_M = 0.26
LEGAL_RADIUS, RING, GAP = 128.0, 8.0, 1.5
ASIDE = 56.0  # pixels that the grasp point lies off the middle, away from the hand
STEP_RAD = np.deg2rad(3.0)
KINDS: tuple[tuple[str, RGB], ...] = (
    ("obstacles at the pickup", palette.PICKUP),
    ("obstacles at the putdown", palette.PUTDOWN),
    ("the part itself", palette.OWN),
    ("too little contact", palette.SHORT),
    ("out of the arm's reach", palette.BEYOND),
)


def kind_of(forbidden: ForbiddenRange) -> str:
    """What forbids a range, in the words of the legend."""
    if forbidden.what == "reach":
        return KINDS[4][0]
    if forbidden.what == "contact" or not forbidden.body:
        return KINDS[3][0]
    return {"pickup": KINDS[0][0], "putdown": KINDS[1][0], "both": KINDS[2][0]}[forbidden.end]


def window_of(grasp: GraspChoice) -> tuple[float, float]:
    """The angles [rad] that belong to the group: all that are legal or forbidden."""
    ends = [*np.ravel(grasp.ranges).tolist(), *(end for f in grasp.forbidden for end in (f.low, f.high))]
    return (min(ends), max(ends)) if ends else (grasp.angle, grasp.angle)


def dial_svg(grasp: GraspChoice, T_world_plane: NDArray, point: NDArray, hand: Hand, part: Part | None) -> str:
    """The hand at its chosen angle and, pale, at both ends of its legal range; around it a ring of the legal angles and, inside, one of the
    forbidden ones for each thing that forbids any. The rings lie where the hand comes from, opposite to where its fingers point."""
    view = PlaneView(T_world_plane, point, VIEW_M, WIDTH)
    low, high = window_of(grasp)
    shift = np.array([0.0, HEIGHT - WIDTH]) / 2.0 - _at(view, np.zeros(2), (low + high) / 2.0, ASIDE)
    middle = view.pixels(point[None])[0] + shift
    body = part_in_plane(part, grasp.T_part_plane, view) if part is not None else ""
    contact = _in_plane(grasp, grasp.contact_part)
    touched = polygon(view.pixels(contact), palette.TEAL, 0.25, palette.TEAL) if len(contact) > 2 else ""
    edge = polyline(view.pixels(_in_plane(grasp, grasp.edge_part)), palette.VERMILLION, 3.0)
    moved = f'<g transform="translate({shift[0]:g} {shift[1]:g})">{body}{touched}{edge}</g>'
    reach = hand.finger_length + hand.crosspiece_height
    hands = "".join(_hand(view, middle, hand, end, 0.07) for span in grasp.ranges for end in span)
    hands += _hand(view, middle, hand, grasp.angle, 0.38)
    needle = arrow(_at(view, middle, grasp.angle, reach * WIDTH / VIEW_M + 6), _at(view, middle, grasp.angle, 14.0), palette.BLUE, 2.6)
    rings = _rings(view, middle, grasp)
    return svg("angle-dial", "Hand angles", WIDTH, HEIGHT, moved, hands, rings, needle, circle(middle, 3.5, palette.VERMILLION))


def dial_chips(grasp: GraspChoice) -> list[tuple[RGB, str]]:
    """The legend: only what forbids anything here."""
    there = {kind_of(f) for f in grasp.forbidden}
    rest = [(colour, f"forbidden: {kind}") for kind, colour in KINDS if kind in there]
    return [(palette.TEAL, "legal at both ends"), (palette.BLUE, "chosen"), *rest]


def dial_words(grasp: GraspChoice) -> str:
    """How much is legal, and what forbids the rest, in degrees off crossing the first edge at right angles."""
    low, high = window_of(grasp)
    legal = np.rad2deg(sum(b - a for a, b in grasp.ranges))
    if not grasp.forbidden:
        return f"All {legal:.0f}° are legal: nothing is in the hand's way."
    said = f"{legal:.0f}° of {np.rad2deg(high - low):.0f}° are legal. Angles count from crossing the first edge (red) at right angles."
    named = [f.body for f in sorted(grasp.forbidden, key=lambda f: f.low - f.high) if f.body]
    return said + (f" In the way: {', '.join(dict.fromkeys(named))}." if named else "")


def _rings(view: PlaneView, middle: NDArray, grasp: GraspChoice) -> str:
    low, high = window_of(grasp)
    zero = (low + high) / 2.0
    drawn = [_arc(view, middle, low, high, LEGAL_RADIUS, palette.PALE, RING, "")]
    drawn += [_arc(view, middle, a, b, LEGAL_RADIUS, palette.TEAL, RING, f"legal {_span(a, b, zero)}") for a, b in grasp.ranges]
    radius = LEGAL_RADIUS
    for kind, colour in KINDS:
        ranges = [f for f in grasp.forbidden if kind_of(f) == kind]
        radius -= RING + GAP if ranges else 0.0
        for f in ranges:
            drawn.append(_arc(view, middle, f.low, f.high, radius, colour, RING, f"{f.body or kind}: {_span(f.low, f.high, zero)}"))
    if grasp.forbidden:
        ticks = [zero + np.deg2rad(d) for d in (-60, -30, 0, 30, 60) if low - 1e-6 <= zero + np.deg2rad(d) <= high + 1e-6]
        drawn += [_tick(view, middle, tick, _degrees(tick - zero)) for tick in ticks]
    return "".join(drawn)


def _span(low: float, high: float, zero: float) -> str:
    return f"{_degrees(low - zero)} to {_degrees(high - zero)}"


def _degrees(angle: float) -> str:
    number = round(float(np.rad2deg(angle)))
    return f"{'−' if number < 0 else '+' if number else ''}{abs(number)}°"


def _tick(view: PlaneView, middle: NDArray, angle: float, label: str) -> str:
    return words(_at(view, middle, angle, LEGAL_RADIUS + 15.0) + np.array([0.0, 3.0]), label, 9.0)


def _arc(view: PlaneView, middle: NDArray, low: float, high: float, radius: float, colour: RGB, width: float, title: str) -> str:
    angles = np.linspace(low, high, max(2, int((high - low) / STEP_RAD) + 2))
    points = np.array([_at(view, middle, angle, radius) for angle in angles])
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return (
        f'<polyline points="{path}" fill="none" stroke="{css(colour)}" stroke-width="{width:g}"><title>{html.esc(title)}</title></polyline>'
    )


def _at(view: PlaneView, middle: NDArray, angle: float, radius: float) -> NDArray:
    """Where the hand comes from at an angle, so many pixels from the grasp point."""
    return middle - radius * view.directions(np.array([np.cos(angle), np.sin(angle)]))


def _hand(view: PlaneView, middle: NDArray, hand: Hand, angle: float, opacity: float) -> str:
    """Fingers and crosspiece with the tips at the grasp point."""
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    scale, shapes = WIDTH / VIEW_M, []
    root = -hand.finger_length
    for half, low, high in ((hand.finger_width, root, 0.0), (hand.crosspiece_width, root - hand.crosspiece_height, root)):
        sides: Sequence[tuple[float, float]] = ((-half / 2, low), (half / 2, low), (half / 2, high), (-half / 2, high))
        corners = np.array([a * across + b * along for a, b in sides])
        shapes.append(polygon(middle + scale * view.directions(corners), palette.TEAL, opacity, palette.TEAL, 0.8))
    return "".join(shapes)


def _in_plane(grasp: GraspChoice, points: NDArray) -> NDArray:
    """Points (n, 3) of the part in y, z of the grasp plane."""
    T = grasp.T_part_plane
    return (points - T[:3, 3]) @ T[:3, 1:3]
