"""The score: how probable it is that a pose is right, from what the view shows of it.

A logistic regression over a few ratios that mean the same for every sensor and part.
"""

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.candidates import Candidate
from handey_studio.localization.search import Search

FEATURES = ("edges missing", "edges found", "seen through", "unread", "visible", "loose", "off its faces")
INTERCEPT = 4.0
COEFFICIENTS = np.array([-9.0, 1.0, -20.0, -4.0, 1.0, -1.0, -0.5])


def features(search: Search, candidate: Candidate) -> NDArray:
    """(k,) the numbers that the score weighs, in the order of `FEATURES`."""
    v, diameter = candidate.verdict, candidate.part.solid.diameter
    found, missing = float(v.found[0]), float(v.missing[0])
    on, through, unknown = float(v.on[0]), float(v.through[0]), float(v.unknown[0])
    seen = max(on + through + unknown, 1e-12)
    return np.array(
        [
            missing / max(found + missing, 1e-9),
            np.log(max(found / diameter, 1e-2)),
            through / seen,
            unknown / seen,
            np.log(max(float(v.visible_fraction[0]), 1e-2)),
            np.log(max(candidate.sigma / (search.view.noise + search.view.outline_error), 1e-2)),
            candidate.rms / search.view.noise,
        ]
    )


def score(search: Search, candidate: Candidate) -> float:
    """Probability in [0, 1] that the pose is right."""
    return float(1.0 / (1.0 + np.exp(-(INTERCEPT + features(search, candidate) @ COEFFICIENTS))))
