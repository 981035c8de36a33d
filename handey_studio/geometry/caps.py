"""Triangles without area taken out of a closed mesh: a corner on its neighbour's side becomes a corner of both."""

import numpy as np
from numpy.typing import NDArray


def without_caps(vertices: NDArray, triangles: NDArray, thin: float) -> NDArray:
    """The mesh's triangles (m, 3) without those less than `thin` [m] high, of which no two corners coincide.

    Such a cap has its middle corner on its longest side; the triangle beyond that side is split at this corner, which closes the gap.
    Caps that lie back to back go together.
    """
    waiting = np.flatnonzero(_are_caps(vertices[triangles], thin)).tolist()
    if not waiting:
        return triangles
    kept = {k: tuple(int(c) for c in triangle) for k, triangle in enumerate(triangles)}
    owner = {side: k for k, triangle in kept.items() for side in _sides(triangle)}
    most = 4 * len(kept)
    while waiting and most:
        most -= 1
        k = waiting.pop()
        if k not in kept or not _are_caps(vertices[[kept[k]]], thin)[0]:
            continue
        a, b, middle = _longest_first(vertices, kept[k])
        beyond = owner.get((b, a))
        if beyond is None:
            continue
        tip = next(c for c in kept[beyond] if c not in (a, b))
        for gone in (k, beyond):
            for side in _sides(kept.pop(gone)):
                if owner.get(side) == gone:
                    del owner[side]
        if tip == middle:
            continue
        for name, triangle in ((k, (b, middle, tip)), (beyond, (middle, a, tip))):
            kept[name] = triangle
            owner |= dict.fromkeys(_sides(triangle), name)
            waiting.append(name)
    return np.array(list(kept.values()), dtype=np.int64).reshape(-1, 3)


def _sides(triangle: tuple[int, ...]) -> list[tuple[int, int]]:
    a, b, c = triangle
    return [(a, b), (b, c), (c, a)]


def _are_caps(corners: NDArray, thin: float) -> NDArray:
    """Which triangles, corners (n, 3, 3) [m], are less than `thin` high."""
    sides = np.roll(corners, -1, axis=1) - corners
    return np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) < thin * np.linalg.norm(sides, axis=2).max(axis=1)


def _longest_first(vertices: NDArray, triangle: tuple[int, ...]) -> tuple[int, int, int]:
    """The corners in the same order round, so that the longest side is from the first to the second."""
    return max(
        ((triangle[k], triangle[k - 2], triangle[k - 1]) for k in range(3)),
        key=lambda turned: float(np.linalg.norm(vertices[turned[1]] - vertices[turned[0]])),
    )
