"""Whether two located parts would pass through one another."""

from functools import lru_cache

from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.geometry.transforms import apply, inverse
from handey_studio.localization.samples import part_samples
from handey_studio.world.part import Part


def overlap_depth(part_a: Part, T_a: NDArray, part_b: Part, T_b: NDArray) -> float:
    """How deep [m] a point of either surface lies inside the other part, at poses (4, 4); zero when they are apart.

    Surfaces are taken at their samples and each convex piece by itself, so that this errs towards zero.
    """
    return max(_depth_inside(part_a, T_a, part_b, T_b), _depth_inside(part_b, T_b, part_a, T_a))


def _depth_inside(part: Part, T: NDArray, other: Part, T_other: NDArray) -> float:
    points = apply(inverse(T_other) @ T, part_samples(part).face_point)
    depths = [-(points @ planes[:, :3].T + planes[:, 3]).max(axis=1).min() for planes in _half_spaces(other)]
    return max(0.0, *(float(depth) for depth in depths))


@lru_cache(maxsize=64)
def _half_spaces(part: Part) -> tuple[NDArray, ...]:
    """Planes (k, 4) of each convex piece, outward normal and offset: inside is where all are negative."""
    return tuple(ConvexHull(corners).equations for corners in part.pieces)
