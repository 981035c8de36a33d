"""A program for a controller: the steps of the MOVEs in a `handey/move/1` file, and nothing else of it.

The file may come from anywhere. Names become identifiers in other languages, so they must be identifiers; numbers must be numbers.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, get_args

import msgspec
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.task.plan import StepKind

SCHEMA = "handey/move/1"
KINDS: tuple[StepKind, ...] = get_args(StepKind)
IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
MAX_FILE_BYTES = 256_000_000
MAX_STEPS, MAX_SAMPLES, MAX_JOINTS = 2000, 1_000_000, 16
STILL_RAD, STILL_M = 1e-9, 1e-9


@dataclass(frozen=True, eq=False)
class ProgramStep(Value):
    """One step: joints `q_rad` (n, joints) and fingers `opening_m` (n,) at `time_s` (n,) from the step's start."""

    kind: StepKind
    time_s: NDArray
    q_rad: NDArray
    opening_m: NDArray

    def __post_init__(self) -> None:
        for key in ("time_s", "q_rad", "opening_m"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))

    @property
    def moves_arm(self) -> bool:
        return bool(np.ptp(self.q_rad, axis=0).max() > STILL_RAD)

    @property
    def moves_hand(self) -> bool:
        return bool(np.ptp(self.opening_m) > STILL_M)


@dataclass(frozen=True, eq=False)
class Program(Value):
    """The steps of one MOVE or of several, one after the other, for a robot with these joints."""

    robot: str
    joint_names: tuple[str, ...]
    steps: tuple[ProgramStep, ...]

    @property
    def duration(self) -> float:
        """Length of all steps together [s]."""
        return sum(float(step.time_s[-1]) for step in self.steps)


class _Step(msgspec.Struct):
    kind: StepKind
    joint_names: Annotated[tuple[str, ...], msgspec.Meta(min_length=1, max_length=MAX_JOINTS)]
    time_s: Annotated[list[float], msgspec.Meta(min_length=1, max_length=MAX_SAMPLES)]
    q_rad: Annotated[list[list[float]], msgspec.Meta(min_length=1, max_length=MAX_SAMPLES)]
    hand_opening_m: Annotated[list[float], msgspec.Meta(min_length=1, max_length=MAX_SAMPLES)]


class _Move(msgspec.Struct):
    status: str
    steps: Annotated[list[_Step], msgspec.Meta(max_length=MAX_STEPS)]


class _Moves(msgspec.Struct):
    schema: str
    robot: str
    moves: list[_Move]


def read_program(path: Path) -> Program:
    """The program in a file that `handey move` or `handey plan` wrote. Raises BadInput with one sentence."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise BadInput(f'"{path}" cannot be read: {error.strerror}.') from None
    if len(data) > MAX_FILE_BYTES:
        raise BadInput(f'"{path}" is larger than {MAX_FILE_BYTES} bytes, the limit for a plan.')
    try:
        return program_from_move(data)
    except BadInput as error:
        raise BadInput(f'"{path}" cannot be exported: {error}') from None


def program_from_move(data: bytes) -> Program:
    """The steps of every MOVE that has a plan and did not fail, from the bytes of the JSON."""
    try:
        read = msgspec.json.decode(data, type=_Moves)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInput(f'it is no "{SCHEMA}" file: {str(error).rstrip(".")}.') from None
    if read.schema != SCHEMA:
        raise BadInput(f'its "schema" is "{read.schema[:40]}"; it must be "{SCHEMA}".')
    steps = [step for move in read.moves if move.status in ("planned", "done") for step in move.steps]
    if not steps:
        raise BadInput(f"none of its {len(read.moves)} MOVEs has a plan that did not fail.")
    names = steps[0].joint_names
    check_names(read.robot, names)
    for number, step in enumerate(steps, start=1):
        if step.joint_names != names:
            raise BadInput(f"step {number} has the joints {_listed(step.joint_names)}, step 1 {_listed(names)}; they must be the same.")
    return Program(read.robot, names, tuple(_step(number, step) for number, step in enumerate(steps, start=1)))


def check_names(robot: str, joint_names: tuple[str, ...]) -> None:
    """Raises BadInput for a name that is no identifier, as it would be written into a program as it is."""
    for what, name in [("robot", robot), *(("joint", name) for name in joint_names)]:
        if not IDENTIFIER.fullmatch(name):
            raise BadInput(
                f'the {what} name {name[:40]!r} is no identifier; it takes a letter and then letters, digits and "_", at most 64.'
            )
    if len(set(joint_names)) != len(joint_names):
        raise BadInput(f"the joints {_listed(joint_names)} are not all different.")


def _step(number: int, step: _Step) -> ProgramStep:
    shape = (len(step.time_s), len(step.joint_names))
    if len(step.q_rad) != shape[0] or len(step.hand_opening_m) != shape[0] or any(len(q) != shape[1] for q in step.q_rad):
        raise BadInput(f"step {number} ({step.kind}) needs {shape[1]} angles and one opening for each of its {shape[0]} times.")
    made = ProgramStep(step.kind, np.array(step.time_s), np.array(step.q_rad), np.array(step.hand_opening_m))
    if not (np.isfinite(made.time_s).all() and np.isfinite(made.q_rad).all() and np.isfinite(made.opening_m).all()):
        raise BadInput(f"step {number} ({step.kind}) holds a number that is not finite.")
    if made.time_s[0] != 0.0 or (np.diff(made.time_s) <= 0).any():
        raise BadInput(f"step {number} ({step.kind}) has times that do not rise from 0.")
    return made


def kind_of(word: str) -> StepKind:
    """The kind of step that a word names. Raises BadInput for any other word."""
    for kind in KINDS:
        if word == kind:
            return kind
    raise BadInput(f"{word[:20]!r} is no kind of step; choose one of: {', '.join(KINDS)}.")


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(repr(name[:40]) for name in names)
