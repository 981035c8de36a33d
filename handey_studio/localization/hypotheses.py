"""Hypothesize: transforms from assigning two model edges to two data edges (Handey 1987 §3)."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.alignment import flanks_agree, frame_of_pair
from handey_studio.localization.pairs import DataLines, ModelEdges, Pairs
from handey_studio.localization.tolerances import MatchTolerances, allowed, sure


class Assignments(NamedTuple):
    """Transforms `R` (n, 3, 3), `t` (n, 3) from the part's to the sensor's frame, the numbers of the data edges and model
    edges that gave them (n, 2), how many assignments were looked at, and how many fell for each of Figure 3's parameters and the rest."""

    R: NDArray
    t: NDArray
    data: NDArray
    model: NDArray
    tried: int
    fell: NDArray

    def rows(self, chosen: NDArray) -> "Assignments":
        """Some of the transforms, by their numbers."""
        return self._replace(R=self.R[chosen], t=self.t[chosen], data=self.data[chosen], model=self.model[chosen])


FELL = (
    "angle α differs",
    "distance d differs",
    "longer than its model edge, or past its end (a1, a2)",
    "surface beside the edge faces another way",
)


def hypothesize(edges: ModelEdges, table: Pairs, lines: DataLines, pairs: Pairs, limits: MatchTolerances, most: int) -> Assignments:
    """At most four transforms for each consistent assignment of a data pair to a model pair; the first `most` of them.

    How far they may lie apart is told by how well the data edges are known; those whose angles are too unsure for the part propose nothing.
    """
    pairs = pairs.rows(sure(edges, lines, pairs.first, pairs.second, limits))
    R, t, numbers, tried, fell = _match(edges, table, lines, pairs, limits, allowed(lines, pairs, limits), most)
    return Assignments(R, t, numbers[:, :2], numbers[:, 2:], int(tried), fell)


def joined(*several: Assignments) -> Assignments:
    """All of them."""
    R, t, data, model = (np.concatenate([getattr(one, key) for one in several]) for key in ("R", "t", "data", "model"))
    return Assignments(R, t, data, model, sum(one.tried for one in several), np.sum([one.fell for one in several], axis=0))


@njit(cache=True)
def _match(edges, table, lines, pairs, limits, allowed, most):
    R_out, t_out = np.empty((most, 3, 3)), np.empty((most, 3))
    numbers = np.empty((most, 4), dtype=np.int64)
    fell = np.zeros(4, dtype=np.int64)
    frame_model, frame_data = np.empty((3, 3)), np.empty((3, 3))
    n = tried = 0
    for p in range(len(pairs.first)):
        i, j = pairs.first[p], pairs.second[p]
        for q in range(len(table.first)):
            a, b = table.first[q], table.second[q]
            tried += 1
            if lines.half[i] > edges.half[a] + limits.reach / 2 or lines.half[j] > edges.half[b] + limits.reach / 2:
                fell[2] += 1
                continue
            for code in range(4):
                s, w = (1.0 if code & 1 else -1.0), (1.0 if code & 2 else -1.0)
                alpha = pairs.alpha[p] if s * w > 0 else np.pi - pairs.alpha[p]
                if abs(alpha - table.alpha[q]) > allowed.alpha[p]:
                    fell[0] += 1
                    continue
                if abs(s * w * pairs.d[p] - table.d[q]) > allowed.d[p]:
                    fell[1] += 1
                    continue
                off1 = abs(s * pairs.foot1[p] - table.foot1[q]) + lines.half[i] - edges.half[a]
                off2 = abs(w * pairs.foot2[p] - table.foot2[q]) + lines.half[j] - edges.half[b]
                if off1 > allowed.past1[p] or off2 > allowed.past2[p]:
                    fell[2] += 1
                    continue
                frame_of_pair(edges.direction[a], edges.direction[b], frame_model)
                frame_of_pair(s * lines.direction[i], w * lines.direction[j], frame_data)
                R = frame_data @ frame_model.T
                if not (flanks_agree(R, edges, a, lines, i, s, limits.flank) and flanks_agree(R, edges, b, lines, j, w, limits.flank)):
                    fell[3] += 1
                    continue
                if n == most:
                    return R_out, t_out, numbers, tried, fell
                for r in range(3):
                    model = data = 0.0
                    for c in range(3):
                        foot = edges.middle[a, c] + table.foot1[q] * edges.direction[a, c]
                        foot += edges.middle[b, c] + table.foot2[q] * edges.direction[b, c]
                        model += R[r, c] * foot / 2
                        R_out[n, r, c] = R[r, c]
                    data += lines.middle[i, r] + pairs.foot1[p] * lines.direction[i, r]
                    data += lines.middle[j, r] + pairs.foot2[p] * lines.direction[j, r]
                    t_out[n, r] = data / 2 - model
                numbers[n, 0], numbers[n, 1], numbers[n, 2], numbers[n, 3] = i, j, a, b
                n += 1
    return R_out[:n], t_out[:n], numbers[:n], tried, fell
