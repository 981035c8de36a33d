"""Edges merged again where dropouts break them: two pieces of one line are one edge if nothing that was read between them says otherwise.

A gap that was seen stays one: two parts in line are two edges, and so is an edge that something nearer crosses.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.edges import JUMP
from handey_studio.localization.flanks import Seen
from handey_studio.localization.lines import Line
from handey_studio.localization.pieces import fitted
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.drawing import Camera, project

SIGMAS = 3.0  # by which two pieces of one line may lie off one another
UNSURE_ANGLE, MOST_ANGLE = np.deg2rad(0.5), np.deg2rad(8.0)  # adds to the sigma of an angle; the widest that is one direction
ALIKE = np.cos(np.deg2rad(20.0))  # between the surfaces beside two pieces of one edge
MARGIN_PX = 3  # beside a dropout, where windows are cut short and ends are trimmed
UNREAD_OF_ALL = 0.25  # share of a crease's gap that must be without readings
OTHER = 0.2  # share of it, less its margins, that may show something else than the edge or its surface
KEPT = 0.8  # of both pieces' pixels that must keep to the common line


def over_dropouts(
    view: DepthView, seen: Seen, outward: NDArray, kind: NDArray, u: NDArray, v: NDArray, lines: tuple[Line, ...], segment: NDArray
) -> tuple[tuple[Line, ...], NDArray]:
    """Lines, with those that only dropouts part taken as one and fitted again, and the number of each edge pixel's line (n,).

    Edge pixels (n,) are told by `kind`, `u`, `v` [px] and `segment`, the numbers of their lines so far (−1 for none); `outward` as in
    `EdgePixels`.
    """
    if len(lines) < 2:
        return lines, segment
    kinds = np.zeros(len(lines), dtype=np.int64)
    kinds[segment[segment >= 0]] = kind[segment >= 0]
    merged, number = dict(enumerate(lines)), np.arange(len(lines))
    for i, j in _in_line(view, lines, kinds):
        a, b = int(number[i]), int(number[j])
        jump = bool(kinds[i] == JUMP)
        if a == b or not _same_owner(lines[i], lines[j]) or not _goes_on(view, seen, lines[i], lines[j], jump):
            continue
        members = np.nonzero((segment >= 0) & ((number[segment] == a) | (number[segment] == b)))[0]
        (line,) = fitted(seen, outward, kind, u, v, members, np.array([0, len(members)]))
        if line.pixels >= KEPT * (merged[a].pixels + merged[b].pixels):
            merged[a] = line
            del merged[b]
            number[number == b] = a
    renumbered = np.searchsorted(np.array(list(merged)), number)
    return tuple(merged.values()), np.where(segment >= 0, renumbered[segment], -1)


def _in_line(view: DepthView, lines: tuple[Line, ...], kinds: NDArray) -> list[tuple[int, int]]:
    """Pairs of lines of one kind that lie on one line to within what their sigmas allow, end to end with a gap that is no longer than
    the shorter of them; the nearest first."""
    ends = np.array([line.ends for line in lines]).reshape(-1, 2, 3)
    offset, angle = (np.array([getattr(line, key) for line in lines]) for key in ("offset_sigma", "angle_sigma"))
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    middle, along = ends.mean(axis=1), (ends[:, 1] - ends[:, 0]) / np.maximum(length, 1e-12)[:, None]
    i, j = np.nonzero(np.triu((kinds[:, None] == kinds) & (np.abs(along @ along.T) >= np.cos(MOST_ANGLE)), 1))
    between = middle[j] - middle[i]
    ahead = np.einsum("ni,ni->n", between, along[i])
    gap = np.abs(ahead) - (length[i] + length[j]) / 2
    beyond = (gap > 0.0) & (gap <= (length[i] + length[j]) / 2)
    i, j, between, ahead, gap = (array[beyond] for array in (i, j, between, ahead, gap))
    cosine = np.einsum("ni,ni->n", along[i], along[j])
    turn = SIGMAS * np.sqrt(angle[i] ** 2 + angle[j] ** 2 + UNSURE_ANGLE**2)
    towards, same = np.sign(ahead), np.sign(cosine)
    reach_i, reach_j = (length[i] + gap) / 2, (length[j] + gap) / 2  # from the middles to the gap's
    apart = between - (towards * reach_i)[:, None] * along[i] - (towards * same * reach_j)[:, None] * along[j]
    sigma = np.sqrt(offset[i] ** 2 + offset[j] ** 2 + (angle[i] * reach_i) ** 2 + (angle[j] * reach_j) ** 2 + view.noise**2)
    most = np.minimum(SIGMAS * sigma, view.outline_error + SIGMAS * view.noise)
    fit = (np.linalg.norm(apart, axis=1) <= most) & (np.abs(cosine) >= np.cos(np.minimum(turn, MOST_ANGLE)))
    return [(int(i[k]), int(j[k])) for k in np.argsort(gap, kind="stable") if fit[k]]


def _same_owner(a: Line, b: Line) -> bool:
    """Whether the same surfaces lie on the same sides of two lines, in either order."""
    if a.flanks != b.flanks or a.flanks == 0:
        return False
    alike = np.einsum("ki,li->kl", a.normals, b.normals)[: a.flanks, : a.flanks] >= ALIKE
    alike &= np.einsum("ki,li->kl", a.inward, b.inward)[: a.flanks, : a.flanks] >= ALIKE
    return bool(alike.any(axis=1).all())


def _goes_on(view: DepthView, seen: Seen, a: Line, b: Line, jump: bool) -> bool:
    """Whether nothing that was read in the gap between two lines' nearest ends says that the edge stops there. Of a crease's gap a good
    part must be unread; beside a jump the near surface must go on, no farther than to the jump, and nothing nearer cross it."""
    apart = np.linalg.norm(a.ends[:, None] - b.ends[None], axis=2)
    m, n = np.unravel_index(np.argmin(apart), (2, 2))
    gap = np.stack([a.ends[m], b.ends[n]])
    pixel = 1.0 / float(np.mean(view.projection.pixels_per_metre(float(gap[0, 2]))))
    slack = SIGMAS * view.noise + pixel
    if not jump:
        behind = _behind(seen.depth, seen.camera, gap)
        return bool(np.isnan(behind).mean() >= UNREAD_OF_ALL) and _seldom(np.abs(behind) > slack, MARGIN_PX + seen.radius)
    lost = view.outline_error + 2.0 * pixel
    inside, outside = (_behind(seen.depth, seen.camera, gap + side * a.inward[0]) for side in (pixel, -lost))
    return _seldom(np.abs(inside) > slack, MARGIN_PX) and _seldom(outside < slack, MARGIN_PX)


@njit(cache=True)
def _behind(depth: NDArray, camera: Camera, ends: NDArray) -> NDArray:
    """How far [m] readings lie behind a line (2, 3), at the places along it: NaN where nothing was read."""
    start, end = project(ends[0, 0], ends[0, 1], ends[0, 2], camera), project(ends[1, 0], ends[1, 1], ends[1, 2], camera)
    steps = max(2, int(np.ceil(max(abs(end[0] - start[0]), abs(end[1] - start[1])))) + 1)
    behind = np.full(steps, np.nan)
    for k in range(steps):
        share = k / (steps - 1)
        u, v = np.rint(start[0] + share * (end[0] - start[0])), np.rint(start[1] + share * (end[1] - start[1]))
        if u >= 0 and v >= 0 and u < depth.shape[1] and v < depth.shape[0]:
            behind[k] = depth[int(v), int(u)] - ends[0, 2] - share * (ends[1, 2] - ends[0, 2])
    return behind


def _seldom(off: NDArray, margin: int) -> bool:
    """Whether at most a few of the places along a gap, less `margin` at both ends, are off."""
    off = off[margin : len(off) - margin]
    return bool(off.sum() <= OTHER * len(off))
