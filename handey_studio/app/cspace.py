"""A slice of the configuration space as a picture, at the first arm joint's angle now: the second across, the third up (Handey 1987 §4)."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.app import html, palette
from handey_studio.app.palette import css
from handey_studio.app.pictures.svg import FRAME, picture_uri
from handey_studio.motion import CSpaceSummary

BLOCKED, FREE = palette.FILLED, (251, 252, 253)


def slice_html(space: CSpaceSummary, q: NDArray) -> str:
    """The slice nearest to the first arm joint of a configuration (n,) [rad], with its legend."""
    number = nearest(space.centres[0], float(q[space.joints[0]]))
    chips = ((BLOCKED, "not wholly free"), (palette.BLUE, "free leg (all slices)"), (palette.ORANGE, "the arm now"))
    first, second, third = (joint + 1 for joint in space.joints)
    words = f"Slice {number + 1} of {len(space.centres[0])}, joint {first} at {np.rad2deg(space.centres[0][number]):.0f}°. "
    words += f"Across: joint {second}, up: joint {third}. "
    words += f"{np.rad2deg(space.step_rad):.1f}° cells, {100 * space.blocked.mean():.0f} % not wholly free, {space.regions} free regions. "
    words += "Key 7 shows all slices at once."
    return html.figure(slice_svg(space, q, number), chips, words)


def slice_svg(space: CSpaceSummary, q: NDArray, number: int) -> str:
    """Cell (j, k) of the second and third arm joint fills the unit square at x = j and, upwards, y = k."""
    blocked = space.blocked[number]
    columns, rows = blocked.shape
    image = np.where(blocked.T[::-1, :, None], np.array(BLOCKED), np.array(FREE)).astype(np.uint8)
    across = np.interp(q[space.joints[1]], space.centres[1], np.arange(columns)) + 0.5
    up = rows - np.interp(q[space.joints[2]], space.centres[2], np.arange(rows)) - 0.5
    path = " ".join(f"{j + 0.5:.1f},{rows - k - 0.5:.1f}" for _, j, k in space.path_cells)
    here = "".join(
        f'<rect x="{j}" y="{rows - 1 - k}" width="1" height="1" fill="{css(palette.BLUE)}"/>' for i, j, k in space.path_cells if i == number
    )
    return (
        f'<svg data-testid="cspace" viewBox="0 0 {columns} {rows}" style="{FRAME}" role="img" aria-label="Configuration space slice">'
        f'<image href="{picture_uri(np.ascontiguousarray(image))}" width="{columns}" height="{rows}" style="image-rendering:pixelated"/>'
        f'<polyline points="{path}" fill="none" stroke="{css(palette.BLUE)}" stroke-width="0.7"/>{here}'
        f'<circle cx="{across:.2f}" cy="{up:.2f}" r="1.4" fill="{css(palette.ORANGE)}" stroke="#fff" stroke-width="0.4"/></svg>'
    )


def nearest(centres: NDArray, angle: float) -> int:
    """Number of the cell whose centre is nearest to an angle [rad], whole turns apart counting as the same."""
    return int(np.argmin(np.abs(np.angle(np.exp(1j * (centres - angle))) + 1e-6 * np.abs(centres - angle))))
