"""Exact collision of the arm, the hand and what it holds with the world: distances, and depths where bodies overlap.

Distances come from compiled queries whose answers never exceed the truth (see `gjk`), depths from separating axes (see `overlap`). All
bodies are convex: links' hulls, the hand's boxes, parts' exact convex pieces, the depth map's columns.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import inverse
from handey_studio.world.arm import arm_of
from handey_studio.world.collision_bodies import (
    DEPTH_MAP,
    Piece,
    Shapes,
    held_pieces,
    obstacles_of,
    pack,
    robot_pieces,
    slabs_of,
    solids_of,
    terrain_obstacles,
)
from handey_studio.world.collision_queries import (
    ALLOWED,
    Chain,
    Hit,
    Scene,
    allowed_overlaps,
    body_distance,
    forward,
    least_clearance,
    placed,
)
from handey_studio.world.overlap import Directions, column_depths, depth, directions_of
from handey_studio.world.part import Held
from handey_studio.world.robot import Robot
from handey_studio.world.world import World

ALLOWED_DEPTH_M = 0.0012  # bodies that may touch may be believed this deep in each other: a cell of the depth map, and the error of a pose
MOST_BODIES = 64  # grasps whose bodies are kept at hand
FAR_M = 1e3  # farther than anything: no limit to a search for the nearest pair
HELD = 1  # number of whatever the hand holds; the depth map's is 0

Pairs = Iterable[Iterable[str]]


@dataclass(frozen=True)
class Clearance:
    """The least distance [m] between two bodies that must stay apart, negative for the depth of a penetration, and their names.

    `allowed_depth` [m] is the deepest overlap of two bodies that may touch, `allowed_bodies` their names.
    """

    distance: float
    bodies: tuple[str, ...]
    allowed_depth: float = 0.0
    allowed_bodies: tuple[str, ...] = ()

    def keeps(self, margin: float = 0.0) -> bool:
        """Whether every checked pair stays farther apart than `margin` and no allowed pair is too deep in each other."""
        return self.distance > margin and self.allowed_depth <= ALLOWED_DEPTH_M

    def __str__(self) -> str:
        if self.distance > 0 and self.allowed_depth > ALLOWED_DEPTH_M:
            return f"{' and '.join(self.allowed_bodies)} may touch but overlap by {self.allowed_depth * 1e3:.1f} mm"
        if self.distance > 0:
            return f"{' and '.join(self.bodies)} are {self.distance * 1e3:.1f} mm apart"
        return f"{' and '.join(self.bodies)} overlap by {-self.distance * 1e3:.1f} mm"


class Placing(NamedTuple):
    """Where the moving bodies are: link poses (n + 1, 4, 4), the hand's opening [m], all corners (v, 3) [m] in the world."""

    poses: NDArray
    opening: float
    corners: NDArray


@dataclass(eq=False)
class Bodies:
    """The moving bodies for one thing held: their arrays, their names, and FCL shapes made when first needed."""

    shapes: Shapes
    names: tuple[str, ...]

    def place(self, poses: NDArray, opening: float) -> Placing:
        return Placing(poses, opening, placed(self.shapes, poses, float(opening)))

    def directions(self, b: int) -> Directions:
        """Face normals and edges of body b in its link's frame."""
        return directions_of(self.shapes.corners[self.shapes.first[b] : self.shapes.first[b + 1]])


