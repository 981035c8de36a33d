"""How promising a pose is: which hypotheses are worth refining, and which of the refined ones worth refining again.

Ranking by edges found less edges missing favours parts in full view. Here the ranks come from a fit to simulated piles, in which the right
pose of each part stood among all the wrong ones: its weights make the right ones come first. `handey fit score` fits them.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.fitted import TABLE
from handey_studio.localization.search import Search, footing
from handey_studio.localization.verify import Verdict
from handey_studio.world.part import Part

FEATURES = (
    "share of the outlines in sight that is missing",
    "edges that are found",  # logarithm of diameters
    "outlines that are missing",  # diameters
    "creases that are missing",  # diameters
    "what the sensor sees through it",  # root of square diameters
    "that it sees through it at all",  # logarithm of hundredths of a square diameter
    "how far a face lies beside the readings",  # mean of the worst one, in what noise and outlines leave uncertain
    "how far its outlines scatter",  # in the same
    "how far it stands below the table",  # in the same
    "that it touches the table",
    "that three corners do",
)
LEAST_EDGE, LEAST_SURFACE = 0.02, 0.01  # of a diameter, and of its square: less tells nothing
TOUCHES = 2.0  # slacks of a corner from the table


class PromiseWeights(NamedTuple):
    """What the features (k,) of `rough` poses, straight from edges, and of once `refined` ones weigh."""

    rough: NDArray
    refined: NDArray


def promise_weights(table: Mapping[str, Any]) -> PromiseWeights:
    """Weights from a table like `score.toml`'s. A feature that it does not name has not been fitted yet and weighs nothing."""
    return PromiseWeights(*(np.array([float(table[kind].get(name, 0.0)) for name in FEATURES]) for kind in PromiseWeights._fields))


FITTED = promise_weights(TABLE)


def promise_features(search: Search, part: Part, R: NDArray, t: NDArray, verdict: Verdict) -> NDArray:
    """(n, k) what speaks for and against poses R (n, 3, 3), t (n, 3) of a part in the sensor's frame, in the order of `FEATURES`."""
    diameter, slack = part.solid.diameter, search.slack
    found, missing, unbent = (length / diameter for length in (verdict.found, verdict.missing, verdict.unbent))
    through = verdict.through / diameter**2
    height = np.nan_to_num(footing(search, part, R, t) / slack, nan=0.0)  # where no table is seen every pose stands alike
    return np.stack(
        [
            (missing - unbent) / (found + missing + LEAST_EDGE),
            np.log(found + LEAST_EDGE),
            missing - unbent,
            unbent,
            np.sqrt(through),
            np.log1p(through / LEAST_SURFACE),
            np.minimum(verdict.lifted / slack, 5.0),
            np.minimum(verdict.scatter / slack, 3.0),
            np.clip(-height[:, 0] - 1.0, 0.0, 4.0),
            np.abs(height[:, 0]) < TOUCHES,
            np.abs(height[:, 2]) < TOUCHES,
        ],
        axis=1,
    )
