"""The corners of a proved path rounded, so that the arm need not stop at them, and the certificate of the rounded way."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from handey_studio.motion.certificate import Mover
from handey_studio.motion.curve import Curve, rounded
from handey_studio.motion.query import certify_runs
from handey_studio.motion.results import Certificate
from handey_studio.motion.shortcut import Route

SHARES = (1.0, 0.6, 0.35, 0.2, 0.1)  # of the way to the middle of the shorter segment, tried in turn as a blend's reach; else the arm stops


def round_corners(route: Route, common: Mover, velocity: NDArray) -> tuple[Curve, Certificate]:
    """The route with each corner rounded as widely as is proved, and the certificate of the whole, with places on the route.

    For a blend between segments of different movers `common` speaks, which allows nothing that one of them forbids. Joints' `velocity`
    [rad/s] sets the curve's parameter.
    """
    points, movers = route.points, route.movers
    spans = (np.abs(np.diff(points, axis=0)) / velocity).max(axis=1)
    speakers = [common, *(a if a is b else common for a, b in pairwise(movers)), common]
    reaches = np.zeros(len(points))
    for k in range(1, len(movers)):
        widest = min(spans[k - 1], spans[k]) / 2.0
        tries = (widest * share for share in SHARES)
        reaches[k] = next((reach for reach in tries if _proved(speakers[k], points[k - 1 : k + 2], reach, velocity)), 0.0)
    curve, places = rounded(points, reaches, velocity), np.concatenate([[0.0], np.cumsum(spans)])
    middles = (curve.ends[1:] + curve.ends[:-1]) / 2.0
    corners = np.abs(middles[:, None] - places).argmin(axis=1)
    blended = np.abs(middles - places[corners]) < reaches[corners]
    segments = np.searchsorted(places, middles) - 1
    owners = [speakers[corner] if blend else movers[segment] for corner, blend, segment in zip(corners, blended, segments, strict=True)]
    return curve, certify_curve(curve, owners, places)


def _proved(speaker: Mover, corner: NDArray, reach: float, velocity: NDArray) -> bool:
    """Whether the blend at the middle one of points (3, joints) is proved to keep the margin."""
    curve = rounded(corner, np.array([0.0, reach, 0.0]), velocity)
    s, slack = curve.chords()
    points = curve.at(s)
    return all(speaker.moves(points[k], points[k + 1], off) for k, off in enumerate(slack) if off.any())


def certify_curve(curve: Curve, movers: list[Mover], places: NDArray) -> Certificate:
    """The certificate of a curve of which `movers` speak piece by piece; `at` counts from one of `places` (n,) [s] to the next."""
    s, slack = curve.chords()
    owner = np.searchsorted(curve.ends, (s[1:] + s[:-1]) / 2.0) - 1
    certificate = certify_runs(curve.at(s), [movers[k] for k in owner], slack)
    chord, share = certificate.at
    here = s[chord] + share * (s[chord + 1] - s[chord])
    segment = int(np.clip(np.searchsorted(places, here, side="right") - 1, 0, len(places) - 2))
    return replace(certificate, at=(segment, float((here - places[segment]) / (places[segment + 1] - places[segment]))))