class CollisionModel:
    """The collision bodies of a world. Not a value; `collision_model(world)` keeps it warm in this process.

    `allowed` are pairs of names that may touch. Joint angles in radians, openings in metres.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.arm = arm_of(world.robot)
        self.chain = Chain(*(np.array(a) for a in (world.robot.T_world_base, self.arm.T_links, self.arm.axes)))
        self._T_hand_last = inverse(self.arm.T_last_hand)
        self._pieces = robot_pieces(world.robot)
        solids = solids_of(world)
        self.slabs = len(slabs_of(world))
        """How many of the solids, the first ones, are the table and the space outside."""
        self.names = tuple(dict.fromkeys([DEPTH_MAP, "", *(name for name, _ in solids), *(piece.name for piece in self._pieces)]))
        self._numbers = {name: k for k, name in enumerate(self.names)}
        self.solids = obstacles_of(solids, self._numbers)
        self.terrain = terrain_obstacles(world.terrain, world.table_z, float(world.free_space[1, 2]))
        self._bodies: dict[tuple[Held | None, bool], Bodies] = {}
        self._scenes: dict[tuple[str, frozenset[frozenset[str]]], Scene] = {}

    def clearance(self, q: NDArray, opening: float, held: Held | None = None, allowed: Pairs = (), limit: float = FAR_M) -> Clearance:
        """Least distance of the whole arm at q (n,) [rad]; with no pair nearer than `limit` that number and no names."""
        return self._clearance(forward(self.chain, np.array(q, dtype=float)), opening, held, allowed, limit, self.bodies(held))

    def nearest(self, q: NDArray, opening: float, held: Held | None = None, allowed: Pairs = (), limit: float = FAR_M) -> float:
        """The least distance [m] alone, 0 where bodies meet, at most `limit`: what touches that may is not looked at."""
        bodies = self.bodies(held)
        placing = bodies.place(forward(self.chain, np.array(q, dtype=float)), opening)
        return float(Hit(*least_clearance(bodies.shapes, placing.corners, self.scene(held, allowed), float(limit))).distance)

    def in_contact(
        self, q: NDArray, opening: float, held: Held | None = None, allowed: Pairs = (), margin: float = 0.0
    ) -> Clearance | None:
        """None when everything stays farther apart than `margin` [m]; else what does not. Quicker than `clearance`."""
        clearance = self.clearance(q, opening, held, allowed, limit=margin + 1e-9)
        return None if clearance.keeps(margin) else clearance

    def hand_contact(
        self, T_world_hand: NDArray, opening: float, held: Held | None = None, allowed: Pairs = (), limit: float = FAR_M
    ) -> Clearance:
        """The same for the hand and what it holds alone, at a pose (4, 4), without the arm."""
        poses = np.zeros((self.arm.n + 1, 4, 4))
        poses[-1] = T_world_hand @ self._T_hand_last
        return self._clearance(poses, opening, held, allowed, limit, self.bodies(held, hand_only=True))

    def bodies(self, held: Held | None, hand_only: bool = False) -> Bodies:
        """The moving bodies with one thing held."""
        key = (held, hand_only)
        if key not in self._bodies:
            if len(self._bodies) >= MOST_BODIES:
                self._bodies.clear()
            pieces = self._pieces + (held_pieces(self.world.robot, held) if held else [])
            if hand_only:
                wrist = {body.name for body in self.arm.bodies}
                pieces = [piece for piece in pieces if piece.name not in wrist]
            numbers = self._numbers | ({held.name: HELD} if held else {})
            touching = always_touching(self.world.robot)
            self._bodies[key] = Bodies(pack(pieces, numbers, touching), tuple(piece.name for piece in pieces))
        return self._bodies[key]

    def scene(self, held: Held | None, allowed: Pairs) -> Scene:
        """The fixed bodies and which names may meet."""
        key = (held.name if held else "", frozenset(frozenset(pair) for pair in allowed))
        if key not in self._scenes:
            numbers = self._numbers | ({held.name: HELD} if held else {})
            rules = np.zeros((len(self.names), len(self.names)), np.int8)
            for pair in key[1]:
                known = [numbers[name] for name in pair if name in numbers]
                if len(known) == 2:
                    rules[known[0], known[1]] = rules[known[1], known[0]] = ALLOWED
            self._scenes[key] = Scene(self.solids, self.terrain, rules)
        return self._scenes[key]

    def pair(self, hit: Hit, bodies: Bodies) -> tuple[str, str]:
        """Names of the two bodies of a hit."""
        if hit.kind == 2:
            return bodies.names[hit.body], bodies.names[hit.other]
        fixed = self.solids if hit.kind == 0 else self.terrain
        return bodies.names[hit.body], self.names[fixed.name[hit.other]]

    def _clearance(self, poses: NDArray, opening: float, held: Held | None, allowed: Pairs, limit: float, bodies: Bodies) -> Clearance:
        scene = self.scene(held, allowed)
        placing = bodies.place(poses, opening)
        hit = Hit(*least_clearance(bodies.shapes, placing.corners, scene, float(limit)))
        found = hit.distance if hit.distance > 0 else -self._depth(hit, bodies, placing)
        names = self.pair(hit, bodies) if hit.kind >= 0 else ()
        if not (scene.rules == ALLOWED).any():
            return Clearance(float(found), names)
        overlaps = allowed_overlaps(bodies.shapes, placing.corners, scene)
        depth, deepest = max(self._depths(overlaps, bodies, placing), default=(0.0, None))
        return Clearance(float(found), names, float(depth), self.pair(deepest, bodies) if deepest else ())

    def _depths(self, overlaps: NDArray, bodies: Bodies, placing: Placing) -> list[tuple[float, Hit]]:
        """How deep [m] each of several overlaps is; of those of one body with the depth map only the deepest."""
        found = [(self._depth(hit, bodies, placing), hit) for hit in (Hit(0.0, *map(int, row)) for row in overlaps[overlaps[:, 1] != 1])]
        columns = overlaps[overlaps[:, 1] == 1]
        for b in np.unique(columns[:, 0]):
            others = columns[columns[:, 0] == b, 2]
            depths = self._in_columns(int(b), others, bodies, placing)
            k = int(np.argmax(depths))
            found.append((float(depths[k]), Hit(0.0, int(b), 1, int(others[k]))))
        return found

    def _in_columns(self, b: int, others: NDArray, bodies: Bodies, placing: Placing) -> NDArray:
        """How deep [m] body b stands in each of the columns that it meets: many of them tell how deep a wide body stands."""
        R = self._turn(b, bodies, placing)
        return column_depths(self._moving(b, bodies, placing), bodies.directions(b), R, self.terrain.corners.reshape(-1, 8, 3)[others])

    def _depth(self, hit: Hit, bodies: Bodies, placing: Placing) -> float:
        """How deep [m] two bodies overlap."""
        if hit.kind == 1:
            return float(self._in_columns(hit.body, np.array([hit.other]), bodies, placing)[0])
        mine = self._moving(hit.body, bodies, placing), bodies.directions(hit.body), self._turn(hit.body, bodies, placing)
        if hit.kind == 2:
            return depth(
                *mine, self._moving(hit.other, bodies, placing), bodies.directions(hit.other), self._turn(hit.other, bodies, placing)
            )
        corners = self.solids.corners[self.solids.first[hit.other] : self.solids.first[hit.other + 1]]
        return depth(*mine, corners, directions_of(corners), np.eye(3))

    @staticmethod
    def _turn(b: int, bodies: Bodies, placing: Placing) -> NDArray:
        return placing.poses[bodies.shapes.link[b], :3, :3]

    @staticmethod
    def _moving(b: int, bodies: Bodies, placing: Placing) -> NDArray:
        return placing.corners[bodies.shapes.first[b] : bodies.shapes.first[b + 1]]


@lru_cache(maxsize=32)
def collision_model(world: World) -> CollisionModel:
    """The collision model of a world, built on first use and kept warm in this process."""
    return CollisionModel(world)


@lru_cache(maxsize=8)
def always_touching(robot: Robot, samples: int = 200, seed: int = 0) -> frozenset[frozenset[str]]:
    """Pairs of the robot's own bodies that overlap at every one of many configurations: they are built that way."""
    arm, rng = arm_of(robot), np.random.default_rng(seed)
    chain = Chain(*(np.array(a) for a in (robot.T_world_base, arm.T_links, arm.axes)))
    pieces: list[Piece] = robot_pieces(robot)
    shapes = pack(pieces, {piece.name: k for k, piece in enumerate(pieces)}, frozenset())
    left = [(int(a), int(b)) for a, b in shapes.pairs]
    for q in rng.uniform(robot.lower, robot.upper, (samples, len(robot.lower))):
        corners = placed(shapes, forward(chain, q), robot.hand.opening_min)
        left = [(a, b) for a, b in left if body_distance(shapes, corners, a, b, 1e-9) <= 0.0]
    return frozenset(frozenset((pieces[a].name, pieces[b].name)) for a, b in left)
