"""The ruler in the scene: its spots, the line between them and its length."""

import numpy as np
import viser

from handey_studio.app import palette
from handey_studio.app.scene.units import scaled
from handey_studio.app.state import State

ROOT = "/ruler"
SPOT_M = 0.003


class RulerScene:
    """Drawn anew when a spot was clicked."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene

    def render(self, old: State | None, new: State) -> None:
        if old is not None and old.ruler is new.ruler and old.modelling == new.modelling:
            return
        self._scene.remove_by_name(ROOT)
        spots = () if new.modelling else new.ruler or ()
        if not spots:
            return
        self._scene.add_frame(ROOT, show_axes=False)
        for number, spot in enumerate(spots):
            radius = float(scaled(SPOT_M))
            self._scene.add_icosphere(f"{ROOT}/{number}", radius=radius, color=palette.JUMP, position=scaled(spot))
        if len(spots) == 2:
            line, length = np.array([spots]), 1e3 * float(np.linalg.norm(spots[1] - spots[0]))
            self._scene.add_line_segments(f"{ROOT}/line", scaled(line), colors=palette.JUMP, thickness=3.0, thickness_units="screen")
            self._scene.add_label(f"{ROOT}/length", f"{length:.1f} mm", position=scaled(line.mean(axis=(0, 1))), font_screen_scale=0.9)
