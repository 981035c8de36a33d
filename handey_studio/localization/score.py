"""The score: how probable it is that a pose is right, from what the view shows of it.

A conditional logit over numbers that mean the same for every part: of the poses that claim the same readings, the odds of each are the
exponential of its weighed features, and those of "none of them" are 1 (see `joint.probabilities`). Its weights stand in `score.toml`;
`handey fit score` fits them to the candidates, right and wrong, of simulated piles seen by a fine sensor (0.5 mm of noise), whose
truth is known. Where a sensor's noise hides the small differences between look-alikes, and models are no truer than it (cartons before
a Kinect), such weights ask for too much: there the score goes by how far edges and surfaces agree, as many cells hold few parts of one
size. Between the two it changes over gradually.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.fitted import TABLE
from handey_studio.localization.search import Search
from handey_studio.localization.second_look import Tally
from handey_studio.localization.verify import Verdict
from handey_studio.sensing.depth_view import DepthView
from handey_studio.world.part import Part

FEATURES = (
    "outlines that should be seen are missing",  # metres of silhouette a metre of visible edge
    "too much of its outline is missing",  # diameters
    "creases that should be seen are missing",  # diameters
    "too few of its edges are found",  # their number
    "too little of its edges is found",  # logarithm of diameters
    "its outline is larger than what is seen",  # margin, in spreads of what sensors lose at silhouettes
    "its outline scatters",  # in what noise and outlines leave uncertain
    "one of its faces lies beside the readings",  # mean, in what noise leaves uncertain
    "the sensor sees through it",  # logarithm of ten-thousandths of a square diameter
    "the sensor sees through much of it",  # root of square diameters
    "readings lie before its faces",  # root of the share of the surface
    "too little of its surface is seen",  # logarithm of square diameters
    "much of it is hidden",  # root of the share of the faces that look at the sensor
    "it would stand below the table",  # what noise and outlines leave uncertain
    "too little room is left below it",  # diameters from the table to its lowest corner: what carries it must fit there
    "it touches the table nowhere",  # 1 if a corner does, to within what noise and looseness leave uncertain
    "no three corners touch the table",
    "it does not rest on the table",  # 1 if three corners do, to within noise
)
FEET = slice(len(FEATURES) - 3, len(FEATURES))  # those that tell whether it rests
ROOM_LEFT = FEET.start - 1  # the one that tells of the room below it
LEAST_EDGE_M = 0.001  # a logarithm is taken of no less
FINE_M, COARSE_M = 0.0008, 0.0012  # noise up to which the weights hold, and from which agreement decides
AGREEMENT_WORTH, EVEN_AGREEMENT = 30.0, 0.853  # edges times readings that agree: how fast odds grow, and where they are even
EDGES_WORTH, EVEN_EDGES = 4.0, 6.0  # more edges that are found say more
OFF_COST, SUNK_COST = 4.0, 2.0  # a sigma that the readings' rms is too large; a slack too far below the table
TAIL = 0.003  # of the readings on a right pose's faces seem to see through it all the same: a sensor's noise has tails
ROOM = 0.4  # diameters below a part, beyond which more says no more
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


FITTED = weights_from(TABLE)


class Rated(NamedTuple):
    """Poses (n,) of one part as the score looks at them: their `verdict`, the `margin` [m] and `rms` [m] of their refinement, how far
    [m] their loosest point could be off, `sigma`, their `footing` (n, 3) [m], and the `tally` of the second look."""

    verdict: Verdict
    margin: NDArray
    rms: NDArray
    sigma: NDArray
    footing: NDArray
    tally: Tally

    def rows(self, chosen: NDArray) -> "Rated":
        """Some of the poses, by their numbers."""
        verdict, margin, rms, sigma, footing, tally = self
        return Rated(verdict.rows(chosen), margin[chosen], rms[chosen], sigma[chosen], footing[chosen], tally.rows(chosen))

    @property
    def below(self) -> NDArray:
        """How far (n,) [m] they reach below the table; 0 where no table is seen."""
        return np.maximum(-np.nan_to_num(self.footing[:, 0]), 0.0)

    @property
    def sunk(self) -> NDArray:
        """How far (n,) [m] the three corners that carry them are below the table in the mean: a tilt sinks some and lifts others."""
        return np.maximum(-np.nan_to_num(self.footing), 0.0).mean(axis=1)


def features(search: Search, part: Part, rated: Rated) -> NDArray:
    """(n, k) the numbers that the score weighs, in the order of `FEATURES`: what is not known is what is typical of right poses."""
    found = np.concatenate([_of_edges(search, part, rated), _of_readings(part, rated), _of_footing(search, part, rated)], axis=1)
    return np.where(np.isnan(found), FITTED.typical, found)


def _of_edges(search: Search, part: Part, rated: Rated) -> NDArray:
    v, view, diameter = rated.verdict, search.view, part.solid.diameter
    missing = v.missing - v.unbent
    return np.stack(
        [
            missing / np.maximum(v.found + v.missing, 1e-9),
            missing / diameter,
            v.unbent / diameter,
            v.edges,
            np.log(np.maximum(v.found, LEAST_EDGE_M) / diameter),
            np.minimum(np.abs(rated.margin - search.weights.margin) / search.weights.margin_spread, 6.0),
            np.minimum(v.scatter / search.slack, 5.0),
            np.minimum(v.lifted / (view.noise + 0.1 * view.outline_error), 5.0),
        ],
        axis=1,
    )


def _of_readings(part: Part, rated: Rated) -> NDArray:
    tally, square = rated.tally, part.solid.diameter**2
    every = np.maximum(sum(tally), 1e-12)
    through = np.maximum(tally.through - TAIL * tally.on, 0.0)
    return np.stack(
        [
            np.log1p(1e4 * through / square),
            np.sqrt(through / square),
            np.sqrt(np.minimum(tally.before / np.maximum(tally.on + tally.before, 1e-12), 0.25)),
            np.log(np.maximum(tally.on / square, 1e-6)),
            np.sqrt(tally.hidden / every),
        ],
        axis=1,
    )


def _of_footing(search: Search, part: Part, rated: Rated) -> NDArray:
    height, view = rated.footing[:, [0, 2]], search.view
    uncertain = TOUCHES * (view.noise + np.minimum(rated.sigma, search.slack))[:, None]
    below = np.clip(-height[:, :1] / search.slack, 0.0, 4.0)
    touches = np.where(np.isnan(height), np.nan, height < uncertain)
    rests = np.where(np.isnan(height[:, 1:]), np.nan, np.abs(height[:, 1:]) < resting_within(view))
    room = np.clip(height[:, :1] / part.solid.diameter, 0.0, ROOM)
    return np.concatenate([below, room, touches, rests], axis=1)


def resting_within(view: DepthView) -> float:
    """How far [m] from what holds it up a part may seem to be that rests on it."""
    return TOUCHES * view.noise + 0.25 * view.outline_error


class Score(NamedTuple):
    """The logarithm of the `odds` that a pose is right, against nothing known standing there; the `doubt`: what speaks most against it, and
    the `features` (k,) that tell so."""

    odds: float
    doubt: str
    features: NDArray

    @property
    def probability(self) -> float:
        """In [0, 1], as if the pose had no rivals."""
        return float(1.0 / (1.0 + np.exp(-np.clip(self.odds, -40.0, 40.0))))


def scores(search: Search, part: Part, rated: Rated) -> list[Score]:
    """How probable each pose is by itself."""
    found = features(search, part, rated)
    coarse = _coarse(search)
    odds = (1.0 - coarse) * (FITTED.intercept + found @ FITTED.worth) + coarse * _coarse_odds(search, rated)
    return [Score(float(x), _doubt(row), row) for x, row in zip(odds, found, strict=True)]


def at_rest(search: Search, score: Score) -> Score:
    """The score of a pose that rests on something else than the table."""
    found = score.features.copy()
    found[ROOM_LEFT], found[FEET] = 0.0, 1.0
    return Score(score.odds + float((1.0 - _coarse(search)) * FITTED.worth @ (found - score.features)), _doubt(found), found)


def _doubt(found: NDArray) -> str:
    """What speaks most against a pose of features (k,)."""
    return FEATURES[int(np.argmin(FITTED.worth * (found - FITTED.typical)))]


def _coarse(search: Search) -> float:
    """How far agreement alone decides, from 0 to 1."""
    return float(np.clip((search.view.noise - FINE_M) / (COARSE_M - FINE_M), 0.0, 1.0))


def _coarse_odds(search: Search, rated: Rated) -> NDArray:
    """Logarithm (n,) of the odds before a sensor of much noise."""
    tally = rated.tally
    agreement = rated.verdict.edge_share * tally.on / np.maximum(tally.on + tally.through, 1e-12)
    off = np.clip(rated.rms / search.view.noise - 1.0, 0.0, 5.0)
    sunk = np.maximum(rated.sunk / search.slack - 1.0, 0.0)
    many = np.log(np.maximum(rated.verdict.edges, 0.5) / EVEN_EDGES)
    return AGREEMENT_WORTH * (agreement - EVEN_AGREEMENT) + EDGES_WORTH * many - OFF_COST * off - SUNK_COST * sunk
