"""What a nearer thing hides of a face, completed by the face's own symmetry: its outline together with the mirror image of that."""

from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.modeling.suggesting.outlines import Line, corners_of, regular

LEAST_APART = 0.2  # between the normals of two sides that mirror one another
SAME_AXIS, SAME_AXIS_M = np.cos(np.deg2rad(2.0)), 0.002
ALIKE, NEAR_M = np.cos(np.deg2rad(5.0)), 0.003  # a side so near to a line is on it
SYMMETRIC = 0.6  # of what is seen
STAYS, GOES = 0.8, 0.2  # at least so much of each side that is seen stays one, at most so much of each cut


def mirrored(lines: list[Line], short: float) -> Iterator[list[Line]]:
    """The outlines that a cut one becomes together with its mirror image, about each axis that two of the sides seen have.

    An axis counts if most of what is seen is symmetric about it; an outline if what is seen of it still ends it, and where it is cut it
    goes on. Sides below `short` [m] are raggedness.
    """
    corners = corners_of(lines)
    if corners is None or not shapely.Polygon(corners).is_valid:
        return
    seen = [line for line in lines if not line.cut]
    for normal, offset in _axes(seen):
        reflected = [_reflected(line, normal, offset) for line in seen]
        if _alike(seen, reflected) < SYMMETRIC:
            continue
        image = corners - 2.0 * (corners @ normal - offset)[:, None] * normal
        whole = shapely.union(shapely.Polygon(corners), shapely.Polygon(image))
        if isinstance(whole, shapely.Polygon) and _goes_on(whole, lines, corners):
            yield regular(_lines_of(whole, [*seen, *reflected]), short)


def _axes(lines: Sequence[Line]) -> list[tuple[NDArray, float]]:
    """Axes normal (2,) · x = offset [m] about which one of the lines is the mirror image of another, each once."""
    found: list[tuple[NDArray, float]] = []
    for one, other in combinations(lines, 2):
        across = one.outward - other.outward
        size = float(np.linalg.norm(across))
        if size < LEAST_APART:
            continue
        normal = across / size
        offset = (one.offset - other.offset) / (2.0 * float(normal @ one.outward))
        if not any(abs(normal @ n) > SAME_AXIS and abs(offset - np.sign(normal @ n) * o) < SAME_AXIS_M for n, o in found):
            found.append((normal, offset))
    return found


def _alike(lines: Sequence[Line], reflected: Sequence[Line]) -> float:
    """The share of the lines' length that lies on the reflection of one of them."""
    alike = [line.length * any(_on(line.outward, line.offset, other) for other in reflected) for line in lines]
    return sum(alike) / sum(line.length for line in lines)


def _on(outward: NDArray, offset: float, line: Line) -> bool:
    return bool(line.outward @ outward > ALIKE and abs(line.offset - offset) < NEAR_M)


def _goes_on(whole: shapely.Polygon, lines: Sequence[Line], corners: NDArray) -> bool:
    """Whether a completed outline ends where its sides that are seen do, and nowhere where one was cut."""
    end = whole.exterior.buffer(NEAR_M)
    for line, side in zip(lines, np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), strict=True):
        drawn = shapely.LineString(side)
        kept = drawn.intersection(end).length / drawn.length
        if kept > GOES if line.cut else kept < STAYS:
            return False
    return True


def _reflected(line: Line, normal: NDArray, offset: float) -> Line:
    along = float(line.outward @ normal)
    return line._replace(outward=line.outward - 2.0 * along * normal, offset=line.offset - 2.0 * offset * along)


def _lines_of(outline: shapely.Polygon, known: Sequence[Line]) -> list[Line]:
    """The sides of an outline, each on the first of the known lines that it is near to."""
    corners = np.asarray(shapely.geometry.polygon.orient(outline).exterior.coords)
    out = []
    for start, end in pairwise(corners):
        length = float(np.linalg.norm(end - start))
        outward = np.array([end[1] - start[1], start[0] - end[0]]) / max(length, 1e-12)
        offset = float(outward @ (0.5 * (start + end)))
        near = next((line for line in known if _on(outward, offset, line)), None)
        out.append(Line(outward, offset, length, 0.0, False) if near is None else near._replace(length=length))
    return out
