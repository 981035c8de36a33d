"""The score: how probable it is that a pose is right, from what the view shows of it.

A logistic regression over ratios that mean the same for every part. Its weights stand in `score.toml`; `handey fit score` fits them
to the candidates, right and wrong, of simulated piles seen by a fine sensor (0.5 mm of noise), whose truth is known. Where a sensor's
noise hides the small differences between look-alikes, and models are no truer than it (cartons before a Kinect), such weights ask for
too much: there the score goes by how far edges and surfaces agree, as many cells hold few parts of one size. Between the two it changes
over gradually.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.search import Search
from handey_studio.localization.verify import Verdict
from handey_studio.world.part import Part

FEATURES = (
    "outlines that should be seen are missing",  # metres of silhouette a metre of visible edge
    "more outline is missing than is chance",  # metres a diameter of the part
    "creases that should be seen are missing",  # metres a metre of visible edge
    "the sensor sees through it",  # root of the share of the surface
    "its edges lie beside those that are seen",  # scatter, in slacks of the search
    "one of its faces lies beside the readings",  # mean, in what noise and outlines leave uncertain
    "the readings lie off its faces",  # rms, in sigmas of a reading
    "its outline is larger than what is seen",  # margin, in spreads of what sensors lose at silhouettes
    "too few of its edges are found",  # logarithm of their number
    "too little of its surface is seen",  # logarithm of square diameters
    "there are no readings where it should be",  # share of the surface
    "it would stand below the table",  # sigmas of a reading beyond two
    "it does not rest on the table",  # 1 if three corners do, to within noise
    "no three corners are near the table",  # 1 if they are, to within what outlines leave uncertain
)
FINE_M, COARSE_M = 0.0008, 0.0012  # noise up to which the weights hold, and from which agreement decides
AGREEMENT_WORTH, EVEN_AGREEMENT = 30.0, 0.873  # edges times surfaces that agree: how fast odds grow, and where they are even
EDGES_WORTH, EVEN_EDGES = 4.0, 6.0  # more edges that are found say more
OFF_COST, SUNK_COST = 4.0, 1.5  # a sigma that the readings' rms is too large; a slack too far below the table
REST_UNKNOWN = 0.8  # where no table is seen: about the share of right poses that rest


class ScoreWeights(NamedTuple):
    """What the score makes of its features (k,): the logarithm of the odds is `intercept` + features · `worth`. `typical` features of
    right poses tell what is unusual about a pose."""

    intercept: float
    worth: NDArray
    typical: NDArray


def weights_from(table: Mapping[str, Any]) -> ScoreWeights:
    """Weights from a table like `score.toml`'s. A feature that it does not name has not been fitted yet and weighs nothing."""
    worth, typical = (np.array([float(table[kind].get(name, 0.0)) for name in FEATURES]) for kind in ("weights", "typical"))
    return ScoreWeights(float(table["intercept"]), worth, typical)


FITTED = weights_from(tomllib.loads(Path(__file__).with_name("score.toml").read_text()))


class Rated(NamedTuple):
    """Poses (n,) of one part as the score looks at them: their `verdict`, the `margin` [m] and `rms` [m] of their refinement,
    how far [m] they reach `below` the table, and how far [m] off it their third corner would
    `rest`."""

    verdict: Verdict
    margin: NDArray
    rms: NDArray
    below: NDArray
    rest: NDArray

    def rows(self, chosen: NDArray) -> "Rated":
        """Some of the poses, by their numbers."""
        return Rated(self.verdict.rows(chosen), *(array[chosen] for array in self[1:]))


def features(search: Search, part: Part, rated: Rated) -> NDArray:
    """(n, k) the numbers that the score weighs, in the order of `FEATURES`."""
    v, view, diameter = rated.verdict, search.view, part.solid.diameter
    visible = np.maximum(v.found + v.missing, 1e-9)
    outline = v.missing - v.unbent
    seen = np.maximum(v.on + v.through + v.unknown, 1e-12)
    return np.stack(
        [
            outline / visible,
            outline / diameter,
            v.unbent / visible,
            np.minimum(np.sqrt(v.through / seen), 0.2),
            np.minimum(v.scatter / search.slack, 5.0),
            np.minimum(v.lifted / (view.noise + 0.1 * view.outline_error), 5.0),
            np.minimum(rated.rms / view.noise, 6.0),
            np.minimum(np.abs(rated.margin - search.weights.margin) / search.weights.margin_spread, 6.0),
            np.log(np.maximum(v.edges, 0.5)),
            np.log(np.maximum(v.on, 1e-9) / diameter**2),
            v.unknown / seen,
            np.clip(rated.below / view.noise - 2.0, 0.0, 3.0),
            _rests(rated, 2.0 * view.noise + 0.25 * view.outline_error),
            _rests(rated, 2.0 * search.slack),
        ],
        axis=1,
    )


def _rests(rated: Rated, tolerance: float) -> NDArray:
    """1 where three corners lie within `tolerance` [m] of the table; where there is no table, what most right poses would have."""
    return np.where(np.isinf(rated.rest), REST_UNKNOWN, rated.rest < tolerance)


class Score(NamedTuple):
    """`probability` in [0, 1] that a pose is right, the `doubt`: what speaks most against it, and the `features` (k,) that tell so."""

    probability: float
    doubt: str
    features: NDArray


def scores(search: Search, part: Part, rated: Rated) -> list[Score]:
    """How probable each pose is."""
    found = features(search, part, rated)
    doubts = np.argmin(FITTED.worth * (found - FITTED.typical), axis=1)
    coarse = np.clip((search.view.noise - FINE_M) / (COARSE_M - FINE_M), 0.0, 1.0)
    odds = (1.0 - coarse) * (FITTED.intercept + found @ FITTED.worth) + coarse * _coarse_odds(search, rated)
    probability = 1.0 / (1.0 + np.exp(-odds))
    return [Score(float(p), FEATURES[doubt], row) for p, doubt, row in zip(probability, doubts, found, strict=True)]


def _coarse_odds(search: Search, rated: Rated) -> NDArray:
    """Logarithm (n,) of the odds before a sensor of much noise."""
    agreement = rated.verdict.edge_share * rated.verdict.surface_share
    off = np.clip(rated.rms / search.view.noise - 1.0, 0.0, 5.0)
    sunk = np.maximum(rated.below / search.slack - 1.0, 0.0)
    many = np.log(np.maximum(rated.verdict.edges, 0.5) / EVEN_EDGES)
    return AGREEMENT_WORTH * (agreement - EVEN_AGREEMENT) + EDGES_WORTH * many - OFF_COST * off - SUNK_COST * sunk
