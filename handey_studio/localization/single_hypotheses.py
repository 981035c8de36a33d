"""Hypotheses from single edges: half-hidden parts often show no two."""

import numpy as np
from numba import njit

from handey_studio.localization.alignment import axes_of, flanks_agree
from handey_studio.localization.hypotheses import Assignments
from handey_studio.localization.pairs import DataLines, ModelEdges
from handey_studio.localization.tolerances import MatchTolerances, sure

MIN_LENGTH_SHARE = 0.5  # of its model edge that a single data edge must show


def hypothesize_single(edges: ModelEdges, lines: DataLines, limits: MatchTolerances, most: int) -> Assignments:
    """The same for single edges that are seen for a good part of their length: the surface beside such an edge is the second line that the
    paper asks for, and an end of it is laid on the end of its model edge. Half-hidden parts often show no two edges."""
    every = np.arange(len(lines.half))
    R, t, numbers, tried, fell = _match_single(edges, lines, limits, sure(edges, lines, every, every, limits), most)
    return Assignments(R, t, numbers[:, :2], numbers[:, 2:], int(tried), fell)


@njit(cache=True)
def _match_single(edges, lines, limits, sure, most):
    R_out, t_out = np.empty((most, 3, 3)), np.empty((most, 3))
    numbers, fell = np.empty((most, 4), dtype=np.int64), np.zeros(4, dtype=np.int64)
    frame_model, frame_data = np.empty((3, 3)), np.empty((3, 3))
    n = tried = 0
    for i in range(len(lines.half)):
        if lines.side[i, 0] == 0.0 or not sure[i]:
            continue
        for a in range(len(edges.half)):
            tried += 1
            spare = edges.half[a] - lines.half[i]
            if spare < -limits.reach / 2 or lines.half[i] < MIN_LENGTH_SHARE * edges.half[a]:
                fell[2] += 1
                continue
            for sign in (-1.0, 1.0):
                normal = edges.left[a] if lines.side[i, 0] * sign > 0 else edges.right[a]
                axes_of(edges.direction[a], normal, frame_model)
                axes_of(sign * lines.direction[i], lines.flank[i, 0], frame_data)
                R = frame_data @ frame_model.T
                if not flanks_agree(R, edges, a, lines, i, sign, limits.flank):
                    fell[3] += 1
                    continue
                for end in (-1.0, 1.0):
                    if n == most:
                        return R_out, t_out, numbers, tried, fell
                    for r in range(3):
                        model = 0.0
                        for c in range(3):
                            model += R[r, c] * (edges.middle[a, c] + end * spare * edges.direction[a, c])
                            R_out[n, r, c] = R[r, c]
                        t_out[n, r] = lines.middle[i, r] - model
                    numbers[n, 0], numbers[n, 1], numbers[n, 2], numbers[n, 3] = i, i, a, a
                    n += 1
                    if spare < limits.reach / 2:
                        break
    return R_out[:n], t_out[:n], numbers[:n], tried, fell
