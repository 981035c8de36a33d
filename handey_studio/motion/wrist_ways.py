"""How the wrist may turn from the start's posture to the goal's without the hand meeting the forearm.

The paper interpolates; where that makes the wrist or the hand pass through the arm that carries them, no place of the
arm joints helps, and the wrist goes by way of another posture.
"""

import numpy as np
from numpy.typing import NDArray

from handey_studio.motion.certificate import Mover
from handey_studio.motion.proof import PROVED, Motion, Verdict, prove
from handey_studio.motion.query import Query
from handey_studio.world import Robot
from handey_studio.world.collision_bodies import terrain_obstacles
from handey_studio.world.collision_queries import Scene

HELD_RAD = float(np.deg2rad(12.0))  # a held joint that turns by more than this sweeps the arm through too much space
DRAWN = 200  # wrist postures drawn at random when the straight way is closed


def wrist_ways(query: Query, rng: np.random.Generator, most: int) -> list[tuple[str, NDArray]]:
    """Up to `most` ways of the joints other than the arm's, corners (2 or 3, joints − 3) [rad], each with its name.

    The straight one, unnamed, and one by the home wrist.
    Where the straight one is closed, the shortest ones by way of the home wrist and of postures drawn at random.
    Held joints go straight from their value at the start to that at the goal.
    """
    robot, others = query.world.robot, query.world.robot.other_index
    start, goal = query.start[others], query.goal[others]
    ways = [("", np.array([start, goal]))] if wrist_turns(query.free, start, goal) else []
    lower, upper, home = robot.lower[others], robot.upper[others], robot.home[others]
    turned = home + 2 * np.pi * np.round(((start + goal) / 2 - home) / (2 * np.pi))
    inside = ((turned >= lower) & (turned <= upper)).all()
    names = {0: "the home wrist in between"}
    low, high = np.minimum(start, goal) - np.pi / 2, np.maximum(start, goal) + np.pi / 2
    drawn = rng.uniform(np.maximum(low, lower), np.minimum(high, upper), (DRAWN, len(start)))
    between = np.concatenate([(turned if inside else home)[None], drawn])
    held = np.isin(others, robot.held_index)
    between[:, held] = (start[held] + goal[held]) / 2
    lengths = np.abs(between - start).sum(axis=1) + np.abs(between - goal).sum(axis=1)
    for k in np.argsort(lengths, kind="stable") if not ways else (0,):
        if len(ways) >= most:
            break
        if wrist_turns(query.free, start, between[k]) and wrist_turns(query.free, between[k], goal):
            ways.append((names.get(int(k), "another wrist posture in between"), np.array([start, between[k], goal])))
    return ways


def holds_far(robot: Robot, way: NDArray) -> bool:
    """Whether a held joint turns by more than `HELD_RAD` on a way (m, joints − 3) [rad]."""
    held = np.isin(robot.other_index, robot.held_index)
    return bool(np.ptp(way[:, held], axis=0).max(initial=0.0) > HELD_RAD)


def wrist_parts(way: NDArray) -> list[NDArray]:
    """A way (2 or 3, joints − 3) [rad] in two parts (2, joints − 3): at its corner, or else in its middle."""
    middle = way[1] if len(way) > 2 else way.mean(axis=0)
    return [np.array([way[0], middle]), np.array([middle, way[-1]])]


def wrist_turns(mover: Mover, start: NDArray, end: NDArray) -> bool:
    """Whether wrist, hand and part are proved to stay clear of the forearm and of each other while the wrist turns straight."""
    robot, shapes = mover.model.world.robot, mover.bodies.shapes
    shapes = shapes._replace(pairs=np.ascontiguousarray(shapes.pairs[shapes.link[shapes.pairs].min(axis=1) >= robot.carrier]))
    nothing = terrain_obstacles(None, 0.0, 0.0)
    ends = np.zeros((2, len(robot.joint_names)))
    ends[:, robot.other_index] = start, end
    motion = Motion(ends[0].copy(), ends[1].copy(), mover.opening, mover.opening, np.zeros(len(ends[0])))
    scene = Scene(nothing, nothing, mover.scene.rules)
    return Verdict(*prove(mover.model.chain, shapes, scene, motion, float(mover.margin), 0.0)).outcome == PROVED
