"""Locate parts in a view: hypothesize from pairs of edges, verify, refine, accept the best (Handey 1987 §3)."""

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Progress, Silent
from handey_studio.localization.distinct import displacement, distinct
from handey_studio.localization.edges import edge_pixels
from handey_studio.localization.evidence import Evidence, evidence_of, limits_of
from handey_studio.localization.hypotheses import FELL, hypothesize, tolerances
from handey_studio.localization.overlap import overlap_depth
from handey_studio.localization.pairs import data_lines, data_pairs, model_edges, model_pairs
from handey_studio.localization.refine import refine, weights_of
from handey_studio.localization.render import rendered_depth
from handey_studio.localization.result import Hypothesis, LocatedPose, LocateOptions, LocateResult, pose_matrix
from handey_studio.localization.samples import DENSER, part_samples
from handey_studio.localization.segments import DataEdge, data_edges, link
from handey_studio.localization.surface import surface_of
from handey_studio.localization.verify import Verdict, edge_tally, verify
from handey_studio.sensing.depth_view import DepthView
from handey_studio.world.part import Part

ROUGH = 1.8  # tolerances of poses straight from two edges, against those of refined ones
SHOWN = 50  # hypotheses that go to the screen
MIN_EDGE_PX = 8.0
STAGES = ("edges", "evidence", "hypothesize", "verify", "refine", "accept")
TABLE_SHARE = 0.02  # of the readings that must lie at the table's height before the table is believed in


@dataclass
class _Search:
    """What one call looks at, and what it writes down."""

    view: DepthView
    evidence: Evidence
    edges: tuple[DataEdge, ...]
    options: LocateOptions
    pixel: float
    table: bool
    models: dict[str, Part]
    ledger: Ledger
    fell: Counter[str]
    timing: dict[str, float]


class _Candidate(NamedTuple):
    """A refined pose of one part."""

    part: Part
    R: NDArray
    t: NDArray
    margin: float
    rms: float
    data: tuple[int, ...]
    entry: int


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
    search = _look(view, parts, options)
    candidates: list[_Candidate] = []
    for number, part in enumerate(parts):
        progress.report(number / max(len(parts), 1), f"matching {len(search.edges)} edges with {part.name}")
        if progress.cancelled:
            break
        candidates += _candidates(search, part)
    poses, hypotheses = _accept(search, candidates)
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


def _look(view: DepthView, parts: Sequence[Part], options: LocateOptions) -> _Search:
    """Edges and evidence of a view."""
    timing: dict[str, float] = dict.fromkeys(STAGES, 0.0)
    start = time.perf_counter()
    surface = surface_of(view)
    pixels = edge_pixels(view, surface)
    linked = link(view, surface, pixels)
    shortest = options.min_edge_m if options.min_edge_m is not None else MIN_EDGE_PX * surface.pixel
    edges = data_edges(view, surface, pixels, linked, shortest)
    timing["edges"] = time.perf_counter() - start
    start = time.perf_counter()
    evidence = evidence_of(view, surface, linked)
    timing["evidence"] = time.perf_counter() - start
    ledger = Ledger()
    ledger.add("edges", f"{len(edges)} straight edges in the depth map", None if edges else "no straight edge found")
    models = {part.name: part for part in parts}
    return _Search(view, evidence, edges, options, surface.pixel, _sees_table(view, options), models, ledger, Counter(), timing)


def _sees_table(view: DepthView, options: LocateOptions) -> bool:
    """Whether enough readings lie at the table's height for it to be there."""
    if options.table_z_m is None:
        return False
    points = view.points_sensor()
    z = points @ view.T_world_sensor[2, :3] + view.T_world_sensor[2, 3] - options.table_z_m
    z = z[np.isfinite(z)]
    return bool(len(z)) and bool(np.mean(np.abs(z) < 5.0 * view.noise) > TABLE_SHARE)


def _candidates(search: _Search, part: Part) -> list[_Candidate]:
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


def _refined(search: _Search, part: Part, R: NDArray, t: NDArray, data: NDArray, parent: int, apart: float) -> list[_Candidate]:
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
        out.append(_Candidate(part, R[k], t[k], float(margin[k]), float(rms[k]), tuple(int(i) for i in data[k]), entry))
    return out


def _accept(search: _Search, candidates: list[_Candidate]) -> tuple[list[LocatedPose], list[Hypothesis]]:
    """The best candidate, then the best of the rest without the readings that it explains, and so on."""
    start = time.perf_counter()
    accepted: list[LocatedPose] = []
    shown: list[tuple[float, Hypothesis]] = []
    rest = candidates
    while rest:
        judged = sorted(((_judge(search, c), c) for c in rest), key=lambda pair: -pair[0].support[0])
        taken_one = False
        rest = []
        for verdict, candidate in judged:
            fall = _objection(search, candidate, verdict, accepted)
            if fall is None and not taken_one:
                candidate = _polished(search, candidate)
                verdict = _judge(search, candidate)
                accepted.append(_located(search, candidate, verdict))
                _take(search, candidate)
                taken_one = True
                shown.append((float(verdict.support[0]), _hypothesis(search, candidate, verdict, None)))
            elif fall is None:
                rest.append(candidate)
            else:
                reason, value, limit, unit = fall
                search.ledger.fall(candidate.entry, reason, value=value, limit=limit, unit=unit)
                shown.append((float(verdict.support[0]), _hypothesis(search, candidate, verdict, reason)))
    search.timing["accept"] = time.perf_counter() - start
    shown.sort(key=lambda pair: (pair[1].reason is not None, -pair[0]))
    return accepted, [hypothesis for _, hypothesis in shown]


