"""Locate parts in a view: hypothesize from pairs of edges, verify, refine, accept the best (Handey 1987 §3)."""

from collections.abc import Sequence

import numpy as np

from handey_studio.base import Progress, Silent
from handey_studio.localization.accept import accept
from handey_studio.localization.candidates import Candidate, candidates_of
from handey_studio.localization.result import Hypothesis, LocateOptions, LocateResult
from handey_studio.localization.search import Search, look
from handey_studio.sensing.depth_view import DepthView
from handey_studio.world.part import Part

SHOWN = 50  # hypotheses that go to the screen


def localize(
    view: DepthView,
    parts: Sequence[Part],
    options: LocateOptions | None = None,
    rng: np.random.Generator | None = None,
    progress: Progress | None = None,
) -> LocateResult:
    """The parts that the view shows, best first, several instances of one part if there are.

    Found nothing: a result without poses, whose ledger and `reason` tell why. The search uses no chance; `rng` is taken
    so that all stages are called alike.
    """
    options, progress = options or LocateOptions(), progress or Silent()
    search = look(view, options)
    candidates: list[Candidate] = []
    for number, part in enumerate(parts):
        progress.report(number / max(len(parts), 1), f"matching {len(search.edges)} edges with {part.name}")
        if progress.cancelled:
            break
        candidates += candidates_of(search, part)
    poses, hypotheses = accept(search, candidates)
    reason = "" if poses else _why_none(search, parts, hypotheses)
    progress.report(1.0, f"{len(poses)} poses found")
    return LocateResult(
        tuple(poses),
        search.edges,
        tuple(hypotheses[:SHOWN]),
        search.ledger.entries,
        search.timing,
        dict(search.fell),
        reason,
        progress.cancelled,
    )


def _why_none(search: Search, parts: Sequence[Part], hypotheses: list[Hypothesis]) -> str:
    """One sentence."""
    names = ", ".join(part.name for part in parts) or "no part"
    if not search.edges:
        return f"{names} not found: the depth map shows no straight edge."
    if not hypotheses:
        return f"{names} not found: none of the {len(search.edges)} edges pair up as the part's do."
    best = max(hypotheses, key=lambda hypothesis: hypothesis.found_m - hypothesis.missing_m)
    return f"{names} not found: the best of {len(hypotheses)} hypotheses fell because {best.reason}."
