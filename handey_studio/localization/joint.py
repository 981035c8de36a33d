"""Explain the view jointly: how probable each pose is beside its rivals, and which can stand together and explain most.

Two poses are rivals when they claim the same readings, pass through one another, or are one pose of one part. Of rivals at most one is
right, perhaps none: their odds share the probability. Choosing the greatest total worth among poses
without rivals is a weighted independent set; its connected groups are small, and are solved exactly.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from handey_studio.localization.candidates import Candidate
from handey_studio.localization.distinct import displacement
from handey_studio.localization.marginals import marginals
from handey_studio.localization.overlap import overlap_depth
from handey_studio.localization.render import claimed_pixels
from handey_studio.localization.result import pose_matrix
from handey_studio.localization.search import Search

MAX_CLAIMED = 0.3  # share of the readings that the smaller claim holds, which two poses may both claim
SAME_SHARE = 0.1  # of a part's diameter: poses nearer than this are one
MAX_EXACT = 24  # poses in one group of rivals; larger groups keep their best
SAME_POSE = "the same as a better pose"
SAME_READINGS = "its surface is explained by a better pose"
WITHIN = "it would pass through a better pose"


class Rivalry(NamedTuple):
    """Why two poses cannot both stand."""

    reason: str
    value: float
    limit: float
    unit: str


Rivals = Mapping[tuple[int, int], Rivalry]  # by the numbers of two candidates, the smaller one first


class Explanation(NamedTuple):
    """`chosen` numbers of candidates that stand together, of most worth first; `fell` tells beside which better one, and
    why, each other one cannot stand."""

    chosen: list[int]
    fell: dict[int, tuple[int, Rivalry]]


def rivals_among(search: Search, candidates: Sequence[Candidate]) -> Rivals:
    """Why two of the candidates cannot both stand, for each two that cannot."""
    shares, found = claims_shared(search, candidates), {}
    for b in range(len(candidates)):
        for a in range(b):
            rivalry = _rivalry(search, candidates[a], candidates[b], float(shares[a, b]))
            if rivalry is not None:
                found[a, b] = rivalry
    return found


def claims_shared(search: Search, candidates: Sequence[Candidate]) -> NDArray:
    """(n, n) of the readings that lie on the one of two candidates that claims fewer, the share that lies on the other too."""
    if not candidates:
        return np.zeros((0, 0))
    claims = [_claim(search, candidate) for candidate in candidates]
    count, pixels = np.array([len(claim) for claim in claims], dtype=int), np.concatenate(claims)
    first = np.concatenate([[0], np.cumsum(count)])
    held = csr_array((np.ones(len(pixels), dtype=int), pixels, first), shape=(len(claims), search.evidence.depth.size))
    return (held @ held.T).toarray() / np.maximum(np.minimum(count[:, None], count), 1)


def probabilities(odds: NDArray, rivals: Rivals) -> NDArray:
    """(n,) how probable each candidate's pose is, given the logarithm (n,) of its odds against nothing that is known standing there: of
    all ways in which candidates can stand together the share, by what they are worth, in which it or the same pose stands."""
    excluded, same = [0] * len(odds), np.eye(len(odds))
    for (a, b), rivalry in rivals.items():
        excluded[a] |= 1 << b
        excluded[b] |= 1 << a
        same[a, b] = same[b, a] = rivalry.reason == SAME_POSE
    return np.minimum(same @ marginals(odds, excluded), 1.0)


def explain_jointly(worth: Sequence[float], rivals: Rivals) -> Explanation:
    """The candidates that can stand together and are of the greatest total worth."""
    chosen: list[int] = []
    for group in _groups(len(worth), rivals):
        chosen += _best_of(sorted(group, key=lambda n: -worth[n])[:MAX_EXACT], np.asarray(worth), rivals)
    chosen.sort(key=lambda n: -worth[n])
    fell = {}
    for n in set(range(len(worth))) - set(chosen):
        beside = sorted((k for pair in rivals if n in pair for k in pair if k != n), key=lambda k: (k not in chosen, -worth[k]))
        fell[n] = (beside[0], rivals[min(n, beside[0]), max(n, beside[0])])
    return Explanation(chosen, fell)


def _rivalry(search: Search, a: Candidate, b: Candidate, shared: float) -> Rivalry | None:
    if not _near(a, b):
        return None
    T_a, T_b = pose_matrix(a.R, a.t), pose_matrix(b.R, b.t)
    near = SAME_SHARE * a.part.solid.diameter
    if a.part.name == b.part.name and (moved := displacement(T_a, T_b, a.part)) < near:
        return Rivalry(SAME_POSE, moved, near, "m")
    if shared > MAX_CLAIMED:
        return Rivalry(SAME_READINGS, shared, MAX_CLAIMED, "")
    tolerance = 6.0 * search.view.noise + search.view.outline_error
    through = overlap_depth(a.part, T_a, b.part, T_b)
    return Rivalry(WITHIN, through, tolerance, "m") if through > tolerance else None


def _near(a: Candidate, b: Candidate) -> bool:
    """Whether the spheres around both could touch."""
    (middle_a, middle_b) = (c.part.solid.volume_and_centroid[1] @ c.R.T + c.t for c in (a, b))
    return float(np.linalg.norm(middle_a - middle_b)) < a.part.solid.diameter + b.part.solid.diameter


def _claim(search: Search, candidate: Candidate) -> NDArray:
    """Numbers (k,) of the pixels whose readings lie on the posed part."""
    solid = candidate.part.solid
    return claimed_pixels(solid.vertices @ candidate.R.T + candidate.t, solid.triangles, search.evidence, search.limits.agree)


def _groups(n: int, rivals: Rivals) -> list[list[int]]:
    """Candidates connected by rivalry."""
    group = list(range(n))
    for a, b in rivals:
        old, new = group[b], group[a]
        group = [new if number == old else number for number in group]
    return [[k for k in range(n) if group[k] == number] for number in sorted(set(group))]


def _best_of(group: list[int], worth: NDArray, rivals: Rivals) -> list[int]:
    """The subset without rivals of the greatest total worth, by branch and bound over the group, best first."""
    best: tuple[float, list[int]] = (0.0, [])

    def extend(rest: list[int], total: float, taken: list[int]) -> None:
        nonlocal best
        if total > best[0]:
            best = (total, taken)
        if not rest or total + worth[rest].sum() <= best[0]:
            return
        first, others = rest[0], rest[1:]
        extend([n for n in others if (min(n, first), max(n, first)) not in rivals], total + worth[first], [*taken, first])
        extend(others, total, taken)

    extend(group, 0.0, [])
    return best[1]
