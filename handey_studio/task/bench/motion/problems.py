"""Problems to plan for: folders of MoveIt scenes with requests, one family a folder."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.world import Held, Robot, World
from handey_studio.world.envelope import enveloped
from handey_studio.world.moveit import read_request, read_scene

SCENE, REQUEST = ".scene.yaml", ".request.yaml"


@dataclass(frozen=True, eq=False)
class Problem(Value):
    """From `start` to `goal` (joints,) [rad] in a world, with the fingers `opening` [m] apart around what is held."""

    family: str
    name: str
    world: World
    start: NDArray
    goal: NDArray
    opening: float
    held: Held | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen_array(self.start))
        object.__setattr__(self, "goal", frozen_array(self.goal))


def problem_files(folder: Path) -> list[Path]:
    """The scenes in a folder and below that have a request beside them. Raises BadInput when there are none."""
    if not folder.is_dir():
        raise BadInput(f'there is no folder "{folder}".')
    scenes = [scene for scene in sorted(folder.rglob(f"*{SCENE}")) if _request(scene).is_file()]
    if not scenes:
        raise BadInput(f'the folder "{folder}" has no problems: NAME{SCENE} beside NAME{REQUEST}, in it or in a folder for each family.')
    return scenes


def read_problems(scenes: list[Path], folder: Path, robot: Robot) -> Iterator[Problem]:
    """The problems of scene files, with the hand as its envelope: nothing is said of its opening."""
    robot = enveloped(robot)
    for scene in scenes:
        asked = read_request(_request(scene), robot)
        family = scene.parent.relative_to(folder).as_posix()
        name = scene.name.removesuffix(SCENE)
        yield Problem(family, name, read_scene(scene, robot), asked.start, asked.goal, robot.hand.opening_min)


def _request(scene: Path) -> Path:
    return scene.with_name(scene.name.removesuffix(SCENE) + REQUEST)


def length(path: NDArray) -> float:
    """Length [rad] of a path (n, joints) in joint space."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
