"""What a look at a session needs to know: which readings are left once located parts are drawn, what a click points at, and what a
hypothesis rests on."""

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Entry, frozen_array
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.localization import DataEdge, Hypothesis, LocateOptions
from handey_studio.localization.explain import Explanation, explain
from handey_studio.localization.pairs import model_edges
from handey_studio.localization.search import Search, look
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.solid import solid_columns, without_parts
from handey_studio.task.sense import Scene
from handey_studio.world import Part, PlacedPart

CLICK_RAD = 0.008  # about nine pixels in a window of ordinary height
SAMPLES = 24
ACCEPTED = "accepted"  # stands where the reason of a fallen hypothesis does


@lru_cache(maxsize=4)
def unexplained(scene: Scene) -> NDArray:
    """Cells (ny, nx) bool whose reading no located part explains: these stay when the parts are drawn as solids."""
    columns = solid_columns(scene.depth_map)
    return frozen_array(without_parts(scene.depth_map, columns, scene.instances).top >= columns.top, bool)


def warm_up() -> None:
    """Loads, or compiles, what `unexplained` uses, so that the first look at a scan does not wait for it: a box on a small map."""
    scan = DepthMap(np.zeros((8, 8)), 0.001, np.eye(4), np.zeros((8, 8)))
    without_parts(scan, solid_columns(scan), (PlacedPart("box", Part("box", box((0.004, 0.004, 0.004))), np.eye(4)),))


def cells_of(scan: DepthMap, points_world: NDArray) -> NDArray:
    """Cells (ny, nx) bool of a depth map that hold one of points (n, 3) [m]."""
    ny, nx = scan.elevation.shape
    cells = np.zeros((ny, nx), dtype=bool)
    at = np.floor(apply(inverse(scan.T_world_range), points_world) / scan.cell).astype(int)
    i, j = at[:, 0], at[:, 1]
    inside = (i >= 0) & (j >= 0) & (i < nx) & (j < ny)
    cells[j[inside], i[inside]] = True
    return cells


def edge_at(edges: Sequence[DataEdge], origin: NDArray, direction: NDArray) -> int:
    """Number of the data edge that a ray (origin (3,) [m], direction (3,)) points at, the nearest first; -1 for none."""
    if not edges:
        return -1
    off = _off_segments(np.array([edge.ends_world for edge in edges]), origin, direction)
    best = int(np.argmin(off))
    return best if off[best] < CLICK_RAD else -1


def hypotheses_at(scene: Scene, parts: Sequence[Part], numbers: Sequence[int], origin: NDArray, direction: NDArray) -> list[int]:
    """Those of the hypotheses `numbers` one of whose wires a ray (origin (3,) [m], direction (3,)) points at, the nearest first."""
    off = {}
    for number in numbers:
        wires = wires_of(scene.located.hypotheses[number], parts)
        if len(wires):
            off[number] = float(_off_segments(wires, origin, direction).min())
    return sorted((number for number in off if off[number] < CLICK_RAD), key=lambda number: off[number])


def wires_of(hypothesis: Hypothesis, parts: Sequence[Part]) -> NDArray:
    """The edges (n, 2, 3) [m] of a hypothesis' part in the world; none when the part has no model."""
    solid = next((part.solid for part in parts if part.name == hypothesis.part), None)
    if solid is None:
        return np.empty((0, 2, 3))
    corners = apply(hypothesis.T_world_part, solid.vertices)
    return np.array([[corners[edge.start], corners[edge.end]] for edge in solid.edges])


def verdict_of(hypothesis: Hypothesis) -> str:
    """Why a hypothesis fell, or that it was accepted."""
    return hypothesis.reason or ACCEPTED


def entry_of(scene: Scene, hypothesis: Hypothesis) -> Entry | None:
    """The ledger's entry that tells by how much a hypothesis fell, None when it has none."""
    ledger = scene.located.ledger
    return ledger[hypothesis.entry] if 0 <= hypothesis.entry < len(ledger) else None


def tally(scene: Scene | None) -> tuple[dict[str, int], dict[str, int]]:
    """How many hypotheses there are of each part, and with each verdict, accepted first, then the most frequent."""
    known = scene.located.hypotheses if scene else ()
    parts, verdicts = Counter(h.part for h in known), Counter(verdict_of(h) for h in known)
    first = {ACCEPTED: verdicts[ACCEPTED]} if verdicts[ACCEPTED] else {}
    return dict(parts.most_common()), first | dict(verdicts.most_common())


def browsed(scene: Scene | None, part: str = "", verdict: str = "") -> tuple[int, ...]:
    """Numbers of the hypotheses of a part with a verdict, best first; an empty word, or one that none has, leaves all."""
    if scene is None:
        return ()
    parts, verdicts = tally(scene)
    return tuple(
        number
        for number, h in enumerate(scene.located.hypotheses)
        if (part not in parts or h.part == part) and (verdict not in verdicts or verdict_of(h) == verdict)
    )


def explained(scene: Scene, parts: Sequence[Part], number: int) -> Explanation | None:
    """What the stored depth map says to a hypothesis; None when there is no such hypothesis or no model of its part."""
    known, edges = scene.located.hypotheses, scene.located.edges
    hypothesis = known[number] if 0 <= number < len(known) else None
    part = next((part for part in parts if hypothesis and part.name == hypothesis.part), None)
    if hypothesis is None or part is None:
        return None
    search = _looked_at(scene)
    data = tuple(edges[k] for k in hypothesis.data if 0 <= k < len(edges))
    model = hypothesis.model if all(0 <= k < len(model_edges(part).half) for k in hypothesis.model) else ()
    T_sensor_part = inverse(search.view.T_world_sensor) @ hypothesis.T_world_part
    return explain(search.view, part, T_sensor_part, data, model, search)


@lru_cache(maxsize=2)
def _looked_at(scene: Scene) -> Search:
    """A look at the depth map once more, by the code that the localizer looks with."""
    return look(scene.depth_map.view(), LocateOptions())


def _off_segments(ends: NDArray, origin: NDArray, direction: NDArray) -> NDArray:
    """Angles (n,) [rad] by which a ray misses segments (n, 2, 3) [m]."""
    shares = np.linspace(0.0, 1.0, SAMPLES)[None, :, None]
    points = ends[:, None, 0] * (1.0 - shares) + ends[:, None, 1] * shares - np.asarray(origin)
    depth = points @ (np.asarray(direction) / np.linalg.norm(direction))
    off = np.sqrt(np.maximum((points**2).sum(axis=2) - depth**2, 0.0))
    return np.where(depth > 0.0, np.arctan2(off, depth), np.inf).min(axis=1)
