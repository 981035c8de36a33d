"""Candidates: the poses of one part that edge pairs propose, verified roughly, told apart, refined and verified again (Handey 1987 §3)."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.localization.distinct import distinct, probe_points
from handey_studio.localization.hypotheses import FELL, Assignments, hypothesize, hypothesize_parallel, joined
from handey_studio.localization.pairs import data_lines, data_pairs, data_parallels, model_edges, model_pairs, model_parallels
from handey_studio.localization.refine import Refined, refine
from handey_studio.localization.samples import PartSamples, part_samples, thinned
from handey_studio.localization.search import Search
from handey_studio.localization.verify import Verdict, unopposed, verify
from handey_studio.world.part import Part

SAME_SHARE = 0.04  # of a part's diameter: hypotheses nearer than this are one
EVERY = 4  # samples that the first verification looks at: one in so many
FIRST_STEPS, LAST_STEPS = 4, 8  # of refinement, with few samples over rough limits, and with all over tight ones
MOST_A_PLACE = 20  # hypotheses refined of those whose middles lie together
MOST_REFINED_AGAIN = 60


@dataclass(frozen=True, eq=False)
class Candidate(Value):
    """A refined pose `R` (3, 3), `t` (3,) [m] of a part in the sensor's frame and its `verdict` (of one pose).

    From data edges `data` assigned to model edges `model`; `margin` [m] lost at silhouettes, `rms` [m] of readings off faces,
    `sigma` [m] how far its loosest point could be off, given what was found.
    """

    part: Part
    R: NDArray
    t: NDArray
    margin: float
    rms: float
    sigma: float
    verdict: Verdict
    data: tuple[int, ...]
    model: tuple[int, ...]
    entry: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", frozen_array(self.R))
        object.__setattr__(self, "t", frozen_array(self.t))

    @property
    def support(self) -> float:
        """Rank [m] among candidates."""
        return float(self.verdict.support[0])


def candidates_of(search: Search, part: Part) -> list[Candidate]:
    """Distinct refined poses of one part, best supported first."""
    start = time.perf_counter()
    found = _hypotheses(search, part)
    search.timing["hypothesize"] += time.perf_counter() - start
    option = f"{part.name}: {len(found.t)} hypotheses from {found.tried} assignments of edge pairs"
    parent = search.ledger.add("hypothesize", option, None if len(found.t) else "no pair of edges fits the part")
    if not len(found.t):
        return []
    start = time.perf_counter()
    possible = unopposed(found.R, found.t, part_samples(part), search.evidence, search.rough)
    search.fell["the sensor sees through it"] += len(found.t) - len(possible)
    found = found.rows(possible)
    verdict = verify(found.R, found.t, part_samples(part), search.evidence, search.rough, EVERY)
    order = np.argsort(-verdict.support, kind="stable")
    kept = distinct(found.R, found.t, order, part, _apart(search, part), search.options.max_refined, MOST_A_PLACE)
    search.timing["verify"] += time.perf_counter() - start
    start = time.perf_counter()
    refined, verdict, kept = _refined(search, part, found.R[kept], found.t[kept], kept)
    search.timing["refine"] += time.perf_counter() - start
    return [_candidate(search, part, refined, verdict, k, found.data[n], found.model[n], parent) for k, n in enumerate(kept)]


def polished(search: Search, candidate: Candidate, samples: PartSamples) -> Candidate:
    """A candidate refined once more from other, denser samples, and verified again."""
    refined = refine(candidate.R[None], candidate.t[None], samples, search.evidence, search.limits, search.weights, LAST_STEPS)
    verdict = verify(refined.R, refined.t, part_samples(candidate.part), search.evidence, search.limits)
    sigma = _loosest(candidate.part, refined.R[0], refined.covariance[0])
    margin, rms = float(refined.margin[0]), float(refined.rms[0])
    return Candidate(
        candidate.part, refined.R[0], refined.t[0], margin, rms, sigma, verdict, candidate.data, candidate.model, candidate.entry
    )


def _apart(search: Search, part: Part) -> float:
    """Poses nearer to one another than this [m] will refine to one."""
    return max(SAME_SHARE * part.solid.diameter, 0.5 * search.view.outline_error)


def _hypotheses(search: Search, part: Part) -> Assignments:
    """Transforms from pairs of the data edges that are not too long for the part; `data` holds their numbers among all edges."""
    edges, limits, most = model_edges(part), search.tolerances, search.options.max_hypotheses
    longest, reach = 2.0 * float(edges.half.max()) + limits.reach, part.solid.diameter + limits.reach
    numbers = np.array([i for i, edge in enumerate(search.edges) if edge.length <= longest][: search.options.max_data_edges], dtype=int)
    lines = data_lines(tuple(search.edges[i] for i in numbers))
    found = joined(
        hypothesize(edges, model_pairs(part), lines, data_pairs(lines, reach), limits, most),
        hypothesize_parallel(edges, model_parallels(part), lines, data_parallels(lines, reach, limits.angle), limits, most),
    )
    search.fell.update({reason: int(n) for reason, n in zip(FELL, found.fell, strict=True) if n})
    return found._replace(data=numbers[found.data])


def _refined(search: Search, part: Part, R: NDArray, t: NDArray, numbers: NDArray) -> tuple[Refined, Verdict, NDArray]:
    """Poses refined, those that met taken for one, the promising ones refined again; their verdicts, and their `numbers`."""
    samples, few = part_samples(part), thinned(part)
    first = refine(R, t, few, search.evidence, search.rough, search.weights, FIRST_STEPS)
    support = verify(first.R, first.t, few, search.evidence, search.rough).support
    kept = distinct(first.R, first.t, np.argsort(-support, kind="stable"), part, _apart(search, part), MOST_REFINED_AGAIN, 3)
    last = refine(first.R[kept], first.t[kept], samples, search.evidence, search.limits, search.weights, LAST_STEPS)
    verdict = verify(last.R, last.t, samples, search.evidence, search.limits)
    best = distinct(last.R, last.t, np.argsort(-verdict.support, kind="stable"), part, _apart(search, part), len(kept))
    return last.rows(best), verdict.rows(best), numbers[kept[best]]


def _candidate(
    search: Search, part: Part, refined: Refined, verdict: Verdict, k: int, data: NDArray, model: NDArray, parent: int
) -> Candidate:
    entry = search.ledger.add("verify", f"{part.name} from edges {data[0]} and {data[1]}", parent=parent)
    sigma = _loosest(part, refined.R[k], refined.covariance[k])
    numbers = (tuple(int(i) for i in data), tuple(int(i) for i in model))
    margin, rms = float(refined.margin[k]), float(refined.rms[k])
    return Candidate(part, refined.R[k], refined.t[k], margin, rms, sigma, verdict.rows(np.array([k])), *numbers, entry)


def _loosest(part: Part, R: NDArray, covariance: NDArray) -> float:
    """Standard deviation [m] of the part's loosest point in its loosest direction, from a pose's covariance (6, 6)."""
    worst = 0.0
    for x, y, z in probe_points(part)[0] @ R.T:
        J = np.array([[0.0, z, -y, 1.0, 0.0, 0.0], [-z, 0.0, x, 0.0, 1.0, 0.0], [y, -x, 0.0, 0.0, 0.0, 1.0]])  # of a small turn and shift
        worst = max(worst, float(np.linalg.eigvalsh(J @ covariance @ J.T)[-1]))
    return float(np.sqrt(max(worst, 0.0)))
