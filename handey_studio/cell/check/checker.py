"""The independent check of a finished plan against the true scene.

It shares no collision code with the planners: exact link meshes and true bodies, a fine step in joint space, and rules for
joint limits, speeds and the seams between steps. Benchmarks and tests use it; a planner may not, for it knows the truth.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.contacts import Contact, Sampled, Scene, contacts, true_scene
from handey_studio.geometry.transforms import inverse, pose_difference
from handey_studio.world.arm import Arm, arm_of
from handey_studio.world.robot import Robot

UNMODELLED = "depth map"  # the plan's name for all bodies that no model describes


class CheckedStep(Protocol):
    """What the checker reads of a plan's step; `q_rad` (n, joints), `time_s` (n,), `hand_opening_m` (n,)."""

    @property
    def kind(self) -> str: ...
    @property
    def q_rad(self) -> NDArray: ...
    @property
    def time_s(self) -> NDArray: ...
    @property
    def hand_opening_m(self) -> NDArray: ...
    @property
    def held(self) -> str | None: ...
    @property
    def allowed_contacts(self) -> Iterable[Sequence[str]]: ...


@dataclass(frozen=True)
class CheckOptions:
    """`step_rad` between checked configurations. Allowed pairs may meet to `allowed_depth`, the contract's 1 mm; others to
    `free_depth`, which is rounding. Seams may gap by `seam_rad` and `seam_m`; speeds exceed by the share `speed_slack`."""

    step_rad: float = 0.002
    allowed_depth: float = 0.001
    free_depth: float = 2e-5
    seam_rad: float = 1e-6
    seam_m: float = 1e-6
    speed_slack: float = 1e-6


@dataclass(frozen=True)
class Violation:
    """What is wrong at `time_s` of step number `step`: `value` in `unit` against its `limit`; `bodies` when they collide."""

    step: int
    kind: str
    time_s: float
    reason: str
    value: float
    limit: float
    unit: str
    bodies: tuple[str, ...] = ()


@dataclass(frozen=True)
class CheckReport:
    """All violations (the deepest for each step and pair), and how many configurations were checked."""

    violations: tuple[Violation, ...]
    configurations: int

    @property
    def ok(self) -> bool:
        return not self.violations


def names_in_plan(bodies: Sequence[SolidBody], located: Mapping[str, NDArray], limit: float = 0.03) -> dict[str, str]:
    """True body → the plan's name for it: the located instance (name → T_world_part) nearest to it within `limit` [m]."""
    called: dict[str, str] = {}
    for name, T in located.items():
        near = {body.name: pose_difference(body.T_world_body, T)[0] for body in bodies if not body.fixed and body.name not in called}
        best = min(near, key=near.__getitem__, default=None)
        if best is not None and near[best] <= limit:
            called[best] = name
    return called


def check_plan(
    steps: Sequence[CheckedStep],
    bodies: Sequence[SolidBody],
    robot: Robot,
    called: Mapping[str, str] | None = None,
    options: CheckOptions = CheckOptions(),
) -> CheckReport:
    """Check every step against the true bodies, as they stand before the first.

    `called` maps true names to the plan's (see `names_in_plan`); free bodies that it leaves out are the `depth map`. The
    held body follows the hand from its true pose when it is first held, and stays where the hand lets go of it.
    """
    arm = arm_of(robot)
    names = {body.name: (called or {}).get(body.name, body.name if body.fixed else UNMODELLED) for body in bodies}
    scene = true_scene(robot, bodies, names)
    violations: list[Violation] = []
    count = 0
    before: CheckedStep | None = None
    for number, step in enumerate(steps):
        violations += _rules(number, step, before, robot, options)
        scene = _with_held(scene, step, before, arm)
        sampled = _sampled(step, options.step_rad)
        count += len(sampled.time)
        found = contacts(scene, arm, sampled, frozenset(frozenset(pair) for pair in step.allowed_contacts), options)
        violations += [_violation(number, step, contact) for contact in found]
        before = step
    return CheckReport(tuple(violations), count)


def _with_held(scene: Scene, step: CheckedStep, before: CheckedStep | None, arm: Arm) -> Scene:
    """The scene with what the hand holds in this step taken up, or with what it let go of put down."""
    if before is not None and before.held is not None and step.held != before.held:
        scene = scene.released(arm.hand_pose(before.q_rad[-1]))
    if step.held is not None and scene.held is None:
        matches = [body for body in scene.bodies if scene.names[body.name] == step.held]
        if not matches:
            raise BadInput(f'the plan holds "{step.held}", which is none of the true bodies; it knows {sorted(set(scene.names.values()))}.')
        T_hand_body = inverse(arm.hand_pose(step.q_rad[0])) @ matches[0].T_world_body
        scene = scene.holding(matches[0], T_hand_body)
    return scene


def _sampled(step: CheckedStep, step_rad: float) -> Sampled:
    """The step at configurations no more than `step_rad` apart in any joint, and no more than 0.2 mm in the opening."""
    moves = np.abs(np.diff(step.q_rad, axis=0)).max(axis=1, initial=0.0) / step_rad
    closes = np.abs(np.diff(step.hand_opening_m)) / 2e-4
    counts = np.maximum(1, np.ceil(np.maximum(moves, closes))).astype(int)
    knots = np.arange(len(step.time_s), dtype=float)
    at = np.concatenate([*(k + np.arange(n) / n for k, n in enumerate(counts)), knots[-1:]])
    q = np.stack([np.interp(at, knots, column) for column in step.q_rad.T], axis=1)
    return Sampled(np.interp(at, knots, step.time_s), q, np.interp(at, knots, step.hand_opening_m))


def _violation(number: int, step: CheckedStep, contact: Contact) -> Violation:
    reason = "bodies meet deeper than allowed" if contact.allowed else "bodies collide"
    return Violation(number, step.kind, contact.time, reason, contact.depth, contact.limit, "m", contact.bodies)


def _rules(number: int, step: CheckedStep, before: CheckedStep | None, robot: Robot, options: CheckOptions) -> list[Violation]:
    """Joint limits, speeds, the hand's range, and the seam with the step before."""
    found = []

    def hold(reason: str, values: NDArray, limit: float, unit: str, times: NDArray) -> None:
        if len(values) and not values.max() <= limit:
            worst = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
            found.append(Violation(number, step.kind, float(times[worst]), reason, float(values[worst]), limit, unit))

    q, times, opening = step.q_rad, step.time_s, step.hand_opening_m
    hold("beyond a joint limit", -robot.limit_margin(q), 1e-9, "rad", times)
    spans = np.diff(times)
    hold("time runs backwards", -spans, 0.0, "s", times)
    with np.errstate(divide="ignore", invalid="ignore"):
        speeds = np.where(np.diff(q, axis=0) == 0, 0.0, np.abs(np.diff(q, axis=0)) / np.maximum(spans, 0.0)[:, None]) / robot.velocity
    hold("a joint is faster than its limit (as a share of it)", speeds.max(axis=1, initial=0.0), 1.0 + options.speed_slack, "", times)
    hold("beyond the hand's opening", np.maximum(opening - robot.hand.opening_max, robot.hand.opening_min - opening), 1e-9, "m", times)
    if before is not None:
        gap = np.abs(q[:1] - before.q_rad[-1]).max(axis=1)
        hold("the arm jumps between steps", gap, options.seam_rad, "rad", times)
        hold("the fingers jump between steps", np.abs(opening[:1] - before.hand_opening_m[-1]), options.seam_m, "m", times)
    return found
