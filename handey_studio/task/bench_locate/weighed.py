"""Candidates of simulated scenes as the score looks at them, with whether they are right: what its weights are fitted to."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress
from handey_studio.cell.scene_files import load_scene
from handey_studio.cell.scenes import SimulatedScene, TruePose
from handey_studio.localization import LocateOptions
from handey_studio.localization.candidates import candidates_of
from handey_studio.localization.result import pose_matrix
from handey_studio.localization.score import FEATURES
from handey_studio.localization.search import look
from handey_studio.task.bench_locate.truth_judge import RIGHT_DEG, RIGHT_MM, pose_error
from handey_studio.world.library import Library
from handey_studio.world.part import Part

NEAR_MM, NEAR_DEG = 12.0, 15.0  # a pose this near that is not right is on its way there: it teaches nothing


class Weighed(NamedTuple):
    """`features` (n, k) of candidates in the order of the score's `FEATURES`, whether they are `right` (n,), and the number (n,) of
    their `scene`."""

    features: NDArray
    right: NDArray
    scene: NDArray


def weighed_in(folders: Sequence[Path], library: Library, progress: Progress) -> Weighed:
    """What the candidates of every part of the library in the simulated scenes of `folders` look like. Cancelled, those so far."""
    parts = [library.part(name) for name in sorted(library.part_files())]
    rows: list[tuple[NDArray, bool, int]] = []
    for number, folder in enumerate(folders):
        if progress.cancelled:
            break
        progress.report(number / len(folders), f"weighing the candidates in scene {folder.name}")
        rows += [(*row, number) for row in _of_scene(load_scene(folder), parts)]
    features = np.array([row[0] for row in rows]).reshape(len(rows), len(FEATURES))
    return Weighed(features, np.array([row[1] for row in rows], dtype=bool), np.array([row[2] for row in rows], dtype=int))


def _of_scene(scene: SimulatedScene, parts: Iterable[Part]) -> list[tuple[NDArray, bool]]:
    """Features (k,) of each candidate that teaches something, and whether it is right."""
    found, search = [], look(scene.view, LocateOptions())
    for part in parts:
        truth = [true for true in scene.truth if true.part == part.name]
        for candidate in candidates_of(search, part):
            T_world_part = scene.view.T_world_sensor @ pose_matrix(candidate.R, candidate.t)
            right = is_right(T_world_part, part, truth)
            if right is not None and np.isfinite(candidate.score.features).all():
                found.append((candidate.score.features, right))
    return found


def is_right(T_world_part: NDArray, part: Part, truth: Iterable[TruePose]) -> bool | None:
    """Whether a pose (4, 4) of a part is that of one of its true instances, within the judge's limits; None where that teaches nothing."""
    teaches = True
    for true in truth:
        mm, degrees = pose_error(T_world_part, true.T_world_part, part.symmetries)
        if mm <= RIGHT_MM and degrees <= RIGHT_DEG:
            return True
        teaches &= mm > NEAR_MM or degrees > NEAR_DEG
    return False if teaches else None
