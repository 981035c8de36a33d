"""The configuration space as a second stage behind the arm: joint 1 away from the arm, joint 2 across, joint 3 up (Handey 1987 §4).

The free regions, the one that is used in blue, the others in grey: all around them is forbidden. The arm's way, where it is now, and the
slice of joint 1 that it is in.
"""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.cspace import nearest
from handey_studio.app.scene.units import SCALE, scaled
from handey_studio.app.state import State
from handey_studio.motion import CSpaceSummary
from handey_studio.motion.free_surface import Surface, free_surfaces, shares
from handey_studio.task.plan import Carry

ROOT, LAYER = "/cspace", "configuration space"
CORNER_M = np.array([-1.75, -0.45, 0.0])  # the stage's lowest corner in the world: behind the arm, out of its way
SIDE_M = 0.9
MIDDLE_M = CORNER_M + SIDE_M / 2
CORNERS = np.array(list(np.ndindex(2, 2, 2)))
BOX = np.array([(a, b) for a in CORNERS for b in CORNERS if (b >= a).all() and (b - a).sum() == 1])  # the sides of a unit cube
SAMPLES = 160
NONE = -1
FORBIDDEN = (*palette.VERMILLION, 70)  # of a slice, to be seen through
FACING = (0.5, -0.5, -0.5, 0.5)  # turns a picture so that its right is the second joint's axis and its top the third's


class CSpaceScene:
    """Built once a plan, when it is first looked at; the marker and the slice go with the timeline."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._root: viser.FrameHandle | None = None
        self._marker: viser.IcosphereHandle | None = None
        self._slice: viser.FrameHandle | None = None
        self._picture: viser.ImageHandle | None = None
        self._number = NONE
        self._carry: Carry | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        shown = LAYER not in new.session.view.hidden_layers
        if shown and (self._root is None or self._carry is not new.carry):
            self._build(new)
        if self._root is not None:
            self._root.visible = shown
            self._move(new)

    def _build(self, state: State) -> None:
        self._scene.remove_by_name(ROOT)
        self._root = self._marker = self._slice = None
        self._carry, replay = state.carry, state.replay
        if replay is None or self._carry is None or self._carry.space is None:
            return
        space = self._carry.space
        self._root = self._scene.add_frame(ROOT, show_axes=False, position=tuple(CORNER_M * SCALE))
        for name, surface, colour in zip(("used", "others"), free_surfaces(space), (palette.PALE_SKY, palette.FILLED), strict=True):
            self._volume(name, surface, colour)
        self._lines("box", BOX, palette.GREY, 1.5)
        q = np.array([replay.at(t).q_rad for t in np.linspace(0.0, replay.duration, SAMPLES)])
        self._lines("path", _unbroken(shares(space, q)), palette.ORANGE, 3.0)
        if len(space.path_cells) > 1:
            way = (space.path_cells + 0.5) / np.array(space.blocked.shape)
            self._lines("free_leg", np.stack([way[:-1], way[1:]], axis=1), palette.BLUE, 5.0)
        for text, at in axis_labels(space):
            self._scene.add_label(f"{ROOT}/labels/{text}", text, position=tuple(SIDE_M * SCALE * np.array(at)))
        self._slice = self._scene.add_frame(f"{ROOT}/slice", show_axes=False)
        self._picture, self._number = None, NONE
        self._lines("slice/outline", BOX[(BOX[:, :, 0] == 0).all(axis=1)], palette.VERMILLION, 3.0)
        self._marker = self._scene.add_icosphere(f"{ROOT}/now", radius=0.02 * SCALE, color=palette.ORANGE)

    def _volume(self, name: str, surface: Surface, colour: palette.RGB) -> None:
        corners, triangles = surface
        if len(triangles):
            self._scene.add_mesh_simple(
                f"{ROOT}/{name}", scaled(SIDE_M * corners), triangles, color=colour, opacity=0.45, flat_shading=True, side="double"
            )

    def _lines(self, name: str, points: NDArray, colour: palette.RGB, width: float) -> None:
        self._scene.add_line_segments(f"{ROOT}/{name}", scaled(SIDE_M * points), colors=colour, thickness=width, thickness_units="screen")

    def _move(self, state: State) -> None:
        replay = state.replay
        if replay is None or self._carry is None or self._carry.space is None or self._marker is None or self._slice is None:
            return
        q = replay.at(state.session.view.time_s).q_rad
        here = SIDE_M * SCALE * shares(self._carry.space, q)
        self._marker.position = here
        self._slice.position = (here[0], 0.0, 0.0)
        self._show_slice(self._carry.space, nearest(self._carry.space.centres[0], float(q[self._carry.space.joints[0]])))

    def _show_slice(self, space: CSpaceSummary, number: int) -> None:
        """What is forbidden at the first joint's angle now, dark in the frame that moves along with it; sent once a slice."""
        if number == self._number:
            return
        self._number = number
        image = slice_picture(space.blocked[number])
        if self._picture is not None:
            self._picture.image = image
            return
        side, middle = SIDE_M * SCALE, (0.0, SIDE_M * SCALE / 2, SIDE_M * SCALE / 2)
        self._picture = self._scene.add_image(f"{ROOT}/slice/picture", image, side, side, format="png", wxyz=FACING, position=middle)


def slice_picture(blocked: NDArray) -> NDArray:
    """A slice (n2, n3) as a picture (n3, n2, 4) uint8, the third joint upwards: what is forbidden is tinted, what is free is clear."""
    picture = np.zeros((*blocked.T.shape, 4), np.uint8)
    picture[blocked.T[::-1]] = FORBIDDEN
    return picture


def axis_labels(space: CSpaceSummary) -> list[tuple[str, tuple[float, float, float]]]:
    """What stands at the stage's axes, and where in shares of its sides."""
    places = ((0.5, -0.06, 0.0), (-0.06, 0.5, 0.0), (-0.03, -0.03, 0.5))
    words = []
    for joint, centres, place in zip(space.joints, space.centres, places, strict=True):
        low, high = np.rad2deg([centres[0] - space.step_rad / 2, centres[-1] + space.step_rad / 2])
        words.append((f"joint {joint + 1}: {low:.0f}° to {high:.0f}°", place))
    return words


def _unbroken(points: NDArray) -> NDArray:
    """Segments (k, 2, 3) between successive points (n, 3), without those that jump from one end of a range to the other."""
    segments = np.stack([points[:-1], points[1:]], axis=1)
    return segments[np.abs(segments[:, 1] - segments[:, 0]).max(axis=1) < 0.25]


def _looks(state: State) -> tuple:
    return id(state.replay), state.session.view.time_s, LAYER in state.session.view.hidden_layers
