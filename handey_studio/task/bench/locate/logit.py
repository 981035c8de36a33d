"""Fitting conditional logits: odds of alternatives of which at most one, or exactly one, is right, from weighed features."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import csr_array, eye_array

from handey_studio.base import BadInput
from handey_studio.localization.score import ScoreWeights
from handey_studio.task.bench.locate.weighed import Lineup

RIDGE = 1e-5  # cost of a squared weight of a standardised feature: keeps weights finite where right and wrong can be told apart for sure
RANK_RIDGE = 1e-3  # the same for the order of poses, where more weight on what is sure gains nothing
LEAST = 1e-12  # of a probability whose logarithm is taken


def fit(features: NDArray, right: NDArray, rivals: NDArray | None = None, ridge: float = RIDGE) -> ScoreWeights:
    """Weights by which those candidates (n, k) are likeliest to be right that are, `right` (n,), each beside its `rivals`, pairs (m, 2) of
    numbers; without any, a logistic regression. Raises BadInput without both right and wrong."""
    if right.all() or not right.any():
        kind = "right" if right.any() else "wrong"
        raise BadInput(f"all {len(right)} candidates are {kind}: the score can only be fitted to right and wrong ones; take more seeds.")
    middle, spread = features.mean(axis=0), features.std(axis=0) + 1e-12
    Z, beside = np.column_stack([(features - middle) / spread, np.ones(len(features))]), _beside(len(features), rivals)

    def loss(w: NDArray) -> tuple[float, NDArray]:
        worth = np.exp(np.clip(Z @ w, -30.0, 30.0))
        total = 1.0 + beside @ worth
        p = np.clip(worth / total, LEAST, 1.0 - LEAST)
        others = total - worth
        of_total = np.where(right, 1.0 / total, 1.0 / total - 1.0 / others)
        slope = np.where(right, -1.0, worth / others) + worth * (beside.T @ of_total)
        return float(-np.log(np.where(right, p, 1.0 - p)).mean()), Z.T @ slope / len(Z)

    w = _least(loss, Z.shape[1], ridge, held=Z.shape[1] - 1)
    worth = w[:-1] / spread
    return ScoreWeights(float(w[-1] - worth @ middle), worth, np.median(features[right], axis=0))


def conditional(odds: NDArray, rivals: NDArray | None = None) -> NDArray:
    """(n,) how probable each candidate is beside its rivals, from the logarithm of its odds against none of them."""
    worth = np.exp(np.clip(odds, -40.0, 40.0))
    return worth / (1.0 + _beside(len(odds), rivals) @ worth)


def fit_order(lineups: Sequence[Lineup], ridge: float = RANK_RIDGE) -> NDArray:
    """Weights (k,) by which poses of each true instance are likeliest to come before all wrong ones of its lineup."""
    every = np.concatenate([lineup.features for lineup in lineups])
    middle, spread = every.mean(axis=0), every.std(axis=0) + 1e-12
    told = [((one.features - middle) / spread, one.instance) for one in lineups if (one.instance >= 0).any()]
    told = [(Z, instance == k, instance < 0) for Z, instance in told for k in np.unique(instance[instance >= 0])]

    def loss(w: NDArray) -> tuple[float, NDArray]:
        cost, slope = 0.0, np.zeros(len(w))
        for Z, right, wrong in told:
            u = Z @ w
            worth = np.exp(u - u.max())
            good, either = worth * right, worth * (right | wrong)
            cost += np.log(either.sum()) - np.log(good.sum())
            slope += Z.T @ (either / either.sum() - good / good.sum())
        return cost / max(len(told), 1), slope / max(len(told), 1)

    return _least(loss, every.shape[1], ridge) / spread


def _beside(n: int, rivals: NDArray | None) -> csr_array:
    """(n, n) 1 for each candidate itself and its rivals."""
    if rivals is None or not len(rivals):
        return csr_array(eye_array(n))
    both = np.concatenate([rivals, rivals[:, ::-1]])
    return csr_array((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(n, n)) + csr_array(eye_array(n))


def _least(loss: Callable[[NDArray], tuple[float, NDArray]], k: int, ridge: float, held: int | None = None) -> NDArray:
    """The weights (k,) of least loss, each but number `held` at the cost of its square times `ridge`."""
    free = np.arange(k) != held

    def cost(w: NDArray) -> tuple[float, NDArray]:
        value, slope = loss(w)
        return value + ridge * float((w[free] ** 2).sum()), slope + 2.0 * ridge * w * free

    return minimize(cost, np.zeros(k), jac=True, method="L-BFGS-B", options={"maxiter": 2000}).x
