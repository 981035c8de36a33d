"""The scans as coloured points, and the outlines of the planar faces that they show."""

from collections.abc import Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.look import BY_DISTANCE
from handey_studio.app.palette import residual_colours
from handey_studio.app.scene.units import scaled
from handey_studio.app.state import State
from handey_studio.geometry.transforms import apply
from handey_studio.modeling.patches.patch import Patches
from handey_studio.modeling.scans import Scan
from handey_studio.session.model_look import ground_of, points_of, spacing_of

ROOT = "/model/scans"
MAX_POINTS = 40_000
POINT_SHARE = 0.8  # of the readings' spacing
SCAN_COLOURS: tuple[palette.RGB, ...] = ((96, 122, 152), (204, 121, 64), (86, 150, 110), (150, 110, 170))
RIM: palette.RGB = (30, 60, 90)


class ScanScene:
    """One cloud and one set of outlines a scan, at the pose where it is shown; with distances, the readings are coloured by these."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        self._scene.remove_by_name(ROOT)
        draft = derived.draft_of(new)
        if draft is None:
            return
        if new.model.trial is not None:
            self._add_trial(new.model.trial)
            return
        judged = derived.truth(new) if new.model.colours == BY_DISTANCE else None
        poses, patches = derived.scan_poses(new), derived.found_patches(new)
        for number, (scan, pose) in enumerate(zip(draft.scans, poses, strict=True)):
            colour = SCAN_COLOURS[number % len(SCAN_COLOURS)]
            if judged is None:
                self._add_points(f"{ROOT}/{number}/points", points_of(scan, pose), np.array(colour, dtype=np.uint8), spacing_of(scan))
            if number == 0:
                self._add_points(f"{ROOT}/ground", ground_of(scan), np.array(palette.PALE, dtype=np.uint8), spacing_of(scan))
            self._add_outlines(f"{ROOT}/{number}/outlines", patches[number], pose)
        if judged is not None:
            limit = distance_limit([told.noise for told in judged.scans])
            spacing = {scan.name: spacing_of(scan) for scan in draft.scans}
            for number, told in enumerate(judged.scans):
                colours = residual_colours(told.distances / limit)
                self._add_points(f"{ROOT}/{number}/distances", told.points, colours, spacing[told.name])

    def _add_trial(self, scan: Scan) -> None:
        """The scan in which the model is looked for, alone."""
        colour, ground = (np.array(c, dtype=np.uint8) for c in (SCAN_COLOURS[0], palette.PALE))
        self._add_points(f"{ROOT}/trial", points_of(scan, np.eye(4)), colour, spacing_of(scan))
        self._add_points(f"{ROOT}/trial_ground", ground_of(scan), ground, spacing_of(scan))

    def _add_points(self, name: str, points: NDArray, colours: NDArray, spacing: float) -> None:
        step = max(1, len(points) // MAX_POINTS)
        thinned = colours if colours.ndim == 1 else colours[::step]
        size = float(scaled(POINT_SHARE * spacing * np.sqrt(step)))
        self._scene.add_point_cloud(
            name, scaled(points[::step]), thinned, point_size=size, point_shape="circle", precision="float32", point_shading="flat"
        )

    def _add_outlines(self, name: str, found: Patches | None, T_model_scan: NDArray) -> None:
        sides = outline_sides(found, T_model_scan)
        if len(sides):
            self._scene.add_line_segments(name, scaled(sides), colors=RIM, thickness=2.0, thickness_units="screen")


def outline_sides(found: Patches | None, T_model_scan: NDArray) -> NDArray:
    """Sides (n, 2, 3) [m] of all outlines in the model's frame."""
    rings = [apply(T_model_scan, ring) for patch in found.patches for ring in patch.rings] if found is not None else []
    sides = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings]
    return np.concatenate(sides) if sides else np.empty((0, 2, 3))


def distance_limit(noises: Sequence[float]) -> float:
    """The distance [m] at which the colours of residuals end: three times the readings' noise, at least a millimetre."""
    return max(1e-3, 3.0 * max(noises, default=0.0))


def _looks(state: State) -> tuple:
    draft = derived.draft_of(state)
    poses = tuple(pose.tobytes() for pose in derived.scan_poses(state))
    by_distance = id(derived.truth(state)) if state.model.colours == BY_DISTANCE else 0
    scans = id(draft.scans) if draft is not None else 0
    return state.loads, scans, poses, id(state.model.patches), by_distance, id(state.model.trial)
