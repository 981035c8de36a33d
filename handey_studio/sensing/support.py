"""What everything stands on: the table, other tables and floors beside it, and the walls of bins.

Small flat spots all over the view, its facets, vote for planes. The table is the lowest plane that parts can lie on: many readings on
it and on planes parallel to it, hardly any below, and the rest near above. A bin's wall has what lies outside the bin below it, or
another wall opposite, and the parts lie away from it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.facets import ON_SIGMAS, ROOM_M, FacetPlane, Facets, facets_of, least_squares_plane, planes_of, sigma_at

PARALLEL_RAD, ACROSS_RAD = np.deg2rad(4.0), np.deg2rad(12.0)
MIN_SUPPORT_SHARE, MIN_WALL_SHARE = 0.05, 0.02  # of the readings
BELOW_COST = 3.0  # a reading below the plane speaks against it three times as loudly as one on it speaks for it
OPPOSITE_COST = 2.0  # the like for a plane that faces it
NEARNESS = 0.5  # of the scene's size: how near to its support a scene lies
PARALLEL_WORTH = 0.5  # a reading on a plane parallel to it, above, speaks half as loudly for it
SAMPLES = 20_000


@dataclass(frozen=True, eq=False)
class SupportPlane(Value):
    """The plane that everything stands on, as the frame of a world.

    `T_world_sensor` (4, 4) puts the plane at z = 0 with z towards the sensor and the origin under the sensor; it is the
    identity when none was found, and `reason` then says why. `inliers` readings lie on it, `share` of all, `rms` [m].
    """

    found: bool
    T_world_sensor: NDArray
    inliers: int
    share: float
    rms: float
    reason: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_sensor", frozen_array(self.T_world_sensor))


@dataclass(frozen=True, eq=False)
class Plane(Value):
    """A plane of the view: normal · x = offset [m] in the sensor's frame, the unit normal (3,) towards the sensor's side.

    `share` of the readings lie on it, `rms` [m] off it; `height` [m] is how far it lies above the table, at the middle of what is seen
    of it, 0 for the table itself.
    """

    normal_sensor: NDArray
    offset: float
    share: float
    rms: float
    height: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal_sensor", frozen_array(self.normal_sensor))


@dataclass(frozen=True, eq=False)
class Supports(Value):
    """The table, every level plane that parts may lie on, lowest first and the table among them, and the upright ones: walls of bins, and
    sides of large parts, which nothing here tells apart."""

    table: SupportPlane
    levels: tuple[Plane, ...] = ()
    walls: tuple[Plane, ...] = ()


def support_plane(view: DepthView, rng: np.random.Generator) -> SupportPlane:
    """The table of `support_planes`."""
    return support_planes(view, rng).table


def support_planes(view: DepthView, rng: np.random.Generator) -> Supports:
    """The table, other levels and walls that a view shows; without a table a result that tells why."""
    readings = int(np.count_nonzero(np.isfinite(view.depth)))
    if readings < 3:
        return Supports(_none(f"the view has {readings} readings"))
    facets = facets_of(view)
    planes = planes_of(facets, rng)
    if not planes:
        return Supports(_none("the view shows no plane that holds two facets in a hundred"))
    points = _sample(view)
    sigma = sigma_at(view, points[:, 2])
    main = planes[int(np.argmax([_votes(plane, planes, facets) for plane in planes]))]
    level = [_finer(plane, points, sigma) for plane in planes if plane.normal @ main.normal > np.cos(PARALLEL_RAD)]
    walls = [_finer(plane, points, sigma) for plane in planes if abs(plane.normal @ main.normal) < np.sin(ACROSS_RAD)]
    level = [plane for plane in level if plane.share >= MIN_SUPPORT_SHARE]
    walls = [plane for plane in walls if plane.share >= MIN_WALL_SHARE]
    if not level:
        share = _finer(main, points, sigma).share
        reason = f"the largest plane holds {100 * share:.0f} % of the readings, a support needs {100 * MIN_SUPPORT_SHARE:.0f} %"
        return Supports(_none(reason, round(share * readings), share))
    return _told(level, walls, main, points, readings)


def _told(level: list[Plane], walls: list[Plane], main: FacetPlane, points: NDArray, readings: int) -> Supports:
    """With heights above the lowest level, which is the table."""
    seen = points.mean(axis=0)

    def height(plane: Plane) -> float:
        return float(plane.offset - plane.normal_sensor @ seen) / float(plane.normal_sensor @ main.normal)

    heights = {id(plane): height(plane) for plane in level}
    middle = main.offset - main.normal @ seen
    level = sorted((plane for plane in level if heights[id(plane)] > middle - ROOM_M), key=lambda plane: heights[id(plane)])
    table = level[0]
    told = tuple(
        Plane(plane.normal_sensor, plane.offset, plane.share, plane.rms, max(0.0, heights[id(plane)] - heights[id(table)]))
        for plane in level
    )
    frame = _frame(table.normal_sensor, table.offset)
    return Supports(SupportPlane(True, frame, round(table.share * readings), table.share, table.rms), told, tuple(walls))


def _none(reason: str, inliers: int = 0, share: float = 0.0) -> SupportPlane:
    return SupportPlane(False, np.eye(4), inliers, share, 0.0, reason)


def _sample(view: DepthView) -> NDArray:
    """Up to about `SAMPLES` readings (n, 3) [m] of the sensor's frame, evenly over the image."""
    step = max(1, int(np.sqrt(view.depth.size / SAMPLES)))
    v, u = (np.arange(size % step // 2, size, step) for size in view.depth.shape)
    depth = view.depth[np.ix_(v, u)]
    j, i = np.nonzero(np.isfinite(depth))
    return view.projection.unproject(np.stack([u[i], v[j]], axis=1).astype(float), depth[j, i])


def _votes(plane: FacetPlane, planes: list[FacetPlane], facets: Facets) -> float:
    """How much speaks for a plane's being what things stand on, in facets."""
    votes = plane.on.sum() - BELOW_COST * plane.below
    for other in planes:
        cosine = float(other.normal @ plane.normal)
        if other is not plane and cosine > np.cos(PARALLEL_RAD):
            lifted = float(np.median(facets.middle[other.on] @ plane.normal) - plane.offset)
            votes += PARALLEL_WORTH * other.on.sum() if 0.0 < lifted < ROOM_M else 0.0
        elif cosine < -np.cos(ACROSS_RAD):
            votes -= OPPOSITE_COST * other.on.sum()
    return float(votes) * _stands_on(plane, facets) if votes > 0 else float(votes)


def _stands_on(plane: FacetPlane, facets: Facets) -> float:
    """Between 0 and 1: how near to a plane the rest of the scene is, by the scene's own size. A heap lies near its floor, not its walls."""
    rest = facets.middle[~plane.on]
    if not len(rest):
        return 1.0
    size = float(np.linalg.norm(facets.middle.std(axis=0)))
    return float(np.exp(-max(0.0, np.median(rest @ plane.normal) - plane.offset) / max(NEARNESS * size, 1e-9)))


def _finer(found: FacetPlane, points: NDArray, sigma: NDArray) -> Plane:
    """The plane through the readings (n, 3) on it."""
    normal, offset = found.normal, found.offset
    for width in (2.0 * ON_SIGMAS, ON_SIGMAS, ON_SIGMAS):
        on = np.abs(points @ normal - offset) < width * sigma
        if on.sum() < 3:
            return Plane(normal, offset, 0.0, 0.0)
        normal, offset = least_squares_plane(points[on], sigma[on], normal)
    residuals = points @ normal - offset
    on = np.abs(residuals) < ON_SIGMAS * sigma
    return Plane(normal, offset, float(on.mean()), float(np.sqrt(np.mean(residuals[on] ** 2))) if on.any() else 0.0)


def _frame(normal: NDArray, offset: float) -> NDArray:
    """T_world_sensor: z along the normal, origin at the sensor's foot, x as near the sensor's x as it can be."""
    reference = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = reference - (reference @ normal) * normal
    x /= np.linalg.norm(x)
    R_world_sensor = np.stack([x, np.cross(normal, x), normal])
    return transform(R_world_sensor, (0.0, 0.0, -offset))
