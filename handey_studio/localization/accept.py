"""Accept the best hypothesis, then the best of the rest that claims other readings, until something speaks against all."""

import time

import numpy as np

from handey_studio.localization.distinct import displacement
from handey_studio.localization.evidence import limits_of
from handey_studio.localization.overlap import overlap_depth
from handey_studio.localization.refine import refine, weights_of
from handey_studio.localization.render import rendered_depth
from handey_studio.localization.result import Hypothesis, LocatedPose, pose_matrix
from handey_studio.localization.samples import DENSER, part_samples
from handey_studio.localization.search import Candidate, Search
from handey_studio.localization.verify import Verdict, edge_tally, verify

MAX_CLAIMED = 0.3  # share of a part's seen surface that a better pose may explain too
SAME_SHARE = 0.1  # of a part's diameter: poses nearer than this are one


def accept(search: Search, candidates: list[Candidate]) -> tuple[list[LocatedPose], list[Hypothesis]]:
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


def _polished(search: Search, candidate: Candidate) -> Candidate:
    """Refined once more, from many more readings."""
    weights, limits = weights_of(search.view, search.pixel), limits_of(search.view)
    samples = part_samples(candidate.part, DENSER)
    R, t, margin, rms = refine(candidate.R[None], candidate.t[None], samples, search.evidence, limits, weights, 6)
    return candidate._replace(R=R[0], t=t[0], margin=float(margin[0]), rms=float(rms[0]))


def _judge(search: Search, candidate: Candidate) -> Verdict:
    return verify(candidate.R[None], candidate.t[None], part_samples(candidate.part), search.evidence, limits_of(search.view))


def _objection(search: Search, candidate: Candidate, verdict: Verdict, accepted: list[LocatedPose]) -> tuple[str, float, float, str] | None:
    """The first thing that speaks against a candidate: reason, value, limit, unit."""
    options, part = search.options, candidate.part
    models = search.models
    instances = [pose for pose in accepted if pose.part == part.name]
    T = pose_matrix(candidate.R, candidate.t)
    if len(instances) >= options.max_poses:
        return "as many poses as asked for were found", len(instances), options.max_poses, ""
    moved = min((displacement(T, pose.T_sensor_part, part) for pose in instances), default=np.inf)
    if moved < SAME_SHARE * part.solid.diameter:
        return "the same as a better pose", moved, SAME_SHARE * part.solid.diameter, "m"
    claimed = float(verdict.taken[0] / max(verdict.on[0], 1e-12))
    if claimed > MAX_CLAIMED:
        return "its surface is explained by a better pose", claimed, MAX_CLAIMED, ""
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


def _below_table(search: Search, candidate: Candidate) -> float:
    """How far [m] the pose reaches below the table, zero where no table is seen."""
    if not search.table or search.options.table_z_m is None:
        return 0.0
    T_world_part = search.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
    return max(0.0, search.options.table_z_m - candidate.part.lowest(T_world_part))


def _score(verdict: Verdict) -> float:
    return float(verdict.edge_share[0] * verdict.surface_share[0])


def _located(search: Search, candidate: Candidate, verdict: Verdict) -> LocatedPose:
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


def _hypothesis(search: Search, candidate: Candidate, verdict: Verdict, reason: str | None) -> Hypothesis:
    T_world_part = search.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
    found, missing = float(verdict.found[0]), float(verdict.missing[0])
    return Hypothesis(candidate.part.name, T_world_part, _score(verdict), found, missing, candidate.data, reason)


def _take(search: Search, candidate: Candidate) -> None:
    """Mark the readings that an accepted pose explains."""
    solid = candidate.part.solid
    corners = solid.vertices @ candidate.R.T + candidate.t
    drawn = rendered_depth(corners, solid.triangles, search.view.depth.shape, search.evidence.camera)
    with np.errstate(invalid="ignore"):
        search.evidence.taken[np.abs(search.view.depth - drawn) < limits_of(search.view).agree] = True
