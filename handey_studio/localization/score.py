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
from handey_studio.localization.second_look import Tally
from handey_studio.localization.verify import Verdict
from handey_studio.world.part import Part

FEATURES = (
    "outlines that should be seen are missing",  # metres of silhouette a metre of visible edge
    "creases that should be seen are missing",  # metres a metre of visible edge
    "too few of its edges are found",  # logarithm of their number
    "its outline is larger than what is seen",  # margin, in spreads of what sensors lose at silhouettes
    "one of its faces lies beside the readings",  # mean, in what noise and outlines leave uncertain
    "the sensor sees through it",  # logarithm of ten-thousandths of a square diameter
    "readings lie before its faces",  # root of the share of the surface
    "too little of its surface is seen",  # logarithm of square diameters
    "there are no readings where it should be",  # share of the surface
    "it would stand below the table",  # what noise and looseness leave uncertain
    "it touches the table nowhere",  # 1 if a corner does, to within what noise and looseness leave uncertain
    "no two corners touch the table",
    "no three corners touch the table",
    "it does not rest on the table",  # 1 if three corners do, to within noise
)
FINE_M, COARSE_M = 0.0008, 0.0012  # noise up to which the weights hold, and from which agreement decides
AGREEMENT_WORTH, EVEN_AGREEMENT = 30.0, 0.873  # edges times surfaces that agree: how fast odds grow, and where they are even
EDGES_WORTH, EVEN_EDGES = 4.0, 6.0  # more edges that are found say more
OFF_COST, SUNK_COST = 4.0, 1.5  # a sigma that the readings' rms is too large; a slack too far below the table
TOUCHES = 2.0  # standard deviations of a corner's height, and of a reading, from the table


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
    """Poses (n,) of one part as the score looks at them: their `verdict`, the `margin` [m] and `rms` [m] of their refinement, how far
    [m] their loosest point could be off, `sigma`, their `footing` (n, 3) [m], and the `tally` of the second look if they had one."""

    verdict: Verdict
    margin: NDArray
    rms: NDArray
    sigma: NDArray
    footing: NDArray
    tally: Tally | None

    def rows(self, chosen: NDArray) -> "Rated":
        """Some of the poses, by their numbers."""
        tally = None if self.tally is None else self.tally.rows(chosen)
        verdict, margin, rms, sigma, footing, _ = self
        return Rated(verdict.rows(chosen), margin[chosen], rms[chosen], sigma[chosen], footing[chosen], tally)

    @property
    def below(self) -> NDArray:
        """How far (n,) [m] they reach below the table; 0 where no table is seen."""
        return np.maximum(-np.nan_to_num(self.footing[:, 0]), 0.0)


def features(search: Search, part: Part, rated: Rated) -> NDArray:
    """(n, k) the numbers that the score weighs, in the order of `FEATURES`: what is not known is what is typical of right poses."""
    found = np.concatenate([_of_edges(search, rated), _of_readings(search, part, rated), _of_footing(search, rated)], axis=1)
    return np.where(np.isnan(found), FITTED.typical, found)


def _of_edges(search: Search, rated: Rated) -> NDArray:
    v, view = rated.verdict, search.view
    visible = np.maximum(v.found + v.missing, 1e-9)
    return np.stack(
        [
            (v.missing - v.unbent) / visible,
            v.unbent / visible,
            np.log(np.maximum(v.edges, 0.5)),
            np.minimum(np.abs(rated.margin - search.weights.margin) / search.weights.margin_spread, 6.0),
            np.minimum(v.lifted / (view.noise + 0.1 * view.outline_error), 5.0),
        ],
        axis=1,
    )


def _of_readings(search: Search, part: Part, rated: Rated) -> NDArray:
    if rated.tally is None:
        return np.full((len(rated.rms), 4), np.nan)
    tally, diameter = rated.tally, part.solid.diameter
    return np.stack(
        [
            np.log1p(1e4 * tally.through / diameter**2),
            np.sqrt(np.minimum(tally.before / np.maximum(tally.on + tally.before, 1e-12), 0.25)),
            np.log(np.maximum(tally.on, 1e-6 * diameter**2) / diameter**2),
            tally.unread / np.maximum(tally.on + tally.through + tally.unread, 1e-12),
        ],
        axis=1,
    )


def _of_footing(search: Search, rated: Rated) -> NDArray:
    height, view = rated.footing, search.view
    uncertain = TOUCHES * (view.noise + np.minimum(rated.sigma, search.slack))[:, None]
    touches = np.where(np.isnan(height), np.nan, height < uncertain)
    rests = np.where(np.isnan(height[:, 2:]), np.nan, np.abs(height[:, 2:]) < TOUCHES * view.noise + 0.25 * view.outline_error)
    return np.concatenate([np.clip(-height[:, :1] / uncertain - 1.0, 0.0, 4.0), touches, rests], axis=1)


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
