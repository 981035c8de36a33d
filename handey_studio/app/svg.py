"""The grasp plane as a picture: its filled cells, the bump lines, the hand and its way in."""

import base64

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import FILLED, css
from handey_studio.grasping import BumpOptions, BumpRun, bump_lines
from handey_studio.grasping.bump_lines import hand_rectangles
from handey_studio.world import Hand

SIZE = 300
VIEW_M = 0.32  # how much of the plane is shown, up and across
FRAME = "width:100%;display:block;background:#fbfcfd;border:1px solid #dde2e8;border-radius:6px"


def grasp_plane_html(run: BumpRun, hand: Hand, at: int) -> str:
    """The picture with its legend and what became of the approach; the hand is at point `at` of its path."""
    chips = (
        (FILLED, "filled for the fingers"),
        (palette.PALE, "for the crosspiece"),
        (palette.TEAL, "hand"),
        (palette.BLUE, "its path"),
        (palette.ORANGE, "bump lines"),
    )
    words = f"Approach: {run.status}, {len(run.path) - 1} steps, {html.millimetres(run.distance, 1)} from the grasp point."
    return html.figure(grasp_plane_svg(run, hand, at), chips, words)


def grasp_plane_svg(run: BumpRun, hand: Hand, at: int = -1) -> str:
    """Cells filled for the fingers (dark) and the crosspiece (light), the hand at the start and at point `at`, its bump lines, the path.

    World up is up in the picture as far as the plane allows.
    """
    frame = _Frame(run)
    goal = frame.pixels(run.goal[None])[0]
    parts = [
        _cells(frame, run),
        _hand(frame, hand, run.path[0], css(palette.GREY), 0.2),
        _path(frame, run.path),
        _hand(frame, hand, run.path[at], css(palette.TEAL), 0.55),
        _bumps(frame, hand, run.path[at]),
        f'<circle cx="{goal[0]:.1f}" cy="{goal[1]:.1f}" r="4" fill="{css(palette.VERMILLION)}"/>',
    ]
    head = f'<svg data-testid="grasp-plane" viewBox="0 0 {SIZE} {SIZE}" style="{FRAME}" role="img" aria-label="Grasp plane">'
    return f"{head}{''.join(parts)}</svg>"


def picture_uri(picture: NDArray) -> str:
    """A data URI of an image (h, w, 3 or 4) uint8, red first."""
    order = cv2.COLOR_RGBA2BGRA if picture.shape[2] == 4 else cv2.COLOR_RGB2BGR
    done, data = cv2.imencode(".png", cv2.cvtColor(picture, order))
    return "data:image/png;base64," + base64.b64encode(data.tobytes() if done else b"").decode("ascii")


class _Frame:
    """From the plane's y, z [m] to pixels, turned so that world up points up."""

    def __init__(self, run: BumpRun) -> None:
        up = run.plane.T_world_plane[2, 1:3]
        length = float(np.linalg.norm(up))
        self._up = up / length if length > 1e-6 else np.array([0.0, 1.0])
        self._across = np.array([self._up[1], -self._up[0]])
        self._centre = (run.path[-1, :2] + run.path[0, :2]) / 2.0

    def pixels(self, points: NDArray) -> NDArray:
        """Pixels (n, 2) of points (n, 2) [m]."""
        offset = (np.asarray(points) - self._centre) * (SIZE / VIEW_M)
        return np.c_[SIZE / 2 + offset @ self._across, SIZE / 2 - offset @ self._up]


def _cells(frame: _Frame, run: BumpRun) -> str:
    """Both grids as one image with a pixel a cell, laid into the picture by an affine map."""
    plane = run.plane
    image = np.zeros((*plane.fingers.shape, 4), dtype=np.uint8)
    image[plane.crosspiece] = (*palette.PALE, 255)
    image[plane.fingers] = (*FILLED, 255)
    corners = plane.origin + plane.cell * np.array([[0, 0], [1, 0], [0, 1]])  # cell (i, k) is row i, column k of the image
    (ox, oy), (ix, iy), (kx, ky) = frame.pixels(corners)
    matrix = " ".join(f"{number:.5f}" for number in (kx - ox, ky - oy, ix - ox, iy - oy, ox, oy))
    rows, columns = plane.fingers.shape
    style = 'style="image-rendering:pixelated"'
    return f'<image href="{picture_uri(image)}" width="{columns}" height="{rows}" transform="matrix({matrix})" {style}/>'


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
    """The near bump lines solid, the far ones dashed."""
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
