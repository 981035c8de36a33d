"""The score: how probable it is that a pose is right, from what the view shows of it.

A logistic regression over ratios that mean the same for every sensor and part. Its weights were fitted to the candidates, right and
wrong, of simulated piles (`handey bench locate --fit-score`), whose truth is known.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.search import Search
from handey_studio.localization.verify import Verdict
from handey_studio.world.part import Part

INTERCEPT = 2.41
WEIGHTS = {
    "outlines that should be seen are missing": -12.7,  # metres of silhouette a metre of visible edge
    "more outline is missing than is chance": -7.05,  # metres a diameter of the part
    "creases that should be seen are missing": -8.96,  # metres a metre of visible edge
    "the sensor sees through it": -34.0,  # root of the share of the surface
    "its edges lie beside those that are seen": -9.4,  # scatter, in raggednesses of the view's outlines
    "one of its faces lies beside the readings": -3.1,  # in standard errors of the view
    "the readings lie off its faces": -2.43,  # rms, in sigmas of a reading
    "its outline is larger than what is seen": -4.0,  # margin, in spreads of what sensors lose at silhouettes
    "too few of its edges are found": 3.12,  # logarithm of their number
    "too little of its surface is seen": 0.9,  # logarithm of square diameters
    "what is found leaves it loose": -0.73,  # logarithm of the loosest point's sigma, in tolerances
    "there are no readings where it should be": -2.3,  # share of the surface
    "it would stand below the table": -0.99,  # sigmas of a reading
    "it does not rest on the table": 0.0,  # 1 if three corners do
}
FREE_THROUGH = 0.01  # of the surface may be seen through by chance
TYPICAL = np.array([0.0, 0.0, 0.05, 0.0, 0.4, 0.1, 0.8, 0.2, 1.6, -1.0, -1.3, 0.0, 0.0, 1.0])  # of right poses


class Rated(NamedTuple):
    """Poses (n,) of one part as the score looks at them: their `verdict`, the `margin` [m] and `rms` [m] of their refinement, the
    `sigma` [m] of their loosest points, how far [m] they reach `below` the table, and whether three corners `rest` on it."""

    verdict: Verdict
    margin: NDArray
    rms: NDArray
    sigma: NDArray
    below: NDArray
    rest: NDArray

    def rows(self, chosen: NDArray) -> "Rated":
        """Some of the poses, by their numbers."""
        return Rated(self.verdict.rows(chosen), *(array[chosen] for array in self[1:]))


def features(search: Search, part: Part, rated: Rated) -> NDArray:
    """(n, k) the numbers that the score weighs, in the order of `WEIGHTS`."""
    v, view, diameter = rated.verdict, search.view, part.solid.diameter
    visible = np.maximum(v.found + v.missing, 1e-9)
    outline = v.missing - v.unbent
    seen = np.maximum(v.on + v.through + v.unknown, 1e-12)
    return np.stack(
        [
            outline / visible,
            outline / diameter,
            v.unbent / visible,
            np.sqrt(np.maximum(v.through / seen - FREE_THROUGH, 0.0)),
            np.minimum(v.scatter / (view.noise + 0.5 * view.outline_error), 5.0),
            np.minimum(v.lifted / (view.noise + 0.1 * view.outline_error), 5.0),
            np.minimum(rated.rms / view.noise, 6.0),
            np.minimum(np.abs(rated.margin - search.weights.margin) / search.weights.margin_spread, 6.0),
            np.log(np.maximum(v.edges, 0.5)),
            np.log(np.maximum(v.on, 1e-9) / diameter**2),
            np.log(np.maximum(rated.sigma / (view.noise + view.outline_error), 0.01)),
            v.unknown / seen,
            np.clip(rated.below / view.noise - 2.0, 0.0, 8.0),
            rated.rest,
        ],
        axis=1,
    )


class Score(NamedTuple):
    """`probability` in [0, 1] that a pose is right, and the `doubt`: what speaks most against it."""

    probability: float
    doubt: str


def scores(search: Search, part: Part, rated: Rated) -> list[Score]:
    """How probable each pose is."""
    weights, found = np.array(list(WEIGHTS.values())), features(search, part, rated)
    doubts = np.argmin(weights * (found - TYPICAL), axis=1)
    probability = 1.0 / (1.0 + np.exp(-(INTERCEPT + found @ weights)))
    return [Score(float(p), list(WEIGHTS)[doubt]) for p, doubt in zip(probability, doubts, strict=True)]
