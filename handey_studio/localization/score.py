"""The score: how probable it is that a pose is right, from what the view shows of it.

A logistic regression over ratios that mean the same for every sensor and part. Its weights were fitted to the candidates, right and
wrong, of simulated piles (`handey bench locate --fit-score`), whose truth is known.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.candidates import Candidate
from handey_studio.localization.search import Search, below_table

INTERCEPT = 2.41
WEIGHTS = {
    "outlines that should be seen are missing": -12.7,  # metres of silhouette a metre of visible edge
    "more outline is missing than is chance": -7.05,  # metres a diameter of the part
    "creases that should be seen are missing": -8.96,  # metres a metre of visible edge
    "the sensor sees through it": -34.0,  # root of the share of the surface
    "its edges lie beside those that are seen": -9.4,  # scatter, in raggednesses of the view's outlines
    "the readings lie off its faces": -2.43,  # rms, in sigmas of a reading
    "its outline is larger than what is seen": -4.0,  # margin, in spreads of what sensors lose at silhouettes
    "too few of its edges are found": 3.12,  # logarithm of their number
    "too little of its surface is seen": 0.9,  # logarithm of square diameters
    "what is found leaves it loose": -0.73,  # logarithm of the loosest point's sigma, in tolerances
    "there are no readings where it should be": -2.3,  # share of the surface
    "it would stand below the table": -0.99,  # sigmas of a reading
}
TYPICAL = np.array([0.0, 0.0, 0.05, 0.0, 0.4, 0.8, 0.2, 1.6, -1.0, -1.3, 0.0, 0.0])  # of right poses


def features(search: Search, candidate: Candidate) -> NDArray:
    """(12,) the numbers that the score weighs, in the order of `WEIGHTS`."""
    v, view, diameter = candidate.verdict, search.view, candidate.part.solid.diameter
    visible = max(float(v.found[0] + v.missing[0]), 1e-9)
    outline, crease = float(v.missing[0] - v.unbent[0]), float(v.unbent[0])
    seen = max(float(v.on[0] + v.through[0] + v.unknown[0]), 1e-12)
    ragged = view.noise + 0.5 * view.outline_error
    return np.array(
        [
            outline / visible,
            outline / diameter,
            crease / visible,
            np.sqrt(v.through[0] / seen),
            min(v.scatter[0] / ragged, 5.0),
            min(candidate.rms / view.noise, 6.0),
            min(abs(candidate.margin - search.weights.margin) / search.weights.margin_spread, 6.0),
            np.log(max(v.edges[0], 0.5)),
            np.log(max(v.on[0], 1e-9) / diameter**2),
            np.log(max(candidate.sigma / (view.noise + view.outline_error), 0.01)),
            v.unknown[0] / seen,
            np.clip((below_table(search, candidate.part, candidate.R, candidate.t) - 2.0 * view.noise) / view.noise, 0.0, 8.0),
        ]
    )


class Score(NamedTuple):
    """`probability` in [0, 1] that a pose is right, and the `doubt`: what speaks most against it."""

    probability: float
    doubt: str


def score(search: Search, candidate: Candidate) -> Score:
    """How probable a candidate is."""
    weights, found = np.array(list(WEIGHTS.values())), features(search, candidate)
    doubt = list(WEIGHTS)[int(np.argmin(weights * (found - TYPICAL)))]
    return Score(float(1.0 / (1.0 + np.exp(-(INTERCEPT + weights @ found)))), doubt)
