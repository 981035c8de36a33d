"""The workcell's furniture: floor, table, fixed blocks, the outline of what the range finder scans, light."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.palette import RGB
from handey_studio.app.scene.units import SCALE, place, scaled
from handey_studio.app.state import State
from handey_studio.cell import Workcell
from handey_studio.geometry.transforms import apply
from handey_studio.sensing.stripes.range_finder import RangeFinder

TABLE_M = (1.3, 1.3, 0.03)
TABLE_AT_M = (0.25, 0.0)
LIGHT: tuple[RGB, RGB] = ((247, 249, 251), (219, 225, 232))  # behind everything, top and bottom
DARK: tuple[RGB, RGB] = ((62, 70, 80), (30, 34, 40))


class WorkcellScene:
    """Drawn anew when the workcell changes, which is when a session is opened."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._blocks: list[viser.BoxHandle] = []
        self._root = server.scene.add_frame("/workcell", show_axes=False)
        _light(server)

    def render(self, old: State | None, new: State) -> None:
        self._root.visible = not new.modelling
        if old is None or old.dark != new.dark:
            self._server.scene.set_background_image(_backdrop(*(DARK if new.dark else LIGHT)), format="png")
        if old is not None and old.session.workcell is new.session.workcell:
            return
        scene, workcell = self._server.scene, new.session.workcell
        _table(scene, workcell.table_z)
        _scan_outline(scene, workcell)
        _range_finder(scene, workcell.finder)
        for handle in self._blocks:
            handle.remove()
        self._blocks = []
        for number, block in enumerate(workcell.blocks):
            x, y, z = (float(side) for side in block.size * SCALE)
            handle = scene.add_box(f"/workcell/blocks/{number}", color=palette.BLOCK, dimensions=(x, y, z))
            place(handle, block.T_world_block)
            self._blocks.append(handle)


def _light(server: viser.ViserServer) -> None:
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/light/sky", sky_color=(255, 255, 255), ground_color=(196, 202, 210), intensity=1.15)
    scene.add_light_directional("/light/key", color=(255, 250, 242), intensity=1.5, position=(9.0, -7.0, 16.0), cast_shadow=False)
    scene.add_light_directional("/light/fill", color=(226, 236, 255), intensity=0.5, position=(-8.0, 9.0, 8.0), cast_shadow=False)


def _backdrop(top: RGB, bottom: RGB) -> np.ndarray:
    """A quiet vertical gradient."""
    share = np.linspace(0.0, 1.0, 256)[:, None, None]
    return np.broadcast_to((1.0 - share) * np.array(top) + share * np.array(bottom), (256, 8, 3)).astype(np.uint8)


def _table(scene: viser.SceneApi, table_z: float) -> None:
    depth = TABLE_M[2] * SCALE
    x, y = TABLE_AT_M[0] * SCALE, TABLE_AT_M[1] * SCALE
    size = (TABLE_M[0] * SCALE, TABLE_M[1] * SCALE, depth)
    scene.add_box("/workcell/table", color=palette.TABLE, dimensions=size, position=(x, y, table_z * SCALE - depth / 2 - 0.01))
    scene.add_grid(
        "/workcell/grid",
        width=size[0],
        height=size[1],
        cell_size=1.0,
        section_size=5.0,
        cell_color=(222, 220, 214),
        section_color=(204, 202, 196),
        cell_thickness=1.0,
        section_thickness=1.2,
        position=(x, y, table_z * SCALE),
    )


def _range_finder(scene: viser.SceneApi, finder: RangeFinder) -> None:
    """The laser with the edges of the light that it sweeps, and the cameras on either side of it."""
    laser = apply(finder.T_world_range, finder.laser)
    x, y, z = (float(value) for value in laser * SCALE)
    scene.add_box("/workcell/finder/laser", color=palette.BLUE, dimensions=(0.5, 0.5, 0.3), position=(x, y, z))
    rays = np.array([[laser, corner] for corner in _scan_corners(finder)])
    scene.add_line_segments("/workcell/finder/light", scaled(rays), colors=palette.LIGHT, thickness=1.0, thickness_units="screen")
    for number, camera in enumerate(finder.cameras):
        pinhole = camera.projection
        view = scene.add_camera_frustum(
            f"/workcell/finder/camera{number}",
            fov=float(2 * np.arctan(camera.height / 2 / pinhole.fy)),
            aspect=camera.width / camera.height,
            scale=0.6,
            color=palette.BLUE,
        )
        place(view, finder.T_world_range @ camera.T_range_camera)


def _scan_corners(finder: RangeFinder) -> NDArray:
    """Corners (4, 3) [m] of the scanned rectangle in the world."""
    x, y = finder.area
    return apply(finder.T_world_range, np.array([[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0]], dtype=float))


def _scan_outline(scene: viser.SceneApi, workcell: Workcell) -> None:
    """The rectangle on the table that the range finder scans."""
    corners = _scan_corners(workcell.finder) + np.array([0, 0, 0.0015])
    sides = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    scene.add_line_segments("/workcell/scan_area", scaled(sides), colors=palette.BLUE, thickness=2.0, thickness_units="screen")
