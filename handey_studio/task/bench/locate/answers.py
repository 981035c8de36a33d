"""How each method answers "where is this part?": Handey Studio as a user calls it, and its peers."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.localization import LocateOptions, LocateResult, localize
from handey_studio.sensing.support import support_plane
from handey_studio.task.bench.locate.labelled_scenes import LabelledScene
from handey_studio.world.part import Part

OURS = "handey"
MAX_POSES = 5
TOGETHER, EACH = ASKED = ("together", "each")


@dataclass(frozen=True, eq=False)
class Pose(Value):
    """A reported pose (4, 4) with the method's own score."""

    T_sensor_part: NDArray
    score: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_sensor_part", frozen_array(self.T_sensor_part))


@dataclass(frozen=True, eq=False)
class Answer(Value):
    """The poses of a part that a method stands by, best first, and the seconds from the view in memory to the answer: of a call for
    several parts, the share of one."""

    poses: tuple[Pose, ...]
    seconds: float
    reason: str = ""


class Method(Protocol):
    """Something that locates parts."""

    @property
    def name(self) -> str: ...

    def see(self, scene: LabelledScene) -> None:
        """The scene that the following questions are about."""
        ...

    def locate(self, parts: Sequence[Part]) -> tuple[Answer, ...]:
        """Where each part is in the scene seen last."""
        ...


class Handey:
    """One call of `localize` for all parts `together`, as in a cell that knows its parts, or one for `each`; the support plane is found
    first where the file does not tell where the sensor stands."""

    name = OURS

    def __init__(self, ask: str = TOGETHER) -> None:
        self._ask = ask
        self._scene: LabelledScene | None = None

    def see(self, scene: LabelledScene) -> None:
        self._scene = scene

    def locate(self, parts: Sequence[Part]) -> tuple[Answer, ...]:
        if self._ask == TOGETHER:
            return self._call(parts)
        return tuple(answer for part in parts for answer in self._call((part,)))

    def _call(self, parts: Sequence[Part]) -> tuple[Answer, ...]:
        assert self._scene is not None
        begun = time.perf_counter()
        view, options = self._scene.view, LocateOptions(max_poses=MAX_POSES)
        rng = np.random.default_rng(0)
        if not self._scene.knows_world:
            support = support_plane(view, rng)
            view = replace(view, T_world_sensor=support.T_world_sensor)
            options = options if support.found else replace(options, table_z_m=None)
        result = localize(view, parts, options, rng)
        seconds = (time.perf_counter() - begun) / len(parts)
        return tuple(_answer(result, part, seconds) for part in parts)


def _answer(result: LocateResult, part: Part, seconds: float) -> Answer:
    """What a result says of one of the parts."""
    poses = tuple(Pose(pose.T_sensor_part, pose.score) for pose in result.poses if pose.part == part.name)
    fell = next((f"the best hypothesis of {part.name} fell because {h.reason}." for h in result.hypotheses if h.part == part.name), "")
    return Answer(poses, seconds, "" if poses else result.reason or fell or f"no hypothesis of {part.name} is among the best.")


def warm_up(methods: Sequence[Method], scene: LabelledScene) -> None:
    """One question that is not counted, so that nobody's compiling or loading is measured."""
    for method in methods:
        method.see(scene)
        method.locate(scene.parts[:1])
