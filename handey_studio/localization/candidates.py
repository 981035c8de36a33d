"""Candidates: the poses of one part that edge pairs propose, verified roughly, told apart, refined and verified again (Handey 1987 §3)."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.localization.distinct import distinct, probe_points
from handey_studio.localization.glance import unopposed
from handey_studio.localization.hypotheses import FELL, Assignments, hypothesize, joined
from handey_studio.localization.pairs import data_lines, data_pairs, data_parallels, model_edges, model_pairs, model_parallels
from handey_studio.localization.parallel_hypotheses import hypothesize_parallel
from handey_studio.localization.promise import FITTED, promise_features
from handey_studio.localization.refine import Refined, refine
from handey_studio.localization.samples import DENSER, part_samples, thinned
from handey_studio.localization.score import Rated, Score, scores
from handey_studio.localization.search import Search, footing
from handey_studio.localization.second_look import second_look
from handey_studio.localization.single_hypotheses import hypothesize_single
from handey_studio.localization.verify import Verdict, verify
from handey_studio.world.part import Part

FAR_BELOW = 6.0  # slacks below the table, beyond which a rough pose is not worth refining
SAME_SHARE = 0.04  # of a part's diameter: hypotheses nearer than this are one
EVERY = 6  # samples that the first verification looks at: one in so many
FIRST_STEPS, LAST_STEPS = 4, 8  # of refinement, with few samples over rough limits, and with all over tight ones
MOST_A_PLACE = 20  # hypotheses refined of those whose middles lie together
MOST_REFINED_AGAIN, MOST_AGAIN_A_PLACE = 24, 4
MOST_POLISHED, POLISHED_FROM = 8, 0.01  # poses refined from all readings, and how probable they must be


Watch = Callable[[str, NDArray, NDArray, NDArray], None]  # is shown "rough" or "refined" poses R, t and their features of promise


@dataclass(frozen=True, eq=False)
class Candidate(Value):
    """A refined pose `R` (3, 3), `t` (3,) [m] of a part in the sensor's frame and its `verdict` (of one pose).

    From the one or two data edges `data` assigned to model edges `model`; `margin` [m] lost at silhouettes, `rms` [m] of readings
    off faces, `sigma` [m] how far its loosest point could be off, given what was found; `below` [m] the table; the `score`.
    """

    part: Part
    R: NDArray
    t: NDArray
    margin: float
    rms: float
    sigma: float
    below: float
    verdict: Verdict
    score: Score
    data: tuple[int, ...]
    model: tuple[int, ...]
    entry: int = -1

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", frozen_array(self.R))
        object.__setattr__(self, "t", frozen_array(self.t))


def candidates_of(search: Search, part: Part, watch: Watch | None = None) -> list[Candidate]:
    """Distinct refined poses of one part, most probable first. `watch` is shown all that were ranked on the way."""
    start = time.perf_counter()
    found = _hypotheses(search, part)
    search.timing["hypothesize"] += time.perf_counter() - start
    option = f"{part.name}: {len(found.t)} hypotheses from {found.tried} assignments of edge pairs"
    parent = search.ledger.add("hypothesize", option, None if len(found.t) else "no pair of edges fits the part")
    if not len(found.t):
        return []
    start = time.perf_counter()
    found = _possible(search, part, found)
    if not len(found.t):
        return []
    verdict = verify(found.R, found.t, part_samples(part), search.evidence, search.rough, EVERY)
    promise = promise_features(search, part, found.R, found.t, verdict)
    if watch is not None:
        watch("rough", found.R, found.t, promise)
    order = np.argsort(-(promise @ FITTED.rough), kind="stable")
    kept = distinct(found.R, found.t, order, part, _apart(search, part), search.options.max_refined, MOST_A_PLACE)
    search.timing["verify"] += time.perf_counter() - start
    start = time.perf_counter()
    made = _refined(search, part, found.rows(kept), watch)
    search.timing["refine"] += time.perf_counter() - start
    entries = [search.ledger.add("verify", f"{part.name} from {_origin(c.data)}", parent=parent) for c in made]
    return [replace(candidate, entry=entry) for candidate, entry in zip(made, entries, strict=True)]


def _origin(data: tuple[int, ...]) -> str:
    return f"edges {data[0]} and {data[1]}" if len(data) == 2 else f"edge {data[0]} and the surface beside it"


def _possible(search: Search, part: Part, found: Assignments) -> Assignments:
    """Those that a glance does not rule out."""
    above = np.nonzero(~(footing(search, part, found.R, found.t)[:, 0] < -FAR_BELOW * search.slack))[0]
    search.fell["it would stand below the table"] += len(found.t) - len(above)
    found = found.rows(above)
    possible = unopposed(found.R, found.t, part_samples(part), search.evidence, search.rough)
    search.fell["the sensor sees through it"] += len(found.t) - len(possible)
    return found.rows(possible)


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
        hypothesize_single(edges, lines, limits, most),
    )
    search.fell.update({reason: int(n) for reason, n in zip(FELL, found.fell, strict=True) if n})
    return found._replace(data=numbers[found.data])


def _refined(search: Search, part: Part, found: Assignments, watch: Watch | None) -> list[Candidate]:
    """Poses refined, those that met taken for one, the most probable refined again, and of these the most probable polished."""
    samples, few, apart = part_samples(part), thinned(part), _apart(search, part)
    first = refine(found.R, found.t, few, search.evidence, search.rough, search.weights, FIRST_STEPS)
    verdict = verify(first.R, first.t, few, search.evidence, search.limits)
    promise = promise_features(search, part, first.R, first.t, verdict)
    if watch is not None:
        watch("refined", first.R, first.t, promise)
    order = np.argsort(-(promise @ FITTED.refined), kind="stable")
    kept = distinct(first.R, first.t, order, part, apart, MOST_REFINED_AGAIN, MOST_AGAIN_A_PLACE)
    last = refine(first.R[kept], first.t[kept], samples, search.evidence, search.limits, search.weights, LAST_STEPS)
    rated = rate(search, part, last, verify(last.R, last.t, samples, search.evidence, search.limits))
    best = distinct(last.R, last.t, _order(search, part, rated), part, apart, len(kept))
    made = _candidates(search, part, last.rows(best), rated.rows(best), found.rows(kept[best]))
    worth_it = sum(candidate.score.probability > POLISHED_FROM for candidate in made[:MOST_POLISHED])
    polished = _polished(search, part, last.rows(best[:worth_it]), found.rows(kept[best[:worth_it]]))
    return sorted([*polished, *made[worth_it:]], key=lambda candidate: -candidate.score.probability)


def _polished(search: Search, part: Part, refined: Refined, found: Assignments) -> list[Candidate]:
    """Candidates from poses refined once more from many more readings, and verified again."""
    dense = part_samples(part, DENSER)
    last = refine(refined.R, refined.t, dense, search.evidence, search.limits, search.weights, LAST_STEPS)
    verdict = verify(last.R, last.t, part_samples(part), search.evidence, search.limits)
    return _candidates(search, part, last, rate(search, part, last, verdict), found)


def _order(search: Search, part: Part, rated: Rated) -> NDArray:
    """Numbers of poses, most probable first."""
    return np.argsort([-score.probability for score in scores(search, part, rated)], kind="stable")


def rate(search: Search, part: Part, refined: Refined, verdict: Verdict) -> Rated:
    """How refined poses of a part rate, given their verdict, at a second look."""
    tally = second_look(part, refined.R, refined.t, search.evidence, search.view.noise)
    sigma = _loosest(part, refined.R, refined.covariance)
    return Rated(verdict, refined.margin, refined.rms, sigma, footing(search, part, refined.R, refined.t), tally)


def _candidates(search: Search, part: Part, refined: Refined, rated: Rated, found: Assignments) -> list[Candidate]:
    return [
        Candidate(
            part,
            refined.R[k],
            refined.t[k],
            float(refined.margin[k]),
            float(refined.rms[k]),
            float(rated.sigma[k]),
            float(rated.below[k]),
            rated.verdict.rows(np.array([k])),
            score,
            tuple(dict.fromkeys(int(i) for i in found.data[k])),
            tuple(dict.fromkeys(int(i) for i in found.model[k])),
        )
        for k, score in enumerate(scores(search, part, rated))
    ]


def _loosest(part: Part, R: NDArray, covariance: NDArray) -> NDArray:
    """Standard deviation (n,) [m] of the part's loosest point in its loosest direction, from poses' covariances (n, 6, 6)."""
    points = np.einsum("nij,pj->npi", R, probe_points(part)[0])
    J = np.zeros((*points.shape[:2], 3, 6))  # of a small turn and shift
    J[..., :3, 3:] = np.eye(3)
    for row, column, axis, sign in ((0, 1, 2, 1), (0, 2, 1, -1), (1, 0, 2, -1), (1, 2, 0, 1), (2, 0, 1, 1), (2, 1, 0, -1)):
        J[..., row, column] = sign * points[..., axis]
    spread = np.einsum("npij,njk,nplk->npil", J, covariance, J)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(spread)[..., -1].max(axis=1), 0.0))
