"""How the model is looked at: its colours, a check that is pointed at, and the camera that goes to what is new."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.modelling import derived
from handey_studio.app.state import State
from handey_studio.modeling.patches.patch import Patches
from handey_studio.session.model_look import points_of

AWAY = np.array([0.42, -0.80, 0.72])  # from the front, the side and above
DISTANCES = 2.7  # extents of an object from which one looks at it


@dataclass(frozen=True)
class ColourBy:
    """The readings' colours tell the scan, or their distance from the model."""

    colours: str

    def apply(self, state: State) -> State:
        return replace(state, model=replace(state.model, colours=self.colours))


@dataclass(frozen=True)
class PointAtCheck:
    """The faces of a check are shown in red, and one browser's camera goes there; again: no longer."""

    number: int
    client: int | None

    def run(self, bench: Any) -> State:
        state = bench.state
        number = -1 if state.model.check == self.number else self.number
        state = replace(state, model=replace(state.model, check=number))
        judged = derived.truth(state)
        if judged is not None and 0 <= number < len(judged.findings) and len(judged.findings[number].where):
            look_at(bench, judged.findings[number].where, self.client)
        return state


def turn_to_model(bench: Any) -> None:
    """Cameras go to the solid, or to the largest object of the first scan; they stay where they are while there is neither."""
    shown, patches = derived.built(bench.state), derived.found_patches(bench.state)
    if shown is not None and shown.solid is not None:
        look_at(bench, shown.solid.vertices, None)
    elif patches and patches[0] is not None:
        look_at_object(bench, patches[0])


def look_at_object(bench: Any, found: Patches) -> None:
    """Cameras go to the largest object that a scan shows, down to its support."""
    rings = [ring for number in found.objects[0] for ring in found.patches[number].rings] if found.objects else []
    if rings:
        look_at(bench, np.concatenate([*rings, *(ring * (1.0, 1.0, 0.0) for ring in rings)]), None)


def look_at_scans(bench: Any, state: State) -> None:
    """Cameras go to where they see what all scans show above their supports, where these stand in a state."""
    draft = derived.draft_of(state)
    seen = [points_of(scan, pose) for scan, pose in zip(draft.scans, derived.scan_poses(state), strict=True)] if draft is not None else []
    seen = [points for points in seen if len(points)]
    if seen:
        look_at(bench, np.concatenate([np.percentile(points, (1.0, 99.0), axis=0) for points in seen]), None)


def look_at(bench: Any, points: NDArray, client: int | None) -> None:
    """Cameras go to where they see points (n, 3) [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = (low + high) / 2.0, max(float(np.linalg.norm(high - low)), 0.05)
    bench.look(middle + DISTANCES * size * AWAY / np.linalg.norm(AWAY), middle, client)
