"""Hypotheses from parallel edges, which have no common perpendicular of their own: what an end of one of them adds to the paper's pairs."""

import numpy as np
from numba import njit

from handey_studio.localization.alignment import axes_of, flanks_agree
from handey_studio.localization.hypotheses import Assignments
from handey_studio.localization.pairs import DataLines, ModelEdges, ParallelPairs
from handey_studio.localization.tolerances import MatchTolerances, allowed_apart


def hypothesize_parallel(
    edges: ModelEdges, table: ParallelPairs, lines: DataLines, pairs: ParallelPairs, limits: MatchTolerances, most: int
) -> Assignments:
    """The same for parallel edges, which fix a transform but for its slide along them: an end of a data edge is laid on the
    end of its model edge."""
    R, t, numbers, tried, fell = _match_parallel(edges, table, lines, pairs, limits, allowed_apart(lines, pairs, limits), most)
    return Assignments(R, t, numbers[:, :2], numbers[:, 2:], int(tried), fell)


@njit(cache=True)
def _match_parallel(edges, table, lines, pairs, limits, allowed, most):
    R_out, t_out = np.empty((most, 3, 3)), np.empty((most, 3))
    numbers, fell = np.empty((most, 4), dtype=np.int64), np.zeros(4, dtype=np.int64)
    frame_model, frame_data = np.empty((3, 3)), np.empty((3, 3))
    slides = np.empty(4)
    n = tried = 0
    for p in range(len(pairs.first)):
        i, j = pairs.first[p], pairs.second[p]
        turned = 1.0 if (lines.direction[i] * lines.direction[j]).sum() > 0 else -1.0
        for q in range(len(table.first)):
            a, b = table.first[q], table.second[q]
            tried += 1
            if abs(pairs.d[p] - table.d[q]) > allowed[p]:
                fell[1] += 1
                continue
            if lines.half[i] > edges.half[a] + limits.reach / 2 or lines.half[j] > edges.half[b] + limits.reach / 2:
                fell[2] += 1
                continue
            same = 1.0 if (edges.direction[a] * edges.direction[b]).sum() > 0 else -1.0
            for sign in (-1.0, 1.0):
                axes_of(edges.direction[a], table.across[q], frame_model)
                axes_of(sign * lines.direction[i], pairs.across[p], frame_data)
                R = frame_data @ frame_model.T
                other = sign * turned * same
                if not (
                    flanks_agree(R, edges, a, lines, i, sign, limits.flank) and flanks_agree(R, edges, b, lines, j, other, limits.flank)
                ):
                    fell[3] += 1
                    continue
                # where the middle of edge i lies on model edge a, as an end of one or the other edge says
                skip = sign * pairs.ahead[p] - table.ahead[q]
                slides[0], slides[1] = edges.half[a] - lines.half[i], lines.half[i] - edges.half[a]
                slides[2], slides[3] = edges.half[b] - lines.half[j] - skip, lines.half[j] - edges.half[b] - skip
                for k in range(4):
                    x = slides[k]
                    beyond = max(abs(x) + lines.half[i] - edges.half[a], abs(x + skip) + lines.half[j] - edges.half[b])
                    again = False
                    for earlier in range(k):
                        again = again or abs(slides[earlier] - x) < limits.reach / 2
                    if again or beyond > limits.reach:
                        fell[2] += not again
                        continue
                    if n == most:
                        return R_out, t_out, numbers, tried, fell
                    for r in range(3):
                        model = 0.0
                        for c in range(3):
                            model += (
                                R[r, c]
                                * (
                                    edges.middle[a, c]
                                    + x * edges.direction[a, c]
                                    + edges.middle[b, c]
                                    + same * (x + skip) * edges.direction[b, c]
                                )
                                / 2
                            )
                            R_out[n, r, c] = R[r, c]
                        t_out[n, r] = (lines.middle[i, r] + lines.middle[j, r]) / 2 - model
                    numbers[n, 0], numbers[n, 1], numbers[n, 2], numbers[n, 3] = i, j, a, b
                    n += 1
    return R_out[:n], t_out[:n], numbers[:n], tried, fell
