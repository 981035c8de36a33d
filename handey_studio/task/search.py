"""The options of a MOVE as one search: the answer to what Handey 1987 §7 calls its most significant lesson.

Instance × place × symmetry × grasp group × hand angle × way round × arm branches, and for a part that is put down on the way all of it
again: a tree that is opened best first, by how good an option is and what a plan from it should still cost to find (`stages`).
Cheap tests come first. Nothing is tested twice, and an arm motion that is not found postpones the options that are nearly the same.
Every option that falls stays in the ledger; so do those that were not looked at, as a number.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from heapq import heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Progress, Share
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import GraspPlane, LegalRotations, legal_rotations, rank_terms, within_reach
from handey_studio.task.carrying import Carried, Kept, Start, join, worst
from handey_studio.task.detours import detours
from handey_studio.task.ends import PICKUP, PUTDOWN, End, pickup_end, putdown_end, reachable
from handey_studio.task.grasps import Approach, Grasp, approach_at, fall_illegal, grasp_plane_at, grasps_at
from handey_studio.task.options import Goal, Option, options_of
from handey_studio.task.plan import Carry, MovePlan, Step
from handey_studio.task.removal import Known, removal
from handey_studio.task.ruled_out import RuledOut, grasp_ruled_out, place_ruled_out, way_ruled_out
from handey_studio.task.stages import APPROACH, DETOUR, PATHS, REACH, ROTATIONS, STAGES, STRAIGHT, left

ANGLES = 4  # hand angles of one group that are looked at, the most vertical first
WORTH_S = 0.3  # what a radian less of tilt is worth in time to plan
TURN_COST = 0.3  # a radian of the joint that turns most counts as so many radians of tilt
USUAL_TURN_RAD = 2.5  # which is what it turns by as long as nobody knows better
REGRASP_S = 2.0  # each time that the part is put down on the way
DETOUR_COST = 1.0  # [rad] each further place to put it down is worth that much less
SAME_ANGLE_RAD = np.deg2rad(2.0)  # a hand that ends so near to the angle that was asked for is at it
EXACT_COST = 0.3  # [rad] what it is worth to end where bump lines lead
LED_COST = 0.5  # [rad] what it is worth to lift the part straight up and put it straight down
ALIKE_RAD = 0.35  # configurations that differ by less than this in every joint are neighbours
NEIGHBOUR_S = 1.0  # for each neighbour whose arm motion was not found


@dataclass(frozen=True)
class SearchOptions:
    """`effort` [s on an ordinary machine, by the constants of `stages`] is the work after which the search gives up; `improve` is how
    many more whole plans are looked at once there is one; `regrasps` how often the part may be put down on the way; `ruled_out` was carried
    out before and failed."""

    effort: float = 40.0
    improve: int = 0
    regrasps: int = 2
    ruled_out: tuple[RuledOut, ...] = ()


class Route(NamedTuple):
    """The places that the part goes to one after the other, and the carries that are planned so far."""

    goals: tuple[Goal, ...]
    done: tuple[Carried, ...] = ()

    @property
    def goal(self) -> Goal:
        """Where the next carry goes."""
        return self.goals[len(self.done)]


class Node(NamedTuple):
    """An option as far as it was tested: what it is, its cost [rad of tilt], the ledger's entry it belongs to, and how many neighbours'
    arm motions were not found."""

    stage: int
    route: Route
    what: Any
    cost: float
    entry: int
    postponed: int = 0


@dataclass(eq=False)
class OptionSearch:
    """One search. `run` gives the plans as they are found."""

    start: Start
    ledger: Ledger
    progress: Progress
    rng: np.random.Generator
    options: SearchOptions
    spent: float = 0.0
    _heap: list[tuple[float, int, Node]] = field(default_factory=list)
    _pushed: int = 0
    _spare: list[Node] = field(default_factory=list)
    _planned: set[tuple[tuple[Goal, ...], int]] = field(default_factory=set)
    _kept: Kept = field(default_factory=dict)
    _shut: dict[tuple, LegalRotations] = field(default_factory=dict)
    _planes: dict[tuple, GraspPlane] = field(default_factory=dict)
    _approaches: dict[tuple, Approach] = field(default_factory=dict)
    _ends: dict[tuple, End | None] = field(default_factory=dict)
    _removals: Known = field(default_factory=dict)
    _lost: list[NDArray] = field(default_factory=list)

    @property
    def waiting(self) -> list[Node]:
        """The options that were not looked at."""
        return [*(node for _, _, node in self._heap), *self._spare]

    def run(self, goals: list[Goal]) -> Iterator[MovePlan]:
        """Plans, the first one soon. Ends when nothing is left, when the effort is spent, or on cancel."""
        for goal in goals:
            if self._falls(goal.entry, place_ruled_out(goal.T_world_goal, self.options.ruled_out)):
                continue
            self._begin(Route((goal,)))
            self._detour(goal, detours(goal, self.options.regrasps, self.ledger), 0)
        while self._any() and self.spent < self.options.effort and not self.progress.cancelled:
            node = heappop(self._heap)[2]
            if (node.route.goals, len(node.route.done)) in self._planned:
                self._spare.append(node)
                continue
            postponed = self._neighbours(node) if node.stage == PATHS else 0
            if postponed > node.postponed:
                self._push(node._replace(postponed=postponed))
                continue
            self.spent += STAGES[node.stage].seconds
            self._tell(node)
            plan = TESTS[node.stage](self, node)
            if plan is not None:
                yield plan

    def _any(self) -> bool:
        """Whether an option waits. Other ways to do a carry of a route that was planned once are taken up when nothing else is left."""
        if not self._heap and self._spare:
            self._planned.clear()
            for node in self._spare:
                self._push(node)
            self._spare.clear()
        return bool(self._heap)

    def _push(self, node: Node) -> None:
        later = len(node.route.goals) - len(node.route.done) - 1
        cost = node.cost + (TURN_COST * USUAL_TURN_RAD if node.stage < STRAIGHT else 0.0)
        expected = WORTH_S * cost + NEIGHBOUR_S * node.postponed + left(node.stage) + later * (left(ROTATIONS) + REGRASP_S)
        heappush(self._heap, (expected, self._pushed, node))
        self._pushed += 1

    def _falls(self, entry: int, ruled_out: RuledOut | None) -> bool:
        """Whether an option is ruled out; if so it falls."""
        if ruled_out is not None:
            self.ledger.fall(entry, f"ruled out: {ruled_out.why}")
        return ruled_out is not None

    def _detour(self, goal: Goal, ways: Iterator[tuple[Goal, ...]], count: int) -> None:
        """One node stands for all the ways on which the part is put down; the next of them is worked out when it is its turn."""
        self._push(Node(DETOUR, Route((goal, goal)), (ways, count), count * DETOUR_COST, goal.entry))

    def _open_detour(self, node: Node) -> None:
        ways, count = node.what
        goals = next(ways, None)
        if goals is not None:
            self._begin(Route(goals))
            self._detour(node.route.goal, ways, count + 1)

    def _tell(self, node: Node) -> None:
        what = {
            DETOUR: lambda: "a way on which the part is put down and taken anew",
            ROTATIONS: lambda: f"hand angles of {node.what.name}",
            APPROACH: lambda: f"approach to {node.what[0].name}",
            REACH: lambda: f"reach for {node.what.option.name}",
            STRAIGHT: lambda: f"straight motions for {node.what[0].option.name}",
            PATHS: lambda: f"arm motions for {node.what[0].option.name}",
        }[node.stage]()
        self.progress.report(min(self.spent / self.options.effort, 0.99), f"{what}; {len(self._heap)} more options wait")

    def _begin(self, route: Route, paid: float = 0.0) -> None:
        """All options of a route's next carry."""
        for option in options_of(route.goal, self.ledger):
            self._push(Node(ROTATIONS, route, option, paid + option.cost, route.goal.entry))

    def _neighbours(self, node: Node) -> int:
        """How many options nearly like this one had an arm motion that was not found."""
        key = _joint_key(node)
        return sum(len(key) == len(lost) and np.abs(key - lost).max() < ALIKE_RAD for lost in self._lost)

    def _rotations(self, node: Node) -> None:
        option: Option = node.what
        entry = self.ledger.add("grasp group", option.name, parent=node.entry)
        here = _pickup_of(option)
        rotations = self._shut.get(here) or legal_rotations(option.group, option.pickup, option.putdown)
        angles, rotations = within_reach(rotations, option.pickup, option.putdown, ANGLES)
        if not rotations.ranges("pickup"):
            self._shut[here] = rotations
        if not angles:
            fall_illegal(option, rotations, entry, self.ledger)
            tighter = option.opened_less() if rotations.shut_by_bodies else None
            if tighter is not None:
                self._push(node._replace(what=tighter, cost=node.cost + tighter.cost - option.cost))
        for angle in angles:
            cost = node.cost - option.cost + rank_terms(option.group, option.pickup, option.putdown, rotations, angle).cost
            self._push(Node(APPROACH, node.route, (option, rotations, angle, False), cost, entry))

    def _approach(self, node: Node) -> None:
        """The way in to one hand angle; where bump lines end at another, the way in that ends at just this one is another option."""
        option, rotations, angle, exact = node.what
        told = f"hand at {np.rad2deg(angle - option.group.angle):+.0f}°{', no other' if exact else ''}"
        entry = self.ledger.add("approach", told, parent=node.entry)
        way = self._way_in(option, rotations, angle, exact)
        if not exact and abs(way.final[2] - angle) > SAME_ANGLE_RAD:
            self._push(node._replace(what=(option, rotations, angle, True), cost=node.cost + EXACT_COST))
        for grasp in grasps_at(option, rotations, way, self._plane(option, 1), entry, self.ledger):
            T_part_hand, symmetries = inverse(grasp.choice.T_hand_part), option.goal.instance.part.symmetries
            if self._falls(grasp.entry, grasp_ruled_out(T_part_hand, symmetries, self.options.ruled_out)):
                continue
            self._push(Node(REACH, node.route, grasp, node.cost, grasp.entry))

    def _way_in(self, option: Option, rotations: LegalRotations, angle: float, exact: bool) -> Approach:
        """The approach at the pickup, which is the same wherever the part goes."""
        key = (*_pickup_of(option), angle, exact)
        if key not in self._approaches:
            legal = [(angle - SAME_ANGLE_RAD, angle + SAME_ANGLE_RAD)] if exact else rotations.ranges("pickup")
            self._approaches[key] = approach_at(option, self._plane(option, 0), angle, np.array(legal).reshape(-1, 2))
        return self._approaches[key]

    def _plane(self, option: Option, end: int) -> GraspPlane:
        """The grasp plane at one end (0 pickup, 1 putdown), filled once."""
        key = _pickup_of(option) if end == 0 else (option.goal.at_goal, option.goal.T_world_goal.tobytes(), option.group)
        if key not in self._planes:
            self._planes[key] = grasp_plane_at(option, end)
        return self._planes[key]

    def _reach(self, node: Node) -> None:
        grasp: Grasp = node.what
        q = self._q(node.route)
        pickups = reachable(grasp, PICKUP, q, self.ledger)
        putdowns = reachable(grasp, PUTDOWN, q, self.ledger) if pickups else []
        if not pickups or not putdowns:
            self.ledger.fall(grasp.entry, f"no arm configuration is free at the {PUTDOWN if pickups else PICKUP}")
            return
        held = grasp.option.goal.at_start.robot.held_index
        for a in pickups:
            for b in putdowns:
                turns = float(np.abs(a - q).max() + np.abs(b - a).max() + np.abs(b - a)[held].sum())
                self._push(Node(STRAIGHT, node.route, (grasp, a, b, False), node.cost + TURN_COST * turns, node.entry))

    def _straight(self, node: Node) -> None:
        """Straight up and straight down; where that is barred the part may be led, as another option."""
        grasp, a, b, led = node.what
        pickup = self._end(grasp, PICKUP, a, led)
        putdown = self._end(grasp, PUTDOWN, b, led) if pickup is not None else None
        if pickup is not None and putdown is not None:
            self._push(Node(PATHS, node.route, (grasp, pickup, putdown), node.cost, node.entry))
        elif not led:
            self._push(node._replace(what=(grasp, a, b, True), cost=node.cost + LED_COST))

    def _end(self, grasp: Grasp, where: str, q: NDArray, led: bool) -> End | None:
        """The motions at one end, led where straight ones were barred."""
        key = (grasp, where, q.tobytes(), led)
        if key not in self._ends:
            straight = self._end(grasp, where, q, False) if led else None
            way = removal(grasp, (PICKUP, PUTDOWN).index(where), self._removals, self.ledger) if led and straight is None else None
            plan = pickup_end if where == PICKUP else putdown_end
            self._ends[key] = straight if led and way is None else plan(grasp, q, way, self.ledger)
        return self._ends[key]

    def _paths(self, node: Node) -> MovePlan | None:
        grasp, pickup, putdown = node.what
        route = node.route
        last = len(route.done) == len(route.goals) - 1
        start = replace(self.start, q=self._q(route), opening=route.done[-1].opening_end if route.done else self.start.opening)
        entry = self.ledger.add("arm", f"branches {_degrees(pickup.q)} and {_degrees(putdown.q)}", parent=node.entry)
        share = Share(self.progress, min(self.spent / self.options.effort, 0.99), 1.0)
        carried = join(grasp, pickup, putdown, start, last, self._kept, entry, self.ledger, share, self.rng)
        ways = [way_ruled_out(step.q_rad, self.options.ruled_out) for step in carried.steps] if carried else []
        if carried is None or self._falls(entry, next(filter(None, ways), None)):
            self._lost.append(_joint_key(node))
            return None
        done = route._replace(done=(*route.done, carried))
        if last:
            return _whole(grasp.option.goal.instance.name, done.done)
        self._planned.add((route.goals, len(route.done)))
        self._begin(done, node.cost)
        return None

    def _q(self, route: Route) -> NDArray:
        return route.done[-1].q_end if route.done else self.start.q


TESTS: dict[int, Callable[[OptionSearch, Node], MovePlan | None]] = {
    DETOUR: OptionSearch._open_detour,
    ROTATIONS: OptionSearch._rotations,
    APPROACH: OptionSearch._approach,
    REACH: OptionSearch._reach,
    STRAIGHT: OptionSearch._straight,
    PATHS: OptionSearch._paths,
}


def _pickup_of(option: Option) -> tuple:
    """What everything at the pickup depends on: wherever the part goes from here, it is the same."""
    return option.goal.at_start, option.T_world_start.tobytes(), option.group


def _joint_key(node: Node) -> NDArray:
    _, pickup, putdown = node.what
    return np.concatenate([pickup.q, putdown.q])


def _degrees(q: NDArray) -> str:
    return " ".join(f"{angle:.0f}°" for angle in np.rad2deg(q))


def _whole(part: str, carries: tuple[Carried, ...]) -> MovePlan:
    """One plan of all carries."""
    steps: list[Step] = []
    found: list[Carry] = []
    for carried in carries:
        found.append(replace(carried.carry, first_step=len(steps)))
        steps += carried.steps
    return MovePlan(part, tuple(found), tuple(steps), worst([carried.certificate for carried in carries]))
