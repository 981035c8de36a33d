"""Accept: what could stand by itself, then what explains the view jointly, refined once more from all that is seen."""

import time

from handey_studio.localization.candidates import Candidate, polished
from handey_studio.localization.joint import explain_jointly
from handey_studio.localization.result import Hypothesis, LocatedPose, pose_matrix
from handey_studio.localization.samples import DENSER, part_samples
from handey_studio.localization.score import score
from handey_studio.localization.search import Search

Fall = tuple[str, float, float, str]  # reason, value, limit, unit
MOST_RIVALS = 60  # candidates that are weighed against one another


def accept(search: Search, candidates: list[Candidate]) -> tuple[list[LocatedPose], list[Hypothesis]]:
    """The poses that stand, best first, and every candidate with why it fell: the accepted first, then by rank."""
    start = time.perf_counter()
    falls = {n: fall for n, candidate in enumerate(candidates) if (fall := _objection(search, candidate)) is not None}
    ranked = sorted((n for n in range(len(candidates)) if n not in falls), key=lambda n: -candidates[n].support)
    falls.update({n: ("too many better poses", k, MOST_RIVALS, "") for k, n in enumerate(ranked) if k >= MOST_RIVALS})
    standing = ranked[:MOST_RIVALS]
    joint = explain_jointly(search, [candidates[n] for n in standing])
    for n, (_, rivalry) in joint.fell.items():
        falls[standing[n]] = (rivalry.reason, rivalry.value, rivalry.limit, rivalry.unit)
    accepted = []
    count: dict[str, int] = {}
    for n in (standing[k] for k in joint.chosen):
        name = candidates[n].part.name
        if count.get(name, 0) >= search.options.max_poses:
            falls[n] = ("as many poses as asked for were found", count[name], search.options.max_poses, "")
            continue
        count[name] = count.get(name, 0) + 1
        accepted.append(polished(search, candidates[n], part_samples(candidates[n].part, DENSER)))
    for n, (reason, value, limit, unit) in sorted(falls.items()):
        search.ledger.fall(candidates[n].entry, reason, value=value, limit=limit, unit=unit)
    rejected = sorted(falls, key=lambda n: -candidates[n].support)
    hypotheses = [_hypothesis(search, c, None) for c in accepted] + [_hypothesis(search, candidates[n], falls[n][0]) for n in rejected]
    search.timing["accept"] = time.perf_counter() - start
    return sorted((_located(search, c) for c in accepted), key=lambda pose: -pose.score), hypotheses


def _objection(search: Search, candidate: Candidate) -> Fall | None:
    """The first thing that speaks against a candidate by itself."""
    options, verdict = search.options, candidate.verdict
    depth = _below_table(search, candidate)
    allowed = 6.0 * search.view.noise + 0.5 * search.view.outline_error
    if depth > allowed:
        return "it would stand below the table", depth, allowed, "m"
    if verdict.visible_fraction[0] < options.min_visible_fraction:
        return "too little of it is seen", float(verdict.visible_fraction[0]), options.min_visible_fraction, ""
    probability = score(search, candidate)
    if probability < options.min_score:
        return _worst(candidate), probability, options.min_score, ""
    return None


def _worst(candidate: Candidate) -> str:
    """What speaks most against a candidate whose score is too low."""
    verdict = candidate.verdict
    if 1.0 - verdict.surface_share[0] > 0.5 * (1.0 - verdict.edge_share[0]):
        return "the sensor sees through it"
    return "edges that should be seen are missing"


def _below_table(search: Search, candidate: Candidate) -> float:
    """How far [m] the pose reaches below the table, zero where no table is seen."""
    if not search.table or search.options.table_z_m is None:
        return 0.0
    T_world_part = search.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
    return max(0.0, search.options.table_z_m - candidate.part.lowest(T_world_part))


def _located(search: Search, candidate: Candidate) -> LocatedPose:
    T, verdict = pose_matrix(candidate.R, candidate.t), candidate.verdict
    return LocatedPose(
        candidate.part.name,
        search.view.T_world_sensor @ T,
        T,
        score(search, candidate),
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
    numbers = candidate.data, reason, candidate.model, candidate.entry
    return Hypothesis(candidate.part.name, T_world_part, score(search, candidate), found, missing, *numbers)
