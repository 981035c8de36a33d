"""Fitting the localizer's weights to simulated scenes, and checking them on scenes that they have not seen."""

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress, Share
from handey_studio.cell.scenes.pile_scenes import CAMERA
from handey_studio.localization.promise import FEATURES as PROMISES
from handey_studio.localization.promise import PromiseWeights
from handey_studio.localization.score import FEATURES, FITTED, ScoreWeights
from handey_studio.task.bench.locate.labelled_scenes import simulate
from handey_studio.task.bench.locate.logit import LEAST, conditional, fit, fit_order
from handey_studio.task.bench.locate.weighed import Weighed, weighed_in
from handey_studio.world.library import Library

SEEDS = range(100, 200)
FOLDS = 5  # the scenes are dealt out; each fold's candidates are judged by a fit to the others
BINS = 10  # of probability
THRESHOLDS = (0.1, 0.3, 0.5, 0.7, 0.9)
UNSEEN, SHIPPED = "fitted, on scenes it has not seen", "as shipped, on the same"


class FittedWeights(NamedTuple):
    """What `score.toml` holds."""

    score: ScoreWeights
    promise: PromiseWeights


def run_fit(
    library: Library,
    tell: Callable[[str], None],
    progress: Progress,
    *,
    seeds: Iterable[int] = SEEDS,
    scenes: Path | None = None,
    sensor: str = CAMERA,
) -> tuple[FittedWeights, dict[str, Any]]:
    """Weights fitted to the candidates in the seeds' simulated scenes and to their forerunners, and the table that is told: how well
    probabilities of such weights hold on scenes that they were not fitted to. Scenes are kept in the folder `scenes`, if one is given.
    Raises BadInput."""
    with tempfile.TemporaryDirectory(prefix="handey-scenes-") as forgotten:
        folders = simulate(seeds, scenes or Path(forgotten), library, sensor, Share(progress, 0.0, 0.5))
        weighed = weighed_in(folders, library, Share(progress, 0.5, 1.0))
    fitted = fit_weighed(weighed)
    promise = PromiseWeights(*(fit_order(weighed.lineups[stage]) for stage in PromiseWeights._fields))
    checks = {
        UNSEEN: calibration(held_out(weighed), weighed.right),
        SHIPPED: calibration(conditional(_odds(FITTED, weighed.features), weighed.rivals), weighed.right),
    }
    report = {
        "schema": "handey/fit/score/1",
        "scenes": len(folders),
        "candidates": len(weighed.right),
        "right": int(weighed.right.sum()),
        "weights": {"intercept": fitted.intercept} | dict(zip(FEATURES, fitted.worth.tolist(), strict=True)),
        "checks": checks,
    }
    for line in table(report):
        tell(line)
    return FittedWeights(fitted, promise), report


def fit_weighed(weighed: Weighed, chosen: NDArray | None = None) -> ScoreWeights:
    """The score's weights from the candidates, or the `chosen` (n,) of them: once beside the rivals of all parts, as when all are asked for
    together, and once beside those of their own part alone, as when nothing is known of the others. Raises BadInput."""
    chosen = np.ones(len(weighed.right), dtype=bool) if chosen is None else chosen
    number = np.cumsum(chosen) - 1
    rivals = weighed.rivals[chosen[weighed.rivals].all(axis=1)]
    own = rivals[weighed.part[rivals[:, 0]] == weighed.part[rivals[:, 1]]]
    both = np.concatenate([number[rivals], number[own] + chosen.sum()])
    return fit(np.tile(weighed.features[chosen], (2, 1)), np.tile(weighed.right[chosen], 2), both)


def held_out(weighed: Weighed) -> NDArray:
    """Each candidate's probability (n,) beside its rivals, by weights fitted to the other folds' scenes."""
    odds = np.zeros(len(weighed.right))
    for number in range(FOLDS):
        held = weighed.scene % FOLDS == number
        if held.any():
            odds[held] = _odds(fit_weighed(weighed, ~held), weighed.features[held])
    return conditional(odds, weighed.rivals)


def calibration(p: NDArray, right: NDArray) -> dict[str, Any]:
    """How well probabilities (n,) tell which candidates are `right` (n,): the mean log loss, that of always saying how many are
    right, bins of probability with the share that is right in them, and what thresholds keep."""
    p, base = np.clip(p, LEAST, 1.0 - LEAST), right.mean()
    numbers = np.minimum((p * BINS).astype(int), BINS - 1)
    bins = [(k, numbers == k) for k in range(BINS)]
    return {
        "log_loss": float(-np.log(np.where(right, p, 1.0 - p)).mean()),
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


def toml(weights: FittedWeights) -> str:
    """Weights as the file that the localizer reads."""
    score, promise = weights
    lines = ["# What the score's features weigh, what right poses typically have of them, and what makes poses promising."]
    lines += ["# Written by `handey fit score`.", f"intercept = {score.intercept:.4g}"]
    tables = [("weights", FEATURES, score.worth), ("typical", FEATURES, score.typical)]
    tables += [(stage, PROMISES, worth) for stage, worth in zip(promise._fields, promise, strict=True)]
    for kind, names, values in tables:
        lines += ["", f"[{kind}]", *(f'"{name}" = {value:.4g}' for name, value in zip(names, values, strict=True))]
    return "\n".join(lines) + "\n"


def _odds(weights: ScoreWeights, features: NDArray) -> NDArray:
    return weights.intercept + features @ weights.worth
