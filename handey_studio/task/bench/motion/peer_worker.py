"""Other libraries' motion planners, run in an interpreter of their own: it needs numpy and pin, and OMPL or roboplan.

This file imports nothing of Handey Studio. It reads requests, one JSON object a line, and answers each with one: `hello` tells which
peers this interpreter has; `scene` names a URDF, and the pairs of its links that may not meet, to plan in from now on; `free` tells which
configurations are free there; `plan` gives a peer's path and its seconds, from the query to the shortened path. What is made once a scene
is made when the scene comes in.
"""

import json
import os
import sys
import time
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

STEP_RAD = 0.02  # between the configurations that a peer looks at along a motion
SECONDS = 30.0  # to a path, before it is shortened
MOST_NODES = 1_000_000


class Peer(Protocol):
    """A planner in a scene."""

    def plan(self, start: NDArray, goal: NDArray, seed: int) -> NDArray:
        """A path (n, joints) [rad] from start to goal (joints,); no points when there is none."""
        ...

    def free(self, q: NDArray) -> bool:
        """Whether nothing meets at a configuration (joints,)."""
        ...


class Bodies:
    """The convex bodies of a URDF, checked by Pinocchio and coal."""

    def __init__(self, urdf: str, pairs: list[tuple[str, str]]) -> None:
        self.pin: Any = import_module("pinocchio")
        self.model = self.pin.buildModelFromUrdf(urdf)
        self.shapes = self.pin.buildGeomFromUrdf(self.model, urdf, self.pin.GeometryType.COLLISION)
        by_link: dict[str, list[int]] = {}
        for k, shape in enumerate(self.shapes.geometryObjects):
            if shape.meshPath not in ("", "BOX", "CYLINDER", "SPHERE"):
                shape.geometry.buildConvexHull(True, "Qt")
                shape.geometry = shape.geometry.convex
            by_link.setdefault(self.model.frames[shape.parentFrame].name, []).append(k)
        for one, other in pairs:
            for a in by_link.get(one, []):
                for b in by_link.get(other, []):
                    self.shapes.addCollisionPair(self.pin.CollisionPair(a, b))
        self.data, self.shape_data = self.model.createData(), self.shapes.createData()

    def free(self, q: NDArray) -> bool:
        return not self.pin.computeCollisions(self.model, self.data, self.shapes, self.shape_data, q, True)


class Ompl(Bodies):
    """OMPL's RRT-Connect and path simplification at their own settings."""

    def __init__(self, urdf: str, pairs: list[tuple[str, str]]) -> None:
        super().__init__(urdf, pairs)
        self.base: Any = import_module("ompl.base")
        self.geometric: Any = import_module("ompl.geometric")

    def plan(self, start: NDArray, goal: NDArray, seed: int) -> NDArray:
        n = self.model.nq
        if not (self.free(start) and self.free(goal)):  # it would wait for another goal until its time is over
            return np.empty((0, n))
        space = self.base.RealVectorStateSpace(n)
        bounds = self.base.RealVectorBounds(n)
        for i in range(n):
            bounds.setLow(i, float(self.model.lowerPositionLimit[i]))
            bounds.setHigh(i, float(self.model.upperPositionLimit[i]))
        space.setBounds(bounds)
        space.setLongestValidSegmentFraction(STEP_RAD / space.getMaximumExtent())
        setup = self.geometric.SimpleSetup(space)
        setup.setStateValidityChecker(lambda state: self.free(np.array([state[i] for i in range(n)])))
        ends = []
        for q in (start, goal):
            state = space.allocState()
            for i in range(n):
                state[i] = float(q[i])
            ends.append(state)
        setup.setStartAndGoalStates(*ends)
        setup.setPlanner(self.geometric.RRTConnect(setup.getSpaceInformation()))
        setup.solve(SECONDS)
        if not setup.haveExactSolutionPath():
            return np.empty((0, n))
        setup.simplifySolution()
        return np.array([[state[i] for i in range(n)] for state in setup.getSolutionPath().getStates()])


class Roboplan:
    """roboplan's RRT-Connect and its shortcuts, at its own settings but for the step of its collision checks."""

    def __init__(self, urdf: str, pairs: list[tuple[str, str]]) -> None:
        self.core: Any = import_module("roboplan.core")
        self.rrt: Any = import_module("roboplan.rrt")
        self.scene = self.core.Scene("problem", self.core.loadUrdfSceneDescription(urdf))
        links = sorted({name for pair in pairs for name in pair} | {"link0"})
        wanted = {frozenset(pair) for pair in pairs}
        every = [(one, other) for k, one in enumerate(links) for other in links[k + 1 :]]
        self.scene.setCollisions([pair for pair in every if frozenset(pair) not in wanted], False)
        self.scene.setCollisions([pair for pair in every if frozenset(pair) in wanted], True)

    def free(self, q: NDArray) -> bool:
        return not self.scene.hasCollisions(q)

    def plan(self, start: NDArray, goal: NDArray, seed: int) -> NDArray:
        names = self.scene.getJointNames()
        options = self.rrt.RRTOptions(max_nodes=MOST_NODES, collision_check_step_size=STEP_RAD, max_planning_time=SECONDS, rrt_connect=True)
        planner = self.rrt.RRT(self.scene, options)
        planner.setRngSeed(seed)
        try:
            path = planner.plan(self.core.JointConfiguration(names, start), self.core.JointConfiguration(names, goal))
        except RuntimeError:  # so it says that it found none
            return np.empty((0, len(start)))
        shortcuts = self.core.PathShortcuttingOptions(max_step_size=STEP_RAD, seed=seed)
        return np.array(self.core.PathShortcutter(self.scene, shortcuts).shortcut(path).positions)


PEERS: dict[str, tuple[str, Any]] = {"OMPL": ("ompl", Ompl), "roboplan": ("roboplan.rrt", Roboplan)}


def there(module: str) -> bool:
    """Whether a module and those above it are installed."""
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        return False


class Worker:
    """The peers of this interpreter in the scene of now."""

    def __init__(self) -> None:
        self.kinds = {name: kind for name, (module, kind) in PEERS.items() if there("pinocchio") and there(module)}
        self.peers: dict[str, Peer] = {}

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        if request["do"] == "hello":
            if "OMPL" in self.kinds:  # it takes one seed a process
                import_module("ompl.util").RNG.setSeed(int(request["seed"]) + 1)
                import_module("ompl.util").setLogLevel(import_module("ompl.util").LOG_ERROR)
            return {"peers": list(self.kinds)}
        if request["do"] == "scene":
            pairs = [(str(one), str(other)) for one, other in request["pairs"]]
            self.peers = {name: kind(request["urdf"], pairs) for name, kind in self.kinds.items()}
            return {}
        peer = self.peers[request["peer"]]
        if request["do"] == "free":
            return {"free": [bool(peer.free(np.array(q, dtype=float))) for q in request["q"]]}
        start, goal = np.array(request["start"], dtype=float), np.array(request["goal"], dtype=float)
        begun = time.perf_counter()
        path = peer.plan(start, goal, int(request["seed"]))
        return {"path": path.tolist(), "seconds": time.perf_counter() - begun}


def main() -> None:
    """Answer every request. What libraries write to standard output goes to standard error."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    worker = Worker()
    for line in sys.stdin:
        answers.write(json.dumps(worker.answer(json.loads(line))) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
