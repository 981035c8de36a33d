"""Sessions made by hand: a small workcell, a scan of two blocks, and a plan that carries a part along a straight joint line."""

from dataclasses import replace

import numpy as np

from handey_studio.base import Ledger
from handey_studio.cell.recording import Event, Recording, Tracking
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry.transforms import from_xyz_rpy, inverse
from handey_studio.grasping import BumpRun, GraspPlane
from handey_studio.localization import DataEdge, Hypothesis, LocateResult
from handey_studio.motion import Certificate
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.session import Session, new_session
from handey_studio.task.acting.performance import Check, Incident, Performance, Performed, Recovery
from handey_studio.task.plan import Attempt, Carry, GraspChoice, MoveCommand, MovePlan, MoveResult, Step
from handey_studio.task.ruled_out import RuledOut
from handey_studio.task.sense import Scene
from handey_studio.world import Library, PlacedPart, Robot, arm_of

T_START = from_xyz_rpy((0.48, 0.02, 0.0), (0.0, 0.0, 0.3))


def hand_made_scan(cells: int = 80, cell: float = 0.005, seed: int = 0) -> DepthMap:
    """A table with two blocks, a noisy reading a cell, and a few holes."""
    rng = np.random.default_rng(seed)
    elevation = rng.normal(0.0, 0.0003, (cells, cells))
    elevation[20:32, 15:40] += 0.03
    elevation[50:60, 50:58] += 0.055
    elevation[rng.random(elevation.shape) < 0.02] = np.nan
    T_world_range = from_xyz_rpy((0.48 - cells * cell / 2, -cells * cell / 2, 0.0))
    return DepthMap(elevation, cell, T_world_range, np.nan_to_num(elevation, nan=0.05))


def hand_made_plan(robot: Robot, part: str = "l_block#1") -> MovePlan:
    """Reach, close, carry, open, retreat: no planner made it, but it is continuous and its frames agree."""
    away = robot.home + np.array([0.4, 0.3, -0.2, 0.0, 0.0, 0.5])
    there = robot.home + np.array([-0.6, 0.2, 0.1, 0.0, 0.0, -0.4])
    T_hand_part = inverse(arm_of(robot).hand_pose(away)) @ T_START
    goal = arm_of(robot).hand_pose(there) @ T_hand_part
    steps = (
        line(robot, "free", robot.home, away, (0.1, 0.1)),
        line(robot, "close", away, away, (0.1, 0.04)),
        line(robot, "transfer", away, there, (0.04, 0.04), T_hand_part, part),
        line(robot, "open", there, there, (0.04, 0.1)),
        line(robot, "retreat", there, robot.home, (0.1, 0.1)),
    )
    certificate = Certificate(0.004, (3, 0.5), ("finger_left", "depth map"), True, 0.001)
    return MovePlan(part, (Carry(T_START, goal, hand_made_grasp(T_hand_part), hand_made_approach()),), steps, certificate)


def hand_made_grasp(T_hand_part) -> GraspChoice:
    """A grasp of the two long faces of a block."""
    edge = np.array([[0.0, 0.03, 0.0], [0.03, 0.03, 0.0]])
    contact = np.array([[0.0, 0.0, 0.02], [0.03, 0.0, 0.02], [0.03, 0.03, 0.02], [0.0, 0.03, 0.02]])
    ranges = np.array([[1.2, 1.9]])
    words = "faces 1–3 (40 mm)", (1, 3), "edge 0, centre, 20 mm deep"
    return GraspChoice(*words, T_hand_part, np.eye(4), edge, contact, 1.57, ranges, (0.1, 0.2), 0.04, 0.06, 4e-4, 0.8)


def hand_made_approach() -> BumpRun:
    """The hand comes straight down between two heaps."""
    n, cell = 220, 0.002
    y = (np.arange(n) + 0.5) * cell - 0.22
    filled = (np.arange(n)[None, :] < 110) | ((np.abs(y)[:, None] > 0.06) & (np.arange(n)[None, :] < 130))
    plane = GraspPlane(T_START, np.array([-0.22, -0.22]), cell, filled, filled)
    path = np.c_[np.linspace(0.02, 0.0, 30), np.linspace(0.15, 0.02, 30), np.full(30, -np.pi / 2)]
    return BumpRun(plane, path, path[-1, :2], "reached", 0.0)


def hand_made_edges() -> tuple[DataEdge, ...]:
    """Two edges on the table."""
    ends = np.array([[[0.40, 0.0, 0.03], [0.46, 0.02, 0.03]], [[0.46, 0.02, 0.03], [0.44, 0.06, 0.03]]])
    up = np.array([[0.0, 0.0, 1.0]])
    return tuple(DataEdge("jump", pair, pair, up, up, 40, 0.0003) for pair in ends)


