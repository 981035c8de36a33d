"""Accept: what is probable beside its rivals, then what explains the view jointly."""

import time
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from handey_studio.localization.candidates import Candidate
from handey_studio.localization.joint import SAME_READINGS, WITHIN, Rivals, explain_jointly, probabilities, rivals_among
from handey_studio.localization.result import Hypothesis, LocatedPose, Rival, pose_matrix
from handey_studio.localization.score import at_rest
from handey_studio.localization.search import Search
from handey_studio.localization.standing import held_up

MOST_RIVALS = 60  # candidates that are weighed against one another
RIVAL_FROM, TOLD_FROM = 0.01, 0.05  # how probable a pose must be alone to count as a rival, and beside the others to be told as one
SURE = 1.0 - 1e-9  # no view makes a pose more probable than this
OUTDONE = "another pose explains the view better"


class Fall(NamedTuple):
    """Why a candidate fell, with the number and the limit, and the number of the candidate that stands in its place, if one does."""

    reason: str
    value: float
    limit: float
    unit: str = ""
    to: int | None = None


@dataclass(frozen=True)
class Weighing:
    """Candidates, the `numbers` of those that were weighed against one another, why two of these cannot both stand (`rivals`, by their
    places in `numbers`), and the `probability` of every candidate."""

    candidates: list[Candidate]
    numbers: list[int]
    rivals: Rivals
    probability: list[float]

    def against(self, n: int, reasons: tuple[str, ...] = (SAME_READINGS,)) -> list[int]:
        """The candidates that cannot stand beside number n for one of some `reasons`, the most probable first."""
        pairs = [(self.numbers[a], self.numbers[b]) for (a, b), rivalry in self.rivals.items() if rivalry.reason in reasons]
        others = [b if a == n else a for a, b in pairs if n in (a, b)]
        return sorted(others, key=lambda k: -self.probability[k])


def accept(search: Search, candidates: list[Candidate]) -> tuple[list[LocatedPose], list[Hypothesis]]:
    """The poses that stand, most probable first, and every candidate with why it fell: the accepted first, then by probability.

    What rests on those that stand is weighed again as a part that rests, until nothing more does; so are its rivals, as that something
    rests there does not tell what.
    """
    start = time.perf_counter()
    weighing, falls, accepted = _chosen(search, candidates)
    while held := held_up(search, weighing.candidates, accepted, search.options.min_score):
        raised = {*held, *(k for n in held for k in weighing.against(n))}
        resting = [replace(c, score=at_rest(search, c.score)) if n in raised else c for n, c in enumerate(weighing.candidates)]
        weighing, falls, accepted = _chosen(search, resting)
    _write_down(search, weighing.candidates, falls)
    rejected = sorted(falls, key=lambda n: -weighing.probability[n])
    poses = [_located(search, weighing, n) for n in accepted]
    hypotheses = [_hypothesis(search, weighing, n, None) for n in accepted]
    hypotheses += [_hypothesis(search, weighing, n, falls[n].reason) for n in rejected]
    search.timing["accept"] = time.perf_counter() - start
    return poses, hypotheses


def _chosen(search: Search, candidates: list[Candidate]) -> tuple[Weighing, dict[int, Fall], list[int]]:
    """How the candidates weigh against one another, why each fell, and the numbers of those that stand together, most probable first."""
    falls = {n: fall for n, candidate in enumerate(candidates) if (fall := _sunk(search, candidate)) is not None}
    weighing = _weighed(search, candidates, falls)
    # What shows too little to be told may still be what the readings are: it was weighed against the others.
    falls = {n: fall for n, candidate in enumerate(candidates) if (fall := _unseen(search, candidate)) is not None} | falls
    falls |= {
        n: _improbable(search, weighing, n) for n, p in enumerate(weighing.probability) if p < search.options.min_score and n not in falls
    }
    return weighing, falls, _jointly(search, weighing, falls)


def _sunk(search: Search, candidate: Candidate) -> Fall | None:
    """Whether it cannot be there at all."""
    allowed = 4.0 * search.slack
    return Fall("it would stand below the table", candidate.below, allowed, "m") if candidate.below > allowed else None


def _unseen(search: Search, candidate: Candidate) -> Fall | None:
    """Whether less of it is seen than is asked for."""
    visible, least = float(candidate.verdict.visible_fraction[0]), search.options.min_visible_fraction
    return Fall("too little of it is seen", visible, least) if visible < least else None


