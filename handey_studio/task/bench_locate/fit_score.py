"""Fitting the score's weights: a logistic regression over the candidates of simulated scenes, checked on scenes that it has not seen."""

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from handey_studio.base import BadInput, Progress, Share
from handey_studio.cell.scenes import CAMERA
from handey_studio.localization.score import FEATURES, FITTED, ScoreWeights
from handey_studio.task.bench_locate.labelled_scenes import simulate
from handey_studio.task.bench_locate.weighed import Weighed, weighed_in
from handey_studio.world.library import Library

SEEDS = range(100, 200)
RIDGE = 1e-5  # cost of a squared weight of a standardised feature: keeps weights finite where right and wrong can be told apart for sure
FOLDS = 5  # the scenes are dealt out; each fold's candidates are judged by a fit to the others
BINS = 10  # of probability
THRESHOLDS = (0.1, 0.3, 0.5, 0.7, 0.9)
UNSEEN, SHIPPED = "fitted, on scenes it has not seen", "as shipped, on the same"


def run_fit(
    library: Library,
    tell: Callable[[str], None],
    progress: Progress,
    *,
    seeds: Iterable[int] = SEEDS,
    scenes: Path | None = None,
    sensor: str = CAMERA,
) -> tuple[ScoreWeights, dict[str, Any]]:
    """Weights fitted to the candidates in the seeds' simulated scenes, and the table that is told: how well probabilities of such
    weights hold on scenes that they were not fitted to. Scenes are kept in the folder `scenes`, if one is given. Raises BadInput."""
    with tempfile.TemporaryDirectory(prefix="handey-scenes-") as forgotten:
        folders = simulate(seeds, scenes or Path(forgotten), library, sensor, Share(progress, 0.0, 0.5))
        weighed = weighed_in(folders, library, Share(progress, 0.5, 1.0))
    fitted = fit(weighed.features, weighed.right)
    checks = {
        UNSEEN: calibration(held_out_odds(weighed), weighed.right),
        SHIPPED: calibration(_odds(FITTED, weighed.features), weighed.right),
    }
    report = {
        "schema": "handey/fit/score/1",
        "scenes": len(folders),
        "candidates": len(weighed.right),
        "right": int(weighed.right.sum()),
        "weights": {"intercept": fitted.intercept, **_named(fitted.worth)},
        "checks": checks,
    }
    for line in table(report):
        tell(line)
    return fitted, report


def fit(features: NDArray, right: NDArray, ridge: float = RIDGE) -> ScoreWeights:
    """Weights of the likeliest logistic regression of `right` (n,) on `features` (n, k). Raises BadInput without both right and wrong."""
    if right.all() or not right.any():
        kind = "right" if right.any() else "wrong"
        raise BadInput(f"all {len(right)} candidates are {kind}: the score can only be fitted to right and wrong ones; take more seeds.")
    middle, spread = features.mean(axis=0), features.std(axis=0) + 1e-12
    Z = np.column_stack([(features - middle) / spread, np.ones(len(features))])
    side = np.where(right, -1.0, 1.0)

    def cost(w: NDArray) -> tuple[float, NDArray]:
        against = side * (Z @ w)
        slope = Z.T @ (side / (1.0 + np.exp(-against))) / len(Z)
        held = np.append(w[:-1], 0.0)
        return float(np.logaddexp(0.0, against).mean() + ridge * held @ held), slope + 2.0 * ridge * held

    w = minimize(cost, np.zeros(Z.shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": 2000}).x
    worth = w[:-1] / spread
    return ScoreWeights(float(w[-1] - worth @ middle), worth, np.median(features[right], axis=0))


def held_out_odds(weighed: Weighed) -> NDArray:
    """Logarithm (n,) of each candidate's odds, by weights fitted to the other folds' scenes."""
    odds = np.zeros(len(weighed.right))
    for number in range(FOLDS):
        held = weighed.scene % FOLDS == number
        if held.any():
            odds[held] = _odds(fit(weighed.features[~held], weighed.right[~held]), weighed.features[held])
    return odds


def calibration(odds: NDArray, right: NDArray) -> dict[str, Any]:
    """How well probabilities, as the logarithm (n,) of odds, tell which candidates are `right` (n,): the mean log loss, that of always
    saying how many are right, bins of probability with the share that is right in them, and what thresholds keep."""
    p, base = 1.0 / (1.0 + np.exp(-odds)), right.mean()
    numbers = np.minimum((p * BINS).astype(int), BINS - 1)
    bins = [(k, numbers == k) for k in range(BINS)]
    return {
        "log_loss": float(np.logaddexp(0.0, np.where(right, -odds, odds)).mean()),
        "log_loss_of_base_rate": float(-base * np.log(base) - (1 - base) * np.log(1 - base)),
        "bins": [
            {"from": k / BINS, "count": int(of.sum()), "probability": float(p[of].mean()), "right": float(right[of].mean())}
            for k, of in bins
            if of.any()
        ],
        "kept": [
            {"from": limit, "right": float((p[right] >= limit).mean()), "wrong": int((p[~right] >= limit).sum())} for limit in THRESHOLDS
        ],
    }


def table(report: dict[str, Any]) -> list[str]:
    """Lines for a terminal."""
    lines = [f"{report['candidates']} candidates in {report['scenes']} scenes, {report['right']} of them right"]
    lines += [f"{value:10.4g}  {name}" for name, value in report["weights"].items()]
    for name, check in report["checks"].items():
        lines.append(
            f"{name}: log loss {check['log_loss']:.5f} (always saying the share that is right: {check['log_loss_of_base_rate']:.5f})"
        )
        for of in check["bins"]:
            told = f"  {of['from']:.1f}–{of['from'] + 1 / BINS:.1f}: {of['count']:6d} candidates"
            lines.append(f"{told}, {of['right']:7.2%} right, {of['probability']:7.2%} told")
        lines += [
            f"  from {kept['from']:.1f}: {kept['right']:.2%} of the right are kept, and {kept['wrong']} wrong" for kept in check["kept"]
        ]
    return lines


def toml(weights: ScoreWeights) -> str:
    """Weights as the file that the score reads."""
    lines = ["# What each of the score's features weighs, and what right poses typically have of it. Written by `handey fit score`."]
    lines += [f"intercept = {weights.intercept:.4g}"]
    for kind, values in (("weights", weights.worth), ("typical", weights.typical)):
        lines += ["", f"[{kind}]", *(f'"{name}" = {value:.4g}' for name, value in _named(values).items())]
    return "\n".join(lines) + "\n"


def _odds(weights: ScoreWeights, features: NDArray) -> NDArray:
    return weights.intercept + features @ weights.worth


def _named(values: NDArray) -> dict[str, float]:
    return {name: float(value) for name, value in zip(FEATURES, values, strict=True)}
