"""Explain the view jointly: of the poses that could stand, those that can stand together and explain most.

Two poses are rivals when they claim the same readings, pass through one another, or are one pose of one part. Choosing the
greatest total worth among poses without rivals is a weighted independent set; its connected groups are small, and are
solved exactly.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.candidates import Candidate
from handey_studio.localization.distinct import displacement
from handey_studio.localization.overlap import overlap_depth
from handey_studio.localization.render import claimed_pixels
from handey_studio.localization.result import pose_matrix
from handey_studio.localization.search import Search

MAX_CLAIMED = 0.3  # share of the readings that the smaller claim holds, which two poses may both claim
SAME_SHARE = 0.1  # of a part's diameter: poses nearer than this are one
MAX_EXACT = 24  # poses in one group of rivals; larger groups keep their best


class Rivalry(NamedTuple):
    """Why two poses cannot both stand."""

    reason: str
    value: float
    limit: float
    unit: str


class Explanation(NamedTuple):
    """`chosen` numbers of candidates that stand together, of most worth first; `fell` tells why each other one cannot stand beside them."""

    chosen: list[int]
    fell: dict[int, Rivalry]


def explain_jointly(search: Search, candidates: list[Candidate], worth: Sequence[float]) -> Explanation:
    """The candidates that can stand together and are of the greatest total worth."""
    rivals = _rivals(search, candidates)
    chosen: list[int] = []
    for group in _groups(len(candidates), rivals):
        chosen += _best_of(sorted(group, key=lambda n: -worth[n])[:MAX_EXACT], np.asarray(worth), rivals)
    chosen.sort(key=lambda n: -worth[n])
    fell = {}
    for n in set(range(len(candidates))) - set(chosen):
        against = [rivals[min(n, k), max(n, k)] for k in chosen if (min(n, k), max(n, k)) in rivals]
        fell[n] = against[0] if against else Rivalry("better poses take its place", worth[n], worth[chosen[0]], "")
    return Explanation(chosen, fell)


def _rivals(search: Search, candidates: list[Candidate]) -> dict[tuple[int, int], Rivalry]:
    claims = [_claim(search, candidate) for candidate in candidates]
    found = {}
    for b in range(len(candidates)):
        for a in range(b):
            rivalry = _rivalry(search, candidates[a], candidates[b], claims[a], claims[b])
            if rivalry is not None:
                found[a, b] = rivalry
    return found


def _rivalry(search: Search, a: Candidate, b: Candidate, claim_a: NDArray, claim_b: NDArray) -> Rivalry | None:
    T_a, T_b = pose_matrix(a.R, a.t), pose_matrix(b.R, b.t)
    near = SAME_SHARE * a.part.solid.diameter
    if a.part.name == b.part.name and (moved := displacement(T_a, T_b, a.part)) < near:
        return Rivalry("the same as a better pose", moved, near, "m")
    shared = len(np.intersect1d(claim_a, claim_b, assume_unique=True)) / max(1, min(len(claim_a), len(claim_b)))
    if shared > MAX_CLAIMED:
        return Rivalry("its surface is explained by a better pose", shared, MAX_CLAIMED, "")
    tolerance = 6.0 * search.view.noise + search.view.outline_error
    through = overlap_depth(a.part, T_a, b.part, T_b) if _near(a, b) else 0.0
    return Rivalry("it would pass through a better pose", through, tolerance, "m") if through > tolerance else None


def _near(a: Candidate, b: Candidate) -> bool:
    """Whether the spheres around both could touch."""
    (middle_a, middle_b) = (c.part.solid.volume_and_centroid[1] @ c.R.T + c.t for c in (a, b))
    return float(np.linalg.norm(middle_a - middle_b)) < a.part.solid.diameter + b.part.solid.diameter


def _claim(search: Search, candidate: Candidate) -> NDArray:
    """Numbers (k,) of the pixels whose readings lie on the posed part."""
    solid = candidate.part.solid
    return claimed_pixels(solid.vertices @ candidate.R.T + candidate.t, solid.triangles, search.evidence, search.limits.agree)


def _groups(n: int, rivals: dict[tuple[int, int], Rivalry]) -> list[list[int]]:
    """Candidates connected by rivalry."""
    group = list(range(n))
    for a, b in rivals:
        old, new = group[b], group[a]
        group = [new if number == old else number for number in group]
    return [[k for k in range(n) if group[k] == number] for number in sorted(set(group))]


def _best_of(group: list[int], worth: NDArray, rivals: dict[tuple[int, int], Rivalry]) -> list[int]:
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
