"""Locate parts in a view: hypothesize from pairs of edges, verify, refine, accept the best (Handey 1987 §3)."""

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress, Silent
from handey_studio.localization.accept import accept
from handey_studio.localization.distinct import distinct
from handey_studio.localization.evidence import limits_of
from handey_studio.localization.hypotheses import FELL, hypothesize, tolerances
from handey_studio.localization.pairs import data_lines, data_pairs, model_edges, model_pairs
from handey_studio.localization.refine import refine, weights_of
from handey_studio.localization.result import Hypothesis, LocateOptions, LocateResult
from handey_studio.localization.samples import part_samples
from handey_studio.localization.search import Candidate, Search, look
from handey_studio.localization.verify import verify
from handey_studio.sensing.depth_view import DepthView
from handey_studio.world.part import Part

ROUGH = 1.8  # tolerances of poses straight from two edges, against those of refined ones
SHOWN = 50  # hypotheses that go to the screen


def localize(
    view: DepthView,
    parts: Sequence[Part],
    options: LocateOptions | None = None,
    rng: np.random.Generator | None = None,
    progress: Progress | None = None,
) -> LocateResult:
    """The parts that the view shows, best first, several instances of one part if there are.

    Found nothing: a result without poses, whose ledger and `reason` tell why. The search uses no chance; `rng` is taken
    so that all stages are called alike.
    """
    options, progress = options or LocateOptions(), progress or Silent()
    search = look(view, parts, options)
    candidates: list[Candidate] = []
    for number, part in enumerate(parts):
        progress.report(number / max(len(parts), 1), f"matching {len(search.edges)} edges with {part.name}")
        if progress.cancelled:
            break
        candidates += _candidates(search, part)
    poses, hypotheses = accept(search, candidates)
    reason = "" if poses else _why_none(search, parts, hypotheses)
    progress.report(1.0, f"{len(poses)} poses found")
    return LocateResult(
        tuple(poses),
        search.edges,
        tuple(hypotheses[:SHOWN]),
        search.ledger.entries,
        search.timing,
        dict(search.fell),
        reason,
        progress.cancelled,
    )


def _candidates(search: Search, part: Part) -> list[Candidate]:
    """Distinct refined poses of one part, the best by the edges that they predict rightly."""
    start = time.perf_counter()
    longest = 2.0 * float(model_edges(part).half.max()) + tolerances(search.view).reach
    numbers = [i for i, edge in enumerate(search.edges) if edge.length <= longest][: search.options.max_data_edges]
    lines = data_lines(tuple(search.edges[i] for i in numbers))
    found = hypothesize(
        model_edges(part), model_pairs(part), lines, data_pairs(lines), tolerances(search.view), search.options.max_hypotheses
    )
    search.fell.update({reason: int(n) for reason, n in zip(FELL, found.fell, strict=True) if n})
    search.timing["hypothesize"] += time.perf_counter() - start
    option = f"{part.name}: {len(found.t)} hypotheses from {found.tried} assignments of edge pairs"
    parent = search.ledger.add("hypothesize", option, None if len(found.t) else "no pair of edges fits the part")
    if not len(found.t):
        return []
    start = time.perf_counter()
    samples, rough = part_samples(part), limits_of(search.view, ROUGH)
    verdict = verify(found.R, found.t, samples, search.evidence, rough, every=4)
    order = np.argsort(-verdict.support, kind="stable")
    apart = max(0.04 * part.solid.diameter, search.view.outline_error)
    kept = distinct(found.R, found.t, order, part, apart, search.options.max_refined)
    search.timing["verify"] += time.perf_counter() - start
    return _refined(search, part, found.R[kept], found.t[kept], np.array(numbers)[found.data[kept]], parent, apart)


def _refined(search: Search, part: Part, R: NDArray, t: NDArray, data: NDArray, parent: int, apart: float) -> list[Candidate]:
    """Poses refined; those that met are one."""
    start = time.perf_counter()
    samples, weights = part_samples(part), weights_of(search.view, search.pixel)
    R, t, margin, rms = refine(R, t, samples, search.evidence, limits_of(search.view, ROUGH), weights, 8)
    R, t, margin, rms = refine(R, t, samples, search.evidence, limits_of(search.view), weights, 6)
    verdict = verify(R, t, samples, search.evidence, limits_of(search.view))
    kept = distinct(R, t, np.argsort(-verdict.support, kind="stable"), part, apart, len(t))
    search.timing["refine"] += time.perf_counter() - start
    out = []
    for k in kept:
        entry = search.ledger.add("verify", f"{part.name} from edges {data[k, 0]} and {data[k, 1]}", parent=parent)
        out.append(Candidate(part, R[k], t[k], float(margin[k]), float(rms[k]), tuple(int(i) for i in data[k]), entry))
    return out


def _why_none(search: Search, parts: Sequence[Part], hypotheses: list[Hypothesis]) -> str:
    """One sentence."""
    names = ", ".join(part.name for part in parts) or "no part"
    if not search.edges:
        return f"{names} not found: the depth map shows no straight edge."
    if not hypotheses:
        return f"{names} not found: none of the {len(search.edges)} edges pair up as the part's do."
    best = max(hypotheses, key=lambda hypothesis: hypothesis.found_m - hypothesis.missing_m)
    return f"{names} not found: the best of {len(hypotheses)} hypotheses fell because {best.reason}."
