"""Hypothesize: transforms from assigning two model edges to two data edges (Handey 1987 §3)."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.edges import CONVEX
from handey_studio.localization.pairs import DataLines, ModelEdges, Pairs, ParallelPairs
from handey_studio.localization.tolerances import MatchTolerances, allowed, allowed_apart, sure

MIN_LENGTH_SHARE = 0.5  # of its model edge that a single data edge must show


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


def hypothesize_parallel(
    edges: ModelEdges, table: ParallelPairs, lines: DataLines, pairs: ParallelPairs, limits: MatchTolerances, most: int
) -> Assignments:
    """The same for parallel edges, which fix a transform but for its slide along them: an end of a data edge is laid on the
    end of its model edge."""
    R, t, numbers, tried, fell = _match_parallel(edges, table, lines, pairs, limits, allowed_apart(lines, pairs, limits), most)
    return Assignments(R, t, numbers[:, :2], numbers[:, 2:], int(tried), fell)


def hypothesize_single(edges: ModelEdges, lines: DataLines, limits: MatchTolerances, most: int) -> Assignments:
    """The same for single edges that are seen for a good part of their length: the surface beside such an edge is the second line that the
    paper asks for, and an end of it is laid on the end of its model edge. Half-hidden parts often show no two edges."""
    every = np.arange(len(lines.half))
    R, t, numbers, tried, fell = _match_single(edges, lines, limits, sure(edges, lines, every, every, limits), most)
    return Assignments(R, t, numbers[:, :2], numbers[:, 2:], int(tried), fell)


def joined(*several: Assignments) -> Assignments:
    """All of them."""
    R, t, data, model = (np.concatenate([getattr(one, key) for one in several]) for key in ("R", "t", "data", "model"))
    return Assignments(R, t, data, model, sum(one.tried for one in several), np.sum([one.fell for one in several], axis=0))


@njit(cache=True)
def _frame(u, w, out):
    """Columns: the bisector of two unit directions, the third axis, and their common normal."""
    nx, ny, nz = u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    bx, by, bz = u[0] + w[0], u[1] + w[1], u[2] + w[2]
    size = np.sqrt(bx * bx + by * by + bz * bz)
    out[0, 0], out[1, 0], out[2, 0] = bx / size, by / size, bz / size
    out[0, 2], out[1, 2], out[2, 2] = nx / length, ny / length, nz / length
    out[0, 1] = out[1, 2] * out[2, 0] - out[2, 2] * out[1, 0]
    out[1, 1] = out[2, 2] * out[0, 0] - out[0, 2] * out[2, 0]
    out[2, 1] = out[0, 2] * out[1, 0] - out[1, 2] * out[0, 0]


@njit(cache=True)
def _flanks_agree(R, edges, m, lines, i, sign, limit):
    """Whether the surfaces beside data edge i, taken in direction `sign`, are the faces beside model edge m.

    A crease between the part and what it touches shows one face of the part, a jump shows one, a convex crease two.
    """
    agree = known = 0
    for k in range(2):
        side = lines.side[i, k] * sign
        if side == 0.0:
            continue
        known += 1
        normal = edges.left[m] if side > 0 else edges.right[m]
        dot = 0.0
        for r in range(3):
            dot += lines.flank[i, k, r] * (R[r, 0] * normal[0] + R[r, 1] * normal[1] + R[r, 2] * normal[2])
        agree += dot > limit
    needed = 2 if (lines.kind[i] == CONVEX or edges.concave[m]) else 1
    return known == 0 or agree >= min(needed, known)


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
                _frame(edges.direction[a], edges.direction[b], frame_model)
                _frame(s * lines.direction[i], w * lines.direction[j], frame_data)
                R = frame_data @ frame_model.T
                if not (_flanks_agree(R, edges, a, lines, i, s, limits.flank) and _flanks_agree(R, edges, b, lines, j, w, limits.flank)):
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


@njit(cache=True)
def _axes(along, across, out):
    """Columns: a direction, one made square to it, and their common normal."""
    dot = along[0] * across[0] + along[1] * across[1] + along[2] * across[2]
    x, y, z = across[0] - dot * along[0], across[1] - dot * along[1], across[2] - dot * along[2]
    size = np.sqrt(x * x + y * y + z * z)
    for r in range(3):
        out[r, 0] = along[r]
    out[0, 1], out[1, 1], out[2, 1] = x / size, y / size, z / size
    out[0, 2] = along[1] * out[2, 1] - along[2] * out[1, 1]
    out[1, 2] = along[2] * out[0, 1] - along[0] * out[2, 1]
    out[2, 2] = along[0] * out[1, 1] - along[1] * out[0, 1]


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
                _axes(edges.direction[a], table.across[q], frame_model)
                _axes(sign * lines.direction[i], pairs.across[p], frame_data)
                R = frame_data @ frame_model.T
                other = sign * turned * same
                if not (
                    _flanks_agree(R, edges, a, lines, i, sign, limits.flank) and _flanks_agree(R, edges, b, lines, j, other, limits.flank)
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
                _axes(edges.direction[a], normal, frame_model)
                _axes(sign * lines.direction[i], lines.flank[i, 0], frame_data)
                R = frame_data @ frame_model.T
                if not _flanks_agree(R, edges, a, lines, i, sign, limits.flank):
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
