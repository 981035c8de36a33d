"""How probable hypotheses are of which some exclude one another: all ways in which they can stand together, weighed and summed exactly."""

from collections.abc import Iterator
from functools import cache
from math import exp

import numpy as np
from numpy.typing import NDArray


def marginals(odds: NDArray, excluded: list[int]) -> NDArray:
    """(n,) how probable each hypothesis is. A set of them is worth the product of its members' odds, of which `odds` (n,) are the
    logarithms; of the worth of all sets that can stand together, the empty one among them, this is the share of those that hold it.
    Bit k of `excluded[n]` tells that k and n cannot both stand.

    A group is summed with and without the member that excludes most others, until it falls apart into groups that mind each other no
    more: the hypotheses of a pile do so soon.
    """

    @cache
    def total(group: int) -> float:
        """Logarithm of the worth of all sets within a group."""
        worth = 0.0
        for part in connected(group, excluded):
            hub = max(members(part), key=lambda k: (excluded[k] & part).bit_count())
            rest = part & ~(1 << hub)
            worth += float(np.logaddexp(total(rest), odds[hub] + total(rest & ~excluded[hub])))
        return worth

    share = np.zeros(len(odds))
    for part in connected((1 << len(odds)) - 1, excluded):
        for k in members(part):
            share[k] = exp(odds[k] + total(part & ~(1 << k) & ~excluded[k]) - total(part))
    return share


def members(group: int) -> list[int]:
    """The numbers in a group, which is given as bits."""
    return [k for k in range(group.bit_length()) if group >> k & 1]


def connected(group: int, excluded: list[int]) -> Iterator[int]:
    """The parts of a group, as bits, between which nothing excludes anything."""
    while group:
        part = border = group & -group
        while border:
            k = border.bit_length() - 1
            found = excluded[k] & group & ~part
            part, border = part | found, border & ~(1 << k) | found
        yield part
        group &= ~part
