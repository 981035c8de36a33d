"""What rests on what was found: a pose that the table does not hold up may be held up by other parts.

Piles stand on one another. The score asks of each pose by itself whether it rests on the table; once others stand, a pose that is held up
by them, or by them and the table, rests as well.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.geometry.transforms import apply
from handey_studio.localization.candidates import Candidate
from handey_studio.localization.result import pose_matrix
from handey_studio.localization.score import FEET, at_rest, resting_within
from handey_studio.localization.search import Search
from handey_studio.sensing.depth_view import Orthographic
from handey_studio.sensing.drawing import camera_of, rendered_depth

CELL_M = 0.001  # of the grid on which an underside is held against the ground below it
FLUSH = 0.25  # share of a part's underside that must touch: on an edge or a slope it could stand in many ways


def held_up(search: Search, candidates: Sequence[Candidate], standing: Sequence[int], least: float) -> list[int]:
    """Numbers of the candidates that rest on the `standing` ones.

    Left out are those that rest on the table, and those less probable than `least` even if they rest.
    """
    found = []
    for n, candidate in enumerate(candidates):
        if bool(candidate.score.features[FEET].all()) or at_rest(search, candidate.score).probability < least:
            continue
        if _rests(search, candidate, [candidates[k] for k in standing if k != n]):
            found.append(n)
    return found


def _rests(search: Search, candidate: Candidate, others: Sequence[Candidate]) -> bool:
    """Whether the part's centre of mass is above what it touches of the table and the others, to within what noise leaves uncertain."""
    corners = _world(search, candidate)
    low, high = corners.min(axis=0), corners.max(axis=0)
    below = [(c, solid) for c, solid in ((_world(search, other), other.part.solid) for other in others) if _under(c, low, high)]
    if not below:
        return False
    camera = camera_of(Orthographic(CELL_M, *(-low[:2] / CELL_M)))
    width, height = (np.ceil((high - low)[:2] / CELL_M) + 1).astype(int)
    underside = rendered_depth(corners, candidate.part.solid.triangles, (height, width), camera)
    tops = [-rendered_depth(c * (1.0, 1.0, -1.0), solid.triangles, (height, width), camera) for c, solid in below]
    table = search.options.table_z_m if search.table and search.options.table_z_m is not None else -np.inf
    ground = np.fmax.reduce([*tops, np.full((height, width), table)])
    cells = np.argwhere(np.abs(underside - ground) < resting_within(search.view))
    if len(cells) < FLUSH * np.isfinite(underside).sum():
        return False
    edges = (cells[:, None] + 0.5 * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])).reshape(-1, 2)
    centre = apply(_pose(search, candidate), candidate.part.solid.volume_and_centroid[1])
    sides = ConvexHull(edges[:, ::-1] * CELL_M + low[:2]).equations
    return bool((sides[:, :2] @ centre[:2] + sides[:, 2]).max() < resting_within(search.view))


def _under(corners: NDArray, low: NDArray, high: NDArray) -> bool:
    """Whether something begins below the top of a part and lies, seen from above, within its bounds."""
    first, last = corners.min(axis=0), corners.max(axis=0)
    return bool((first[:2] < high[:2]).all() and (last[:2] > low[:2]).all() and first[2] < high[2])


def _world(search: Search, candidate: Candidate) -> NDArray:
    return apply(_pose(search, candidate), candidate.part.solid.vertices)


def _pose(search: Search, candidate: Candidate) -> NDArray:
    return search.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