def _polished(search: _Search, candidate: _Candidate) -> _Candidate:
    """Refined once more, from many more readings."""
    weights, limits = weights_of(search.view, search.pixel), limits_of(search.view)
    samples = part_samples(candidate.part, DENSER)
    R, t, margin, rms = refine(candidate.R[None], candidate.t[None], samples, search.evidence, limits, weights, 6)
    return candidate._replace(R=R[0], t=t[0], margin=float(margin[0]), rms=float(rms[0]))


def _judge(search: _Search, candidate: _Candidate) -> Verdict:
    return verify(candidate.R[None], candidate.t[None], part_samples(candidate.part), search.evidence, limits_of(search.view))


def _objection(
    search: _Search, candidate: _Candidate, verdict: Verdict, accepted: list[LocatedPose]
) -> tuple[str, float, float, str] | None:
    """The first thing that speaks against a candidate: reason, value, limit, unit."""
    options, part = search.options, candidate.part
    models = search.models
    instances = [pose for pose in accepted if pose.part == part.name]
    T = pose_matrix(candidate.R, candidate.t)
    if len(instances) >= options.max_poses:
        return "as many poses as asked for were found", len(instances), options.max_poses, ""
    moved = min((displacement(T, pose.T_sensor_part, part) for pose in instances), default=np.inf)
    if moved < 0.1 * part.solid.diameter:
        return "the same as a better pose", moved, 0.1 * part.solid.diameter, "m"
    claimed = float(verdict.taken[0] / max(verdict.on[0], 1e-12))
    if claimed > 0.3:
        return "its surface is explained by a better pose", claimed, 0.3, ""
    tolerance = 6.0 * search.view.noise + search.view.outline_error
    through = max((overlap_depth(part, T, models[pose.part], pose.T_sensor_part) for pose in accepted), default=0.0)
    if through > tolerance:
        return "it would pass through a better pose", through, tolerance, "m"
    depth = _below_table(search, candidate)
    allowed = 6.0 * search.view.noise + 0.5 * search.view.outline_error
    if depth > allowed:
        return "it would stand below the table", depth, allowed, "m"
    if verdict.visible_fraction[0] < options.min_visible_fraction:
        return "too little of it is seen", float(verdict.visible_fraction[0]), options.min_visible_fraction, ""
    if verdict.surface_share[0] < options.min_surface_share:
        return "the sensor sees through it", float(verdict.surface_share[0]), options.min_surface_share, ""
    if verdict.edge_share[0] < options.min_edge_share:
        return "edges that should be seen are missing", float(verdict.edge_share[0]), options.min_edge_share, ""
    if _score(verdict) < options.min_score:
        return "the score is too low", _score(verdict), options.min_score, ""
    return None


def _below_table(search: _Search, candidate: _Candidate) -> float:
    """How far [m] the pose reaches below the table, zero where no table is seen."""
    if not search.table or search.options.table_z_m is None:
        return 0.0
    T_world_part = search.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
    return max(0.0, search.options.table_z_m - candidate.part.lowest(T_world_part))


def _score(verdict: Verdict) -> float:
    return float(verdict.edge_share[0] * verdict.surface_share[0])


def _located(search: _Search, candidate: _Candidate, verdict: Verdict) -> LocatedPose:
    T = pose_matrix(candidate.R, candidate.t)
    predicted, found = edge_tally(candidate.R, candidate.t, part_samples(candidate.part), search.evidence, limits_of(search.view))
    return LocatedPose(
        candidate.part.name,
        search.view.T_world_sensor @ T,
        T,
        _score(verdict),
        predicted,
        found,
        float(verdict.visible_fraction[0]),
        candidate.rms,
        candidate.margin,
    )


def _hypothesis(search: _Search, candidate: _Candidate, verdict: Verdict, reason: str | None) -> Hypothesis:
    T_world_part = search.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
    found, missing = float(verdict.found[0]), float(verdict.missing[0])
    return Hypothesis(candidate.part.name, T_world_part, _score(verdict), found, missing, candidate.data, reason)


def _take(search: _Search, candidate: _Candidate) -> None:
    """Mark the readings that an accepted pose explains."""
    solid = candidate.part.solid
    corners = solid.vertices @ candidate.R.T + candidate.t
    drawn = rendered_depth(corners, solid.triangles, search.view.depth.shape, search.evidence.camera)
    with np.errstate(invalid="ignore"):
        search.evidence.taken[np.abs(search.view.depth - drawn) < limits_of(search.view).agree] = True


def _why_none(search: _Search, parts: Sequence[Part], hypotheses: list[Hypothesis]) -> str:
    """One sentence."""
    names = ", ".join(part.name for part in parts) or "no part"
    if not search.edges:
        return f"{names} not found: the depth map shows no straight edge."
    if not hypotheses:
        return f"{names} not found: none of the {len(search.edges)} edges pair up as the part's do."
    best = max(hypotheses, key=lambda hypothesis: hypothesis.found_m - hypothesis.missing_m)
    return f"{names} not found: the best of {len(hypotheses)} hypotheses fell because {best.reason}."
