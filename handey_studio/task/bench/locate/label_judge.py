"""Judging poses in a real scene that is labelled but whose poses nobody knows: does the part, drawn at its pose, look like the label?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, binary_fill_holes

from handey_studio.base import Value, frozen_array
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.camera import DepthCamera, look_exactly
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.task.bench.locate.judgement import Instance, Verdict
from handey_studio.world.part import Part

LEAST_IOU = 0.75
MOST_OUTLINE_MM = 6.0
MOST_MEDIAN_MM = 6.0
MOST_P90_MM = 10.0
MOST_SEEN_THROUGH = 0.12
HIDING_MM = 12.0  # a reading this much nearer than the part hides it: five standard deviations of a depth camera at 1 m
SEEN_THROUGH_MM = 15.0  # a reading this much farther has seen through it


@dataclass(frozen=True, eq=False)
class Labelled(Value):
    """An object of a labelled image: `mask` (H, W) of the pixels that show it."""

    part: str
    mask: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "mask", frozen_array(self.mask, bool))


@dataclass(frozen=True, eq=False)
class LabelJudge(Value):
    """A pose is right if the part drawn there covers the label (IoU at least 0.75), its outline lies within 6 mm on the mean, the readings
    lie on it (median 6 mm, 90 % within 10 mm) and at most 12 % of it was seen through. `strict` asks for the same."""

    view: DepthView
    objects: tuple[Labelled, ...]
    parts: dict[str, Part]

    def instances(self, part: str) -> tuple[Instance, ...]:
        """The labelled objects that are such a part."""
        return tuple(Instance(None, int(found.mask.sum())) for found in self.objects if found.part == part)

    def verdicts(self, part: str, Ts_sensor_part: Sequence[NDArray]) -> tuple[Verdict, ...]:
        """Each pose against the label that it covers best among those that no earlier pose has found."""
        free = dict(enumerate(found for found in self.objects if found.part == part))
        verdicts = []
        for T in Ts_sensor_part:
            drawn = self._drawn(part, T)
            looks = {number: measures(drawn, self.view, found.mask) for number, found in free.items()}
            best = max(looks, key=lambda number: looks[number]["iou"], default=None)
            right = best is not None and passes(looks[best])
            if best is not None and right:
                del free[best]
            verdicts.append(Verdict(right, right, best if right else None, measures={} if best is None else looks[best]))
        return tuple(verdicts)

    def _drawn(self, part: str, T_sensor_part: NDArray) -> NDArray:
        """Depth (H, W) [m] of the part alone at a pose, NaN beside it."""
        if not isinstance(self.view.projection, Pinhole):
            raise TypeError("labelled images come from pinhole cameras")
        camera = DepthCamera(self.view.projection, (self.view.depth.shape[0], self.view.depth.shape[1]), np.eye(4))
        return look_exactly(camera, [SolidBody(part, self.parts[part].solid, _rigid(T_sensor_part))]).depth


def measures(drawn: NDArray, view: DepthView, mask: NDArray) -> dict[str, float]:
    """How a part drawn as depth (H, W) [m] compares with readings and a label's mask (H, W). Pixels without a reading say nothing; what
    cannot be measured is left out."""
    read = np.isfinite(view.depth)
    with np.errstate(invalid="ignore"):
        away_mm = 1e3 * (view.depth - drawn)  # of the reading beyond the part
        shown = read & np.isfinite(drawn) & ~(away_mm < -HIDING_MM)
    label = mask & read
    on = np.abs(away_mm[label & np.isfinite(drawn)])
    told = {
        "iou": float((shown & label).sum() / max((shown | label).sum(), 1)),
        "outline_mm": _outline_mm(shown, label, view),
        "median_mm": float(np.median(on)) if len(on) else np.inf,
        "p90_mm": float(np.percentile(on, 90)) if len(on) else np.inf,
        "seen_through": float((away_mm[read & np.isfinite(drawn)] > SEEN_THROUGH_MM).mean()) if shown.any() else 1.0,
    }
    return {key: value for key, value in told.items() if np.isfinite(value)}


def passes(look: dict[str, float]) -> bool:
    """Whether nothing in the image contradicts the pose."""
    limits = {"outline_mm": MOST_OUTLINE_MM, "median_mm": MOST_MEDIAN_MM, "p90_mm": MOST_P90_MM, "seen_through": MOST_SEEN_THROUGH}
    return look["iou"] >= LEAST_IOU and all(look.get(key, np.inf) <= limit for key, limit in limits.items())


def _outline_mm(shown: NDArray, label: NDArray, view: DepthView) -> float:
    """Mean distance between two outlines in mm: the area between them over the label's outline."""
    inside = np.asarray(binary_erosion(np.asarray(binary_fill_holes(label)), border_value=1), dtype=bool)
    rim = label & ~inside
    if not rim.any():
        return np.inf
    pixels_per_metre = float(np.mean(view.projection.pixels_per_metre(float(np.median(view.depth[label])))))
    return float(1e3 * (shown ^ label).sum() / rim.sum() / pixels_per_metre)


def _rigid(T: NDArray) -> NDArray:
    """The nearest rigid transform: other programs round."""
    u, _, v = np.linalg.svd(T[:3, :3])
    return transform(u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v, T[:3, 3])