def _weighed(search: Search, candidates: list[Candidate], falls: dict[int, Fall]) -> Weighing:
    """How probable each candidate is beside those that nothing rules out."""
    alone = [candidate.score.probability for candidate in candidates]
    numbers = sorted((n for n, p in enumerate(alone) if n not in falls and p >= RIVAL_FROM), key=lambda n: -alone[n])[:MOST_RIVALS]
    rivals = rivals_among(search, [candidates[n] for n in numbers])
    probability = alone.copy()
    for n, p in zip(numbers, probabilities(np.array([candidates[n].score.odds for n in numbers]), rivals), strict=True):
        probability[n] = float(p)
    return Weighing(candidates, numbers, rivals, probability)


def _improbable(search: Search, weighing: Weighing, n: int) -> Fall:
    """Why candidate n is too improbable: because of its rivals, or by itself."""
    candidate, p, limit = weighing.candidates[n], weighing.probability[n], search.options.min_score
    if candidate.score.probability >= limit:
        return Fall(OUTDONE, p, limit, to=weighing.against(n, (SAME_READINGS, WITHIN))[0])
    return Fall(f"improbable, above all as {candidate.score.doubt}", p, limit)


def _jointly(search: Search, weighing: Weighing, falls: dict[int, Fall]) -> list[int]:
    """Numbers of the candidates that stand together, most probable first; the others are added to `falls`."""
    probability, places = weighing.probability, [k for k, n in enumerate(weighing.numbers) if n not in falls]
    falls.update(
        {
            n: Fall("too many better poses", len(places), MOST_RIVALS)
            for n in set(range(len(probability))) - set(weighing.numbers) - set(falls)
        }
    )
    standing, at = [weighing.numbers[k] for k in places], {k: m for m, k in enumerate(places)}
    rivals = {(at[a], at[b]): rivalry for (a, b), rivalry in weighing.rivals.items() if a in at and b in at}
    # How much more probable the view is with a pose than without any: of two that exclude each other the more probable one stands.
    joint = explain_jointly([-float(np.log1p(-min(probability[n], SURE))) for n in standing], rivals)
    for k, (better, rivalry) in joint.fell.items():
        falls[standing[k]] = Fall(*rivalry, to=standing[better])
    chosen = []
    count: dict[str, int] = {}
    for n in sorted((standing[k] for k in joint.chosen), key=lambda n: -probability[n]):
        name = weighing.candidates[n].part.name
        count[name] = count.get(name, 0) + 1
        if count[name] > search.options.max_poses:
            falls[n] = Fall("as many poses as asked for were found", count[name], search.options.max_poses)
        else:
            chosen.append(n)
    return chosen


def _write_down(search: Search, candidates: list[Candidate], falls: dict[int, Fall]) -> None:
    """The falls in the ledger; one that fell to another names that one's option."""
    options = [entry.option for entry in search.ledger.entries]
    for n, fall in sorted(falls.items()):
        better = () if fall.to is None else (options[candidates[fall.to].entry],)
        search.ledger.fall(candidates[n].entry, fall.reason, value=fall.value, limit=fall.limit, unit=fall.unit, bodies=better)


def _rivals(search: Search, weighing: Weighing, n: int) -> tuple[Rival, ...]:
    """What else the readings of candidate n could be."""
    told = [(weighing.candidates[k], weighing.probability[k]) for k in weighing.against(n) if weighing.probability[k] >= TOLD_FROM]
    return tuple(Rival(c.part.name, search.view.T_world_sensor @ pose_matrix(c.R, c.t), p) for c, p in told)


def _located(search: Search, weighing: Weighing, n: int) -> LocatedPose:
    candidate = weighing.candidates[n]
    T, verdict = pose_matrix(candidate.R, candidate.t), candidate.verdict
    return LocatedPose(
        candidate.part.name,
        search.view.T_world_sensor @ T,
        T,
        weighing.probability[n],
        int(verdict.predicted[0]),
        int(verdict.edges[0]),
        float(verdict.visible_fraction[0]),
        candidate.rms,
        candidate.margin,
        candidate.sigma,
        _rivals(search, weighing, n),
    )


def _hypothesis(search: Search, weighing: Weighing, n: int, reason: str | None) -> Hypothesis:
    candidate = weighing.candidates[n]
    T_world_part = search.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
    found, missing = float(candidate.verdict.found[0]), float(candidate.verdict.missing[0])
    return Hypothesis(
        candidate.part.name,
        T_world_part,
        weighing.probability[n],
        found,
        missing,
        candidate.data,
        reason,
        candidate.model,
        candidate.entry,
        _rivals(search, weighing, n) if reason is None else (),
    )
