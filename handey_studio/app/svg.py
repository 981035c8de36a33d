"""Pictures of planes as SVG: the grasp plane with its filled cells, and the hand's way in it."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import css
from handey_studio.grasping import BumpOptions, BumpRun, bump_lines
from handey_studio.grasping.bump_lines import hand_rectangles
from handey_studio.world import Hand

SIZE = 300
VIEW_M = 0.32  # how much of the plane is shown, up and across


def grasp_plane_svg(run: BumpRun, hand: Hand) -> str:
    """Filled cells of the fingers (dark) and of the crosspiece (light), bump lines, the hand at both ends, and its path.

    World up is up in the picture as far as the plane allows.
    """
    frame = _Frame(run)
    parts = [
        _cells(frame, run.plane.crosspiece, css(palette.PALE)),
        _cells(frame, run.plane.fingers, "#9aa5b1"),
        _hand(frame, hand, run.path[0], css(palette.GREY), 0.25),
        _hand(frame, hand, run.path[-1], css(palette.TEAL), 0.55),
        _bumps(frame, hand, run.path[-1]),
        _path(frame, run.path),
    ]
    goal = frame.pixels(run.goal[None])[0]
    parts.append(f'<circle cx="{goal[0]:.1f}" cy="{goal[1]:.1f}" r="4" fill="{css(palette.VERMILLION)}"/>')
    style = "width:100%;display:block;background:#fbfcfd;border:1px solid #dde2e8;border-radius:6px"
    head = f'<svg data-testid="grasp-plane" viewBox="0 0 {SIZE} {SIZE}" style="{style}" role="img" aria-label="Grasp plane">'
    return f"{head}{''.join(parts)}</svg>"


def grasp_plane_html(run: BumpRun, hand: Hand) -> str:
    """The picture with its legend and what became of the approach."""
    chips = (
        html.swatch((154, 165, 177), "filled for the fingers")
        + html.swatch(palette.PALE, "for the crosspiece")
        + html.swatch(palette.TEAL, "hand")
        + html.swatch(palette.BLUE, "its path")
        + html.swatch(palette.ORANGE, "bump lines")
    )
    words = f"Approach: {run.status}, {len(run.path) - 1} steps, {html.millimetres(run.distance, 1)} from the grasp point."
    return (
        f'<div style="margin:6px 14px;font-size:12px;line-height:1.7">{grasp_plane_svg(run, hand)}<div style="margin-top:4px">{chips}</div>'
        f"<div>{html.esc(words)}</div></div>"
    )


class _Frame:
    """From the plane's y, z [m] to pixels, turned by quarter turns so that world up points up."""

    def __init__(self, run: BumpRun) -> None:
        up = run.plane.T_world_plane[2, 1:3]
        self._up = up / max(np.linalg.norm(up), 1e-9) if np.linalg.norm(up) > 1e-6 else np.array([0.0, 1.0])
        self._across = np.array([self._up[1], -self._up[0]])
        self._centre = (run.path[-1, :2] + run.path[0, :2]) / 2.0
        self.cell, self.origin = run.plane.cell, run.plane.origin

    def pixels(self, points: NDArray) -> NDArray:
        """Pixels (n, 2) of points (n, 2) [m]."""
        offset = (np.asarray(points) - self._centre) * (SIZE / VIEW_M)
        return np.c_[SIZE / 2 + offset @ self._across, SIZE / 2 - offset @ self._up]


def _cells(frame: _Frame, filled: NDArray, colour: str) -> str:
    """Filled cells as one path: runs along the second axis become one quadrilateral each."""
    padded = np.pad(filled.astype(np.int8), ((0, 0), (1, 1)))
    rows, starts = np.nonzero(np.diff(padded, axis=1) == 1)
    _, ends = np.nonzero(np.diff(padded, axis=1) == -1)
    corners = np.stack([np.c_[rows, starts], np.c_[rows + 1, starts], np.c_[rows + 1, ends], np.c_[rows, ends]], axis=1)
    pixels = frame.pixels(frame.origin + frame.cell * corners.reshape(-1, 2)).reshape(-1, 4, 2)
    inside = ((pixels.max(axis=1) > 0) & (pixels.min(axis=1) < SIZE)).all(axis=1)
    quads = "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in quad) + "Z" for quad in np.clip(pixels[inside], -5, SIZE + 5))
    return f'<path d="{quads}" fill="{colour}" shape-rendering="crispEdges"/>'


def _axes(angle: float) -> NDArray:
    """Rows: the hand's directions across and along its fingers, in the plane's y, z."""
    along = np.array([np.cos(angle), np.sin(angle)])
    return np.array([[-along[1], along[0]], along])


def _hand(frame: _Frame, hand: Hand, pose: NDArray, colour: str, opacity: float) -> str:
    """The hand's rectangles at a pose (y, z, angle)."""
    shapes = []
    for _, half, low, high in hand_rectangles(hand):
        corners = np.array([[-half, low], [half, low], [half, high], [-half, high]]) @ _axes(pose[2]) + pose[:2]
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in frame.pixels(corners))
        shapes.append(f'<polygon points="{points}" fill="{colour}" fill-opacity="{opacity}" stroke="{colour}"/>')
    return "".join(shapes)


def _bumps(frame: _Frame, hand: Hand, pose: NDArray) -> str:
    lines = bump_lines(hand, BumpOptions())
    drawn = []
    for (a, b), far in zip(lines.ends, lines.far, strict=True):
        (x1, y1), (x2, y2) = frame.pixels(np.array([a, b]) @ _axes(pose[2]) + pose[:2])
        dash = ' stroke-dasharray="3 3"' if far else ""
        drawn.append(f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" stroke="{css(palette.ORANGE)}" stroke-width="1"{dash}/>')
    return "".join(drawn)


def _path(frame: _Frame, path: NDArray) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in frame.pixels(path[:, :2]))
    return f'<polyline points="{points}" fill="none" stroke="{css(palette.BLUE)}" stroke-width="2.5" stroke-linejoin="round"/>'
