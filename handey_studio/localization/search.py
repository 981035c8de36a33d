"""One look at a view: its edges, its evidence, and what the search for parts writes down."""

import time
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger
from handey_studio.localization.edges import edge_pixels
from handey_studio.localization.evidence import ROUGH, Evidence, Limits, evidence_of, limits_of
from handey_studio.localization.refine import Weights, weights_of
from handey_studio.localization.result import LocateOptions
from handey_studio.localization.segments import DataEdge, data_edges, link
from handey_studio.localization.surface import surface_of
from handey_studio.localization.tolerances import MatchTolerances, tolerances
from handey_studio.sensing.depth_view import DepthView
from handey_studio.world.part import Part

MIN_EDGE_PX = 8.0
STAGES = ("edges", "evidence", "hypothesize", "verify", "refine", "accept")
TABLE_SHARE = 0.02  # of the readings that must lie at the table's height before the table is believed in
TABLE_READINGS = 30_000  # about as many are asked


@dataclass(frozen=True)
class Search:
    """What one call looks at, with limits for refined poses and `rough` ones; `ledger`, `fell` and `timing` are what it writes down."""

    view: DepthView
    evidence: Evidence
    edges: tuple[DataEdge, ...]
    options: LocateOptions
    limits: Limits
    rough: Limits
    weights: Weights
    tolerances: MatchTolerances
    table: bool
    ledger: Ledger
    fell: Counter[str]
    timing: dict[str, float]

    @property
    def slack(self) -> float:
        """How far [m] an outline or a corner may be off: what noise and lost margins leave uncertain."""
        return self.view.noise + 0.5 * self.view.outline_error


def look(view: DepthView, options: LocateOptions) -> Search:
    """Edges and evidence of a view."""
    timing: dict[str, float] = dict.fromkeys(STAGES, 0.0)
    start = time.perf_counter()
    surface = surface_of(view)
    pixels = edge_pixels(view, surface)
    linked = link(view, surface, pixels)
    shortest = options.min_edge_m if options.min_edge_m is not None else MIN_EDGE_PX * surface.pixel
    edges = data_edges(view, surface, pixels, linked, shortest)
    timing["edges"] = time.perf_counter() - start
    start = time.perf_counter()
    evidence = evidence_of(view, surface, linked)
    timing["evidence"] = time.perf_counter() - start
    ledger = Ledger()
    ledger.add("edges", f"{len(edges)} straight edges in the depth map", None if edges else "no straight edge found")
    limits, rough, weights = limits_of(view), limits_of(view, ROUGH), weights_of(view, surface.pixel)
    table = _sees_table(view, options)
    return Search(view, evidence, edges, options, limits, rough, weights, tolerances(view), table, ledger, Counter(), timing)


def footing(search: Search, part: Part, R: NDArray, t: NDArray) -> NDArray:
    """Heights (n, 3) [m] above the table of the three lowest corners of poses R (n, 3, 3), t (n, 3) of a part in the sensor's frame: three
    corners on the table are a part at rest. NaN where no table is seen."""
    if not search.table or search.options.table_z_m is None:
        return np.full((len(t), 3), np.nan)
    up, height = search.view.T_world_sensor[2, :3], search.view.T_world_sensor[2, 3] - search.options.table_z_m
    z = part.solid.vertices @ np.einsum("nij,i->nj", R, up).T + t @ up + height
    return np.sort(z, axis=0)[:3].T


def _sees_table(view: DepthView, options: LocateOptions) -> bool:
    """Whether enough readings lie at the table's height for it to be there."""
    if options.table_z_m is None:
        return False
    every = max(1, int(np.sqrt(view.depth.size / TABLE_READINGS)))
    v, u = np.mgrid[: view.depth.shape[0] : every, : view.depth.shape[1] : every]
    points = view.projection.unproject(np.stack([u, v], axis=-1).astype(float), view.depth[v, u])
    z = points @ view.T_world_sensor[2, :3] + view.T_world_sensor[2, 3] - options.table_z_m
    z = z[np.isfinite(z)]
    return bool(len(z)) and bool(np.mean(np.abs(z) < 5.0 * view.noise) > TABLE_SHARE)
