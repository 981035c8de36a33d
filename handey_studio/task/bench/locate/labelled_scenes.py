"""Scenes to measure on: simulated ones with their truth, and real ones with labels."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from handey_studio.base import BadInput, Progress, Value
from handey_studio.cell.scenes.pile_scenes import CAMERA, SceneOptions, random_scene
from handey_studio.cell.scenes.scene_files import load_scene, read_json, save_scene
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.reading.files import read_depth
from handey_studio.task.bench.locate.judgement import Judge
from handey_studio.task.bench.locate.label_judge import LabelJudge, Labelled
from handey_studio.task.bench.locate.truth_judge import TruthJudge
from handey_studio.world.library import Library
from handey_studio.world.model_files import read_part
from handey_studio.world.part import Part


@dataclass(frozen=True, eq=False)
class LabelledScene(Value):
    """A view, the parts that are asked for in it, and who knows what is there. `knows_world` as in `DepthReading`."""

    name: str
    view: DepthView
    knows_world: bool
    parts: tuple[Part, ...]
    judge: Judge


def scene_folders(folder: Path) -> tuple[Path, ...]:
    """The scenes' folders in a folder, by name: with a truth.json (simulated) or an objects.json (real). BadInput if there is none."""
    if not folder.is_dir():
        raise BadInput(f'scenes folder "{folder}" does not exist.')
    found = [path for path in sorted(folder.iterdir()) if (path / "truth.json").is_file() or (path / "objects.json").is_file()]
    if not found:
        raise BadInput(
            f'scenes folder "{folder}" holds no folder with a truth.json (simulated scenes) or an objects.json (labelled real ones).'
        )
    return tuple(found)


def simulate(seeds: Iterable[int], folder: Path, library: Library, sensor: str, progress: Progress) -> tuple[Path, ...]:
    """The folders of the seeds' scenes below `folder`, made where they are missing: scenes are always measured from their files.
    `sensor` as in `SceneOptions`."""
    seeds = list(seeds)
    folders = []
    for number, seed in enumerate(seeds):
        if progress.cancelled:
            break
        place = folder / (f"{seed:04d}" if sensor == CAMERA else f"{seed:04d}-{sensor}")
        if not (place / "truth.json").is_file():
            progress.report(number / len(seeds), f"making scene {seed}")
            save_scene(random_scene(seed, library, SceneOptions(sensor=sensor)), place)
        folders.append(place)
    return tuple(folders)


def load_labelled(folders: Iterable[Path], library: Library) -> Iterator[LabelledScene]:
    """One scene after the other. Raises BadInput."""
    for folder in folders:
        yield _simulated(folder, library) if (folder / "truth.json").is_file() else _real(folder)


def _simulated(folder: Path, library: Library) -> LabelledScene:
    scene = load_scene(folder)
    parts = {name: library.part(name) for name in sorted(library.part_files())}
    judge = TruthJudge(scene.truth, scene.view.T_world_sensor, parts)
    return LabelledScene(folder.name, scene.view, True, tuple(parts.values()), judge)


def _real(folder: Path) -> LabelledScene:
    """depth.png, camera.json, labels.png and objects.json; the parts' meshes stand in `parts` two folders up."""
    reading = read_depth(folder / "depth.png", folder / "camera.json")
    content = read_json(folder / "objects.json")
    labels = cv2.imread(str(folder / "labels.png"), cv2.IMREAD_UNCHANGED)
    if labels is None or labels.shape != reading.view.depth.shape:
        raise BadInput(f'"{folder / "labels.png"}" is not a label image of the size of its depth image.')
    try:
        objects = [(int(found["label"]), str(found["part"])) for found in content["objects"]]
        names = [*dict.fromkeys([*(part for _, part in objects), *map(str, content.get("absent", []))])]
    except (KeyError, TypeError, ValueError):
        raise BadInput(f'"{folder / "objects.json"}" must hold objects, each with label and part, and optionally absent parts.') from None
    parts = {name: replace(read_part(folder.parent.parent / "parts" / f"{name}.obj"), name=name) for name in names}
    labelled = tuple(Labelled(part, np.asarray(labels == label)) for label, part in objects)
    return LabelledScene(folder.name, reading.view, reading.knows_world, tuple(parts.values()), LabelJudge(reading.view, labelled, parts))
