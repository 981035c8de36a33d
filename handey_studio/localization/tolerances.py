"""How far a pair of data edges may lie from a pair of the model's, by how well each of its edges is known (Handey 1987 §3)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.pairs import DataLines, ModelEdges, Pairs, ParallelPairs
from handey_studio.sensing.depth_view import DepthView

SIGMAS = 2.0  # by which data may lie off
UNSURE_ANGLE = np.deg2rad(0.5)  # adds to the sigma of an angle: no edge is quite as straight as its line
ENDS = 0.6  # of the reach, for the ends of edges; the rest is for their lines
CORNERS = 1.5  # of the reach: by more than this angles must not throw a part's far corner off; half-hidden parts need rough ones too


class MatchTolerances(NamedTuple):
    """How far data may lie from the model at most: `angle` [rad] of α, `offset` [m] of d, `reach` [m] that a data edge may stick out of
    its model edge, `flank` the cosine between a surface beside the data edge and the model's face there. `unsure` [m] adds to
    the sigmas of lines."""

    angle: float
    offset: float
    reach: float
    flank: float
    unsure: float


class PairSigmas(NamedTuple):
    """Standard deviations (n,) of pairs of data edges: of α [rad], of d [m], and of where the common perpendicular stands on the first
    and on the second edge [m], so of a₁ and a₂."""

    alpha: NDArray
    d: NDArray
    foot1: NDArray
    foot2: NDArray


class Allowed(NamedTuple):
    """How far each data pair (n,) may lie from a model pair: by `alpha` [rad], `d` [m], and by how much its edges may stick out of
    the model's, `past1` and `past2` [m]."""

    alpha: NDArray
    d: NDArray
    past1: NDArray
    past2: NDArray


def tolerances(view: DepthView) -> MatchTolerances:
    """From the view's noise and how far its silhouettes may lie off."""
    reach = 2.0 * view.outline_error + 3.0 * view.noise
    offset = 1.2 * view.outline_error + 3.0 * view.noise
    return MatchTolerances(np.deg2rad(10.0), offset, reach, float(np.cos(np.deg2rad(25.0))), view.noise)


def sure(edges: ModelEdges, lines: DataLines, first: NDArray, second: NDArray, limits: MatchTolerances) -> NDArray:
    """Whether the angles of two data edges each, `first` and `second` (n,), are known well enough to propose a pose of a part: short
    edges do for small parts, not for large ones."""
    ends = np.concatenate([edges.middle + sign * edges.half[:, None] * edges.direction for sign in (-1.0, 1.0)])
    size = float(np.linalg.norm(np.ptp(ends, axis=0)))
    return _angle_sigmas(lines, first, second) * size <= CORNERS * limits.reach


def pair_sigmas(lines: DataLines, pairs: Pairs) -> PairSigmas:
    """What the sigmas of their lines make of α, d, a₁ and a₂ of pairs of data edges.

    At the foot of the common perpendicular a line is off by its offset and by its angle times how far that is from its middle. Across
    both lines this moves d; across one it moves the foot along the other, the more so the nearer to parallel they are. A
    line's errors may all lie in the one direction that matters, so these are upper bounds.
    """
    first, second = pairs.first, pairs.second
    off1, off2 = (np.hypot(lines.offset_sigma[i], lines.angle_sigma[i] * foot) for i, foot in ((first, pairs.foot1), (second, pairs.foot2)))
    sine, cosine = np.sin(pairs.alpha), np.cos(pairs.alpha)
    foot1, foot2 = (np.hypot(one, cosine * other) / sine for one, other in ((off2, off1), (off1, off2)))
    return PairSigmas(_angle_sigmas(lines, first, second), np.hypot(off1, off2), foot1, foot2)


def allowed(lines: DataLines, pairs: Pairs, limits: MatchTolerances) -> Allowed:
    """By how well each pair is known: long clean edges are strict, short ones lax within the limits."""
    sigmas = pair_sigmas(lines, pairs)
    alpha = np.minimum(SIGMAS * np.hypot(sigmas.alpha, UNSURE_ANGLE), limits.angle)
    d = np.minimum(SIGMAS * np.hypot(sigmas.d, limits.unsure), limits.offset)
    past1, past2 = (np.minimum(np.hypot(SIGMAS * foot, ENDS * limits.reach), limits.reach) for foot in (sigmas.foot1, sigmas.foot2))
    return Allowed(alpha, d, past1, past2)


def allowed_apart(lines: DataLines, pairs: ParallelPairs, limits: MatchTolerances) -> NDArray:
    """How far [m] the distance d of each parallel data pair (n,) may lie from that of a model pair: what their offsets make of it, and
    the angle of their mean direction times how far one lies ahead of the other."""
    offset = np.hypot(lines.offset_sigma[pairs.first], lines.offset_sigma[pairs.second])
    turned = _angle_sigmas(lines, pairs.first, pairs.second) / 2.0 * pairs.ahead
    return np.minimum(SIGMAS * np.hypot(np.hypot(offset, turned), limits.unsure), limits.offset)


def _angle_sigmas(lines: DataLines, first: NDArray, second: NDArray) -> NDArray:
    """Standard deviation (n,) [rad] of the angle between two edges each."""
    return np.hypot(lines.angle_sigma[first], lines.angle_sigma[second])
