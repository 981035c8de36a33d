"""Accept: what is probable by itself, then what explains the view jointly."""

import time
from typing import NamedTuple

import numpy as np

from handey_studio.localization.candidates import Candidate
from handey_studio.localization.joint import explain_jointly
from handey_studio.localization.result import Hypothesis, LocatedPose, pose_matrix
from handey_studio.localization.search import Search

MOST_RIVALS = 60  # candidates that are weighed against one another
SURE = 1.0 - 1e-9  # no view makes a pose more probable than this


class Fall(NamedTuple):
    """Why a candidate fell, with the number and the limit."""

    reason: str
    value: float
    limit: float
    unit: str


def accept(search: Search, candidates: list[Candidate]) -> tuple[list[LocatedPose], list[Hypothesis]]:
    """The poses that stand, most probable first, and every candidate with why it fell: the accepted first, then by probability."""
    start = time.perf_counter()
    falls = {n: fall for n, candidate in enumerate(candidates) if (fall := _objection(search, candidate)) is not None}
    accepted = [candidates[n] for n in _jointly(search, candidates, falls)]
    for n, fall in sorted(falls.items()):
        search.ledger.fall(candidates[n].entry, fall.reason, value=fall.value, limit=fall.limit, unit=fall.unit)
    rejected = sorted(falls, key=lambda n: -candidates[n].score.probability)
    poses = [_located(search, candidate) for candidate in accepted]
    hypotheses = [_hypothesis(search, candidate, None) for candidate in accepted]
    hypotheses += [_hypothesis(search, candidates[n], falls[n].reason) for n in rejected]
    search.timing["accept"] = time.perf_counter() - start
    return sorted(poses, key=lambda pose: -pose.score), hypotheses


def _jointly(search: Search, candidates: list[Candidate], falls: dict[int, Fall]) -> list[int]:
    """Numbers of the candidates that stand together, most probable first; the others are added to `falls`."""
    ranked = sorted((n for n in range(len(candidates)) if n not in falls), key=lambda n: -candidates[n].score.probability)
    falls.update({n: Fall("too many better poses", k, MOST_RIVALS, "") for k, n in enumerate(ranked) if k >= MOST_RIVALS})
    standing = ranked[:MOST_RIVALS]
    # How much more probable the view is with a pose than without any: of two that exclude each other the more probable one stands.
    worth = [-float(np.log1p(-min(candidates[n].score.probability, SURE))) for n in standing]
    joint = explain_jointly(search, [candidates[n] for n in standing], worth)
    falls.update({standing[k]: Fall(*rivalry) for k, rivalry in joint.fell.items()})
    chosen = []
    count: dict[str, int] = {}
    for n in sorted((standing[k] for k in joint.chosen), key=lambda n: -candidates[n].score.probability):
        name = candidates[n].part.name
        count[name] = count.get(name, 0) + 1
        if count[name] > search.options.max_poses:
            falls[n] = Fall("as many poses as asked for were found", count[name], search.options.max_poses, "")
        else:
            chosen.append(n)
    return chosen


def _objection(search: Search, candidate: Candidate) -> Fall | None:
    """The first thing that speaks against a candidate by itself."""
    options, verdict = search.options, candidate.verdict
    allowed = 4.0 * search.slack
    if candidate.below > allowed:
        return Fall("it would stand below the table", candidate.below, allowed, "m")
    if verdict.visible_fraction[0] < options.min_visible_fraction:
        return Fall("too little of it is seen", float(verdict.visible_fraction[0]), options.min_visible_fraction, "")
    if candidate.score.probability < options.min_score:
        return Fall(f"improbable, above all as {candidate.score.doubt}", candidate.score.probability, options.min_score, "")
    return None


def _located(search: Search, candidate: Candidate) -> LocatedPose:
    T, verdict = pose_matrix(candidate.R, candidate.t), candidate.verdict
    return LocatedPose(
        candidate.part.name,
        search.view.T_world_sensor @ T,
        T,
        candidate.score.probability,
        int(verdict.predicted[0]),
        int(verdict.edges[0]),
        float(verdict.visible_fraction[0]),
        candidate.rms,
        candidate.margin,
        candidate.sigma,
    )


def _hypothesis(search: Search, candidate: Candidate, reason: str | None) -> Hypothesis:
    T_world_part = search.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
    found, missing = float(candidate.verdict.found[0]), float(candidate.verdict.missing[0])
    return Hypothesis(
        candidate.part.name,
        T_world_part,
        candidate.score.probability,
        found,
        missing,
        candidate.data,
        reason,
        candidate.model,
        candidate.entry,
    )