def hand_made_hypotheses() -> tuple[Hypothesis, ...]:
    """One that stood and one that fell."""
    aside = from_xyz_rpy((0.44, 0.06, 0.0))
    fell = Hypothesis("brick", aside, 0.31, 0.05, 0.11, (0, 1), "too few edges found", (2, 3))
    return (Hypothesis("l_block", T_START, 0.93, 0.20, 0.01, (0, 1), None, (0, 3)), fell)


def line(robot: Robot, kind, start, end, opening, T_hand_part=None, held=None) -> Step:
    """A step of two seconds in 21 samples."""
    s = np.linspace(0.0, 1.0, 21)
    q = start + s[:, None] * (np.asarray(end) - start)
    openings, clearances = opening[0] + s * (opening[1] - opening[0]), np.full_like(s, 0.02)
    return Step(kind, robot.joint_names, 2.0 * s, q, openings, held, T_hand_part, (), clearances)


def hand_made_performance(plan: MovePlan, until: int | None = None, incident: Incident | None = None) -> Performance:
    """A plan carried out in its own time up to a step: each joint lags 2 mrad behind, a held part weighs 5 N, touching shows as 8 N."""
    steps, performed, start = plan.steps[:until], [], 0.0
    for number, step in enumerate(steps):
        n = len(step.time_s)
        weight = np.where(step.held is not None, 5.0, 0.0) + np.where(np.arange(n) == n - 1, 3.0, 0.0) * (step.kind == "transfer")
        force = np.c_[np.zeros((n, 2)), -np.broadcast_to(weight, n)]
        touched = step.kind == "close" and not (incident and incident.kind == "missed")
        events = (Event(float(step.time_s[-1]), "touch", 8.0),) if step.kind in ("close", "transfer") else ()
        recording = Recording(
            step.time_s, step.q_rad - 0.002, step.q_rad, step.hand_opening_m, np.full(n, 20.0), force, np.zeros((n, 3)), events
        )
        performed.append(Performed(number, step.kind, start, "contact" if touched else "arrived", recording, Tracking(0.002, 1.5)))
        start += float(step.time_s[-1]) + 0.5
    return Performance(tuple(performed), (incident,) if incident else ())


def ledger():
    """A few entries of two stages, one of which fell without a number."""
    book = Ledger()
    search = book.add("move", "l_block#1 to the table")
    for angle in range(0, 90, 30):
        book.add("grasp", f"faces 1 and 3 at {angle}°", "tilted too far", parent=search, value=float(angle), limit=20.0, unit="deg")
    book.add("grasp", "faces 2 and 4", "no inverse kinematics", parent=search, bodies=("wrist_3_link",))
    book.add("grasp", "faces 0 and 5 at 0°", parent=search)
    return book.entries


def library(folder) -> Library:
    """An empty library of the user's own, before the bundled one."""
    return Library(folder)


def fresh_session(folder) -> Session:
    """A session in which nothing was done yet."""
    command = MoveCommand("l_block", "0.35,-0.35,0,0,0,90")
    return new_session("sample", Workcell(parts=("l_block", "brick")), library(folder), (command,), seed=7)


def full_session(folder) -> Session:
    """A session with a scan, located parts and a planned MOVE."""
    session = fresh_session(folder)
    plan = hand_made_plan(library(folder).robot("ur5"))
    result = MoveResult(session.commands[0], "planned", "", plan, ledger=ledger(), timing_s={"sense": 1.25, "plan": 3.5})
    brick = PlacedPart("brick#1", session.parts[1], from_xyz_rpy((0.42, -0.08, 0.0)))
    located = (PlacedPart("l_block#1", session.parts[0], T_START), brick)
    scene = Scene(hand_made_scan(), LocateResult((), hand_made_edges(), hand_made_hypotheses(), ()), located)
    return replace(session, scene=scene, results=(result,))


def performed_session(folder) -> Session:
    """A session whose MOVE was done at the second attempt: in the first the part was dropped on the way."""
    session = full_session(folder)
    planned = session.results[0]
    assert planned.plan is not None
    dropped = Incident("dropped", 2, "the part fell out of the fingers", 0.002, 0.0375, "m")
    first = hand_made_performance(planned.plan, 3, dropped)
    why = "what fell can be taken up again: 2 of 3 attempts are left"
    recovery = Recovery(
        dropped, why, ("the hand went home", "the table was scanned anew"), RuledOut("grasp", "it slipped out of this grasp")
    )
    check = Check("seen", "seen where it was to be", planned.plan.T_world_part_goal, 0.0004, 0.002)
    second = replace(hand_made_performance(planned.plan), check=check)
    attempt = Attempt(planned.plan, first, recovery)
    done = replace(planned, status="done", performance=second, attempts=(attempt,), T_world_part_reached=check.T_world_part, physics=True)
    return replace(session, results=(done,))
