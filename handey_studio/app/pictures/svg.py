"""What pictures of the grasp are drawn with: pieces of SVG, and a grasp plane turned so that world up points up."""

import base64

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import RGB, css

FRAME = "width:100%;display:block;background:#fbfcfd;border:1px solid #dde2e8;border-radius:6px"
LEVEL = 0.2  # a plane whose steepest direction rises by less lies flat: it is seen as it is, from its own x


class PlaneView:
    """From a grasp plane's y, z [m] to pixels of a square picture, `metres` wide and `size` pixels, with `centre` (y, z) in the middle."""

    def __init__(self, T_world_plane: NDArray, centre: ArrayLike, metres: float, size: float) -> None:
        up = T_world_plane[2, 1:3]
        length = float(np.linalg.norm(up))
        self.level = length < LEVEL
        self._up = np.array([0.0, 1.0]) if self.level else up / length
        self._across = np.array([self._up[1], -self._up[0]])
        self._centre, self._scale, self._middle = np.asarray(centre, dtype=float), size / metres, size / 2.0

    def pixels(self, points: ArrayLike) -> NDArray:
        """Pixels (n, 2) of points (n, 2) [m]."""
        return self._middle + self.directions(np.asarray(points) - self._centre) * self._scale

    def directions(self, vectors: ArrayLike) -> NDArray:
        """Vectors (n, 2) of the plane as they point in the picture, y down, as long as they were."""
        vectors = np.asarray(vectors)
        return np.stack([vectors @ self._across, -(vectors @ self._up)], axis=-1)


def svg(testid: str, label: str, width: float, height: float, *parts: str, style: str = FRAME, more: str = "") -> str:
    """A picture `width` × `height` units large, as wide as its pane."""
    head = f'data-testid="{html.esc(testid)}" viewBox="0 0 {width:g} {height:g}" style="{style}" role="img" aria-label="{html.esc(label)}"'
    return f"<svg {head} {more}>{''.join(parts)}</svg>"


def polygon(points: NDArray, fill: RGB, opacity: float = 1.0, stroke: RGB | None = None, width: float = 1.0) -> str:
    """A filled outline through pixels (n, 2)."""
    line = f' stroke="{css(stroke)}" stroke-width="{width:g}" stroke-linejoin="round"' if stroke is not None else ""
    return f'<polygon points="{listed(points)}" fill="{css(fill)}" fill-opacity="{opacity:g}"{line}/>'


def polyline(points: NDArray, colour: RGB, width: float = 1.0, dash: str = "", opacity: float = 1.0) -> str:
    """A line through pixels (n, 2)."""
    look = f'stroke="{css(colour)}" stroke-width="{width:g}" stroke-opacity="{opacity:g}"'
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<polyline points="{listed(points)}" fill="none" {look}{dashed} stroke-linejoin="round" stroke-linecap="round"/>'


def arrow(tail: NDArray, tip: NDArray, colour: RGB, width: float = 1.5) -> str:
    """An arrow between two pixels (2,); nothing if it is too short to have a direction."""
    along = np.asarray(tip) - tail
    length = float(np.linalg.norm(along))
    if length < 1.0:
        return ""
    along = along / length
    size = min(3.0 * width, 0.7 * length)
    side = 0.5 * size * np.array([-along[1], along[0]])
    root = tip - size * along
    return polyline(np.array([tail, root]), colour, width) + polygon(np.array([tip, root + side, root - side]), colour)


def circle(at: NDArray, radius: float, fill: RGB | None, stroke: RGB | None = None, width: float = 1.0, dash: str = "") -> str:
    line = f' stroke="{css(stroke)}" stroke-width="{width:g}"' if stroke is not None else ""
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="{radius:g}" fill="{css(fill) if fill is not None else "none"}"{line}{dashed}/>'


def words(at: ArrayLike, text: str, size: float = 10.0, anchor: str = "middle", colour: RGB = palette.ARM_DARK, weight: int = 400) -> str:
    """Text that starts at, ends at or stands around a pixel (2,)."""
    x, y = np.asarray(at, dtype=float)
    look = f'font-size="{size:g}" font-weight="{weight}" text-anchor="{anchor}" fill="{css(colour)}"'
    return f'<text x="{x:.1f}" y="{y:.1f}" {look} font-family="inherit">{html.esc(text)}</text>'


def listed(points: NDArray) -> str:
    """Pixels (n, 2) as an attribute."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def picture_uri(picture: NDArray) -> str:
    """A data URI of an image (h, w, 3 or 4) uint8, red first."""
    order = cv2.COLOR_RGBA2BGRA if picture.shape[2] == 4 else cv2.COLOR_RGB2BGR
    done, data = cv2.imencode(".png", cv2.cvtColor(picture, order))
    return "data:image/png;base64," + base64.b64encode(data.tobytes() if done else b"").decode("ascii")
