"""Candidates of simulated scenes as the localizer looks at them, with whether they are right: what its weights are fitted to."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress
from handey_studio.cell.scenes.pile_scenes import SimulatedScene, TruePose
from handey_studio.cell.scenes.scene_files import load_scene
from handey_studio.localization import LocateOptions
from handey_studio.localization.candidates import Candidate, candidates_of
from handey_studio.localization.joint import MAX_CLAIMED, claims_shared
from handey_studio.localization.promise import PromiseWeights
from handey_studio.localization.result import pose_matrix
from handey_studio.localization.search import look
from handey_studio.task.bench.locate.truth_judge import RIGHT_DEG, RIGHT_MM, pose_error
from handey_studio.world.library import Library
from handey_studio.world.part import Part

NEAR_MM, NEAR_DEG = 12.0, 15.0  # a pose this near that is not right is on its way there: it teaches nothing
ON_THE_WAY = {"rough": (8.0, 8.0), "refined": (RIGHT_MM, RIGHT_DEG)}  # mm and degrees that a right pose may still be off
SEEN = 0.25  # of a part's pixels: less is not asked for
EVERY = 4  # of the many wrong poses on the way one in so many is kept


class Lineup(NamedTuple):
    """What one part's poses promised in one scene: `features` (n, k), and the number (n,) of the true `instance` that each one is, −1 for
    none."""

    features: NDArray
    instance: NDArray


@dataclass(frozen=True)
class Weighed:
    """`features` (n, k) of candidates in the order of the score's `FEATURES`, whether they are `right` (n,), and the numbers (n,) of their
    `scene` and `part`; `rivals` (m, 2) each claim the same readings. `lineups` tell what their forerunners promised, stage by stage."""

    features: NDArray
    right: NDArray
    scene: NDArray
    part: NDArray
    rivals: NDArray
    lineups: dict[str, list[Lineup]] = field(default_factory=dict)


def weighed_in(folders: Sequence[Path], library: Library, progress: Progress) -> Weighed:
    """What the candidates of every part of the library in the simulated scenes of `folders` look like. Cancelled, those so far."""
    parts = [library.part(name) for name in sorted(library.part_files())]
    lineups: dict[str, list[Lineup]] = {stage: [] for stage in PromiseWeights._fields}
    scenes, rivals, count = [], [], 0
    for number, folder in enumerate(folders):
        if progress.cancelled:
            break
        progress.report(number / len(folders), f"weighing the candidates in scene {folder.name}")
        features, right, part, pairs = _of_scene(load_scene(folder), parts, lineups)
        scenes.append((features, right, np.full(len(right), number), part))
        rivals.append(pairs + count)
        count += len(right)
    features, right, scene, part = (np.concatenate(column) for column in zip(*scenes, strict=True))
    return Weighed(features, right, scene, part, np.concatenate(rivals), lineups)


def _of_scene(scene: SimulatedScene, parts: Sequence[Part], lineups: dict[str, list[Lineup]]) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Features (n, k) of each candidate that teaches something, whether it is right (n,), its part's number (n,), and pairs of rivals."""
    search, T_world_sensor = look(scene.view, LocateOptions()), scene.view.T_world_sensor
    taught: list[tuple[Candidate, bool, int]] = []
    for number, part in enumerate(parts):
        truth = [true for true in scene.truth if true.part == part.name]

        def watch(stage: str, R: NDArray, t: NDArray, promised: NDArray, part: Part = part, truth: list[TruePose] = truth) -> None:
            instance = instances_of(R, t, T_world_sensor, part, truth, *ON_THE_WAY[stage])
            kept = (instance >= 0) | (np.arange(len(t)) % EVERY == 0)
            lineups[stage].append(Lineup(promised[kept], instance[kept]))

        for candidate, right in judged(candidates_of(search, part, watch), T_world_sensor, part, truth):
            taught.append((candidate, right, number))
    pairs = np.argwhere(np.triu(claims_shared(search, [row[0] for row in taught]) > MAX_CLAIMED, 1))
    features = np.array([candidate.score.features for candidate, _, _ in taught])
    right, part = np.array([row[1] for row in taught], dtype=bool), np.array([row[2] for row in taught], dtype=int)
    return features, right, part, pairs


def judged(candidates: Sequence[Candidate], T_world_sensor: NDArray, part: Part, truth: Sequence[TruePose]) -> list[tuple[Candidate, bool]]:
    """The candidates that teach something, and whether they are right: of each true instance the one that is nearest, and those that are
    far from all."""
    found, best = [], {}
    for candidate in candidates:
        T_world_part = T_world_sensor @ pose_matrix(candidate.R, candidate.t)
        right = is_right(T_world_part, part, truth)
        if right is False:
            found.append((candidate, False))
        elif right:
            errors = [pose_error(T_world_part, true.T_world_part, part.symmetries) for true in truth]
            size, number = min((mm / RIGHT_MM + degrees / RIGHT_DEG, number) for number, (mm, degrees) in enumerate(errors))
            best[number] = min(best.get(number, (np.inf, candidate)), (size, candidate), key=lambda one: one[0])
    return [*found, *((candidate, True) for _, candidate in best.values())]


def is_right(T_world_part: NDArray, part: Part, truth: Iterable[TruePose]) -> bool | None:
    """Whether a pose (4, 4) of a part is that of one of its true instances, within the judge's limits; None where that teaches nothing."""
    teaches = True
    for true in truth:
        mm, degrees = pose_error(T_world_part, true.T_world_part, part.symmetries)
        if mm <= RIGHT_MM and degrees <= RIGHT_DEG:
            return True
        teaches &= mm > NEAR_MM or degrees > NEAR_DEG
    return False if teaches else None


def instances_of(
    R: NDArray, t: NDArray, T_world_sensor: NDArray, part: Part, truth: Sequence[TruePose], mm: float, degrees: float
) -> NDArray:
    """Number (n,) of the true instance of a part, seen well enough to be asked for, that each pose R (n, 3, 3), t (n, 3) in the sensor's
    frame is to within `mm` and `degrees`; −1 for none."""
    R_world, t_world = T_world_sensor[:3, :3] @ R, t @ T_world_sensor[:3, :3].T + T_world_sensor[:3, 3]
    instance = np.full(len(t), -1)
    for number, true in enumerate(truth):
        for S in part.symmetries if true.visible_fraction >= SEEN else ():
            T = true.T_world_part @ S
            turned = np.arccos(np.clip((np.einsum("nij,ij->n", R_world, T[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))
            moved = np.linalg.norm(t_world - T[:3, 3], axis=1)
            instance[(1e3 * moved <= mm) & (np.rad2deg(turned) <= degrees)] = number
    return instance
