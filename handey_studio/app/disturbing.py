"""What a user can make go wrong in a simulated cell, on purpose, to see it noticed and put right."""

from dataclasses import dataclass

import numpy as np

from handey_studio.app.jobs import check_idle
from handey_studio.app.settings import with_disturbances
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.cell.faults import Fault
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.session import Session
from handey_studio.session.destination import destination_pose
from handey_studio.task.acting.motions import fingers_only
from handey_studio.task.plan import MovePlan, Step

MAX_FAULTS = 12
FOR_A_MOMENT_S, SLIP_S = 0.15, 1.5  # a push, and the time in which a part slips or falls


@dataclass(frozen=True)
class Kind:
    """A kind of disturbance: what it is called, what it does in a sentence, what its size is called (with unit, lowest, usual, highest) and
    during which motion it comes, with how many of that kind are before it."""

    name: str
    what: str
    size: str
    least: float
    usual: float
    most: float
    call: str
    count: int


KINDS = (
    Kind("slip", "For a moment the friction between fingers and part falls to this.", "Friction left (%)", 0.0, 0.0, 100.0, "follow", 4),
    Kind("push", "A force shoves what the hand holds sideways.", "Force (N)", 1.0, 25.0, 200.0, "follow", 4),
    Kind("bias", "The next scan comes out shifted along x.", "Shift (mm)", -50.0, 6.0, 50.0, "scan", 1),
    Kind("obstacle", "A cube that no scan has seen stands on the way to the destination.", "Side (mm)", 10.0, 60.0, 200.0, "follow", 1),
    Kind("stuck", "The fingers stay where they are when they come to this opening.", "Opening (mm)", 0.0, 60.0, 200.0, "grip", 1),
    Kind("blocked", "A joint is jammed.", "Joint (from 1)", 1.0, 2.0, 7.0, "follow", 3),
)
CALLS = ("scan", "follow", "grip", "descend", "settle")
CALL_WORDS = {
    "scan": "scan",
    "follow": "motion of the arm",
    "grip": "closing or opening of the hand",
    "descend": "guarded descent",
    "settle": "settling",
}


USUAL = {
    "follow": ("to the part", "approach", "lift", "transfer", "retreat", "home"),
    "grip": ("open", "close", "open again"),
    "descend": ("place",),
    "settle": ("after place",),
}  # without a regrasp, while no plan tells it


def kind_of(name: str) -> Kind:
    """The kind of that name."""
    return next(kind for kind in KINDS if kind.name == name)


def which_words(plan: MovePlan | None, call: str) -> str:
    """Which of a MOVE's motions is the first `call`, the second, and so on."""
    if call == "scan":
        return "1 is the scan that a MOVE is planned on; a later one checks what was done."
    names = USUAL[call] if plan is None else [step.kind for step in plan.steps if call in calls_of(step)]
    told = ", ".join(f"{number} {name}" for number, name in enumerate(names, start=1)) or "none"
    return f"{'In a MOVE without a regrasp' if plan is None else 'In the plan that is looked at'}: {told}."


def calls_of(step: Step) -> tuple[str, ...]:
    """What the cell is asked for in a step of a plan."""
    if step.kind in ("close", "open") or fingers_only(step):
        return ("grip",)
    return ("descend", "settle") if step.kind == "place" else ("follow",)


@dataclass(frozen=True)
class AddFault:
    """`kind` goes wrong with `size` in the kind's own unit, `after_s` into the `count`th `call`."""

    kind: str
    size: float
    call: str
    count: int
    after_s: float

    def apply(self, state: State) -> State:
        check_idle(state)
        faults = state.session.workcell.setup.faults
        if len(faults) >= MAX_FAULTS:
            raise BadInput(f"{MAX_FAULTS} disturbances are set already; clear them first.")
        fault = fault_of(self, state.session)
        return _with(state, f"disturb: {self.kind}", state.session.workcell.setup.physics, (*faults, fault))


@dataclass(frozen=True)
class ClearFaults:
    def apply(self, state: State) -> State:
        check_idle(state)
        return _with(state, "clear disturbances", state.session.workcell.setup.physics, ())


@dataclass(frozen=True)
class SetPhysics:
    """Whether the simulated cell obeys forces."""

    physics: bool

    def apply(self, state: State) -> State:
        check_idle(state)
        setup = state.session.workcell.setup
        return _with(state, "physics on" if self.physics else "physics off", self.physics, setup.faults)


def fault_of(asked: AddFault, session: Session) -> Fault:
    """The fault as the cell takes it. Raises BadInput for a size out of its limits."""
    kind = kind_of(asked.kind)
    if not kind.least <= asked.size <= kind.most:
        raise BadInput(f"{kind.size} is {asked.size:g}; it must be from {kind.least:g} to {kind.most:g}.")
    when = {"call": asked.call, "count": max(1, asked.count), "time_s": max(0.0, asked.after_s)}
    if kind.name == "slip":
        return Fault("slip", **when, lasts_s=SLIP_S, size=asked.size / 100.0)
    if kind.name == "push":
        return Fault("push", **when, lasts_s=FOR_A_MOMENT_S, vector=np.array([0.0, asked.size, 0.0]))
    if kind.name == "bias":
        return Fault("bias", **when, lasts_s=0.0, vector=np.array([asked.size / 1e3, 0.0, 0.0]))
    if kind.name == "obstacle":
        return Fault("obstacle", **when, vector=np.full(3, asked.size / 1e3), T_world_body=_on_the_way(session, asked.size / 1e3))
    if kind.name == "stuck":
        return Fault("stuck", **when, size=asked.size / 1e3)
    return Fault("blocked", **when, size=asked.size - 1.0)


def words_of(fault: Fault) -> str:
    """A fault as it was set, in words."""
    sizes = {
        "slip": f"friction falls to {100 * fault.size:.0f} %",
        "push": f"{np.linalg.norm(fault.vector):.0f} N on what the hand holds"
        if not fault.body
        else f"{np.linalg.norm(fault.vector):.0f} N",
        "bias": f"scan shifted by {1e3 * np.linalg.norm(fault.vector):.1f} mm",
        "obstacle": f"an unseen cube of {1e3 * fault.vector[0]:.0f} mm",
        "stuck": f"fingers stay at {1e3 * fault.size:.0f} mm",
        "blocked": f"joint {fault.size + 1:.0f} is jammed",
    }
    return f"{sizes[fault.kind]}, {fault.time_s:g} s into {CALL_WORDS[fault.call]} {fault.count}"


def _with(state: State, label: str, physics: bool, faults: tuple[Fault, ...]) -> State:
    return state.changed(label, with_disturbances(state.session, physics, faults))


def _on_the_way(session: Session, side: float) -> np.ndarray:
    """Where a cube stands that is met on the way: on the table, half way between where the part is and where it goes."""
    placed = session.located[0].T_world_part[:3, 3] if session.located else np.array([0.48, 0.0, 0.0])
    goal = destination_pose(session, session.commands[-1]) if session.commands else None
    middle = placed if goal is None else (placed + goal[:3, 3]) / 2.0
    return from_xyz_rpy((float(middle[0]), float(middle[1]), session.workcell.table_z + side / 2.0), (0.0, 0.0, 0.0))
