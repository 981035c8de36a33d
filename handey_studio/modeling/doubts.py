"""What speaks against a model that is a sound part all the same: readings that it does not explain, and light that went through it."""

from collections.abc import Sequence

import numpy as np

from handey_studio.base import measured
from handey_studio.modeling.truth_values import Check, ScanTruth

DOUBTS = UNEXPLAINED, SEEN_THROUGH = "explained", "seen through"
LEAST_EXPLAINED = 0.85  # of the readings: as much as a suggestion must explain
MOST_SEEN_THROUGH = 0.06  # of the model's image in one scan: as a suggestion may be
LEAST_READINGS = 50
OFF_SIGMAS = 3.0
MOST_SHOWN = 2000


def doubts(scans: Sequence[ScanTruth], explained: float) -> tuple[Check, ...]:
    """Checks that failed against the scans, `explained` being the share of all readings that lie on the model; none where all is well."""
    told = [_seen_through(scan) for scan in scans if scan.seen_through > MOST_SEEN_THROUGH]
    if sum(len(scan.distances) for scan in scans) >= LEAST_READINGS and explained < LEAST_EXPLAINED:
        told.insert(0, _unexplained(scans, explained))
    return tuple(told)


def _unexplained(scans: Sequence[ScanTruth], explained: float) -> Check:
    """The face that most of the readings off the model lie at, and how far they are off it."""
    distances, faces, points = (np.concatenate([getattr(scan, key) for scan in scans]) for key in ("distances", "faces", "points"))
    noise = np.concatenate([np.full(len(scan.distances), scan.noise) for scan in scans])
    off = np.abs(distances) > OFF_SIGMAS * noise
    face = int(np.bincount(faces[off]).argmax()) if off.any() else -1
    there = off & (faces == face)
    sentence = f"Only {100 * explained:.0f} % of the readings lie on the model"
    if face < 0:
        return Check(UNEXPLAINED, False, f"{sentence}.", "Take another scan, or model anew.")
    median = float(np.median(distances[there]))
    where = "in front of" if median > 0 else "behind"
    fix = "Move it outward, or join what is missing there" if median > 0 else "Move it inward, or cut away what is not there"
    sentence += f"; most of the others are {measured(abs(median), 'm')} {where} face {face}."
    return Check(UNEXPLAINED, False, sentence, f"{fix}, unless another object stands there.", (face,), _some(points[there]))


def _seen_through(scan: ScanTruth) -> Check:
    sentence = (
        f"{scan.name[:1].upper()}{scan.name[1:]} saw through {100 * scan.seen_through:.0f} % of the model, up to "
        f"{measured(scan.seen_through_m, 'm')} deep; the limit is {100 * MOST_SEEN_THROUGH:.0f} %."
    )
    return Check(SEEN_THROUGH, False, sentence, "Cut away what is not there, or move a face inward.", (), _some(scan.through_points))


def _some(points: np.ndarray) -> np.ndarray:
    return points[:: max(1, len(points) // MOST_SHOWN)]
