"""Asking `peer_worker.py`: OMPL and roboplan in the same geometry."""

import tempfile
from pathlib import Path

import numpy as np

from handey_studio.base import BadInput
from handey_studio.task.bench.motion.answers import Answer
from handey_studio.task.bench.motion.problems import Problem
from handey_studio.task.bench.motion.urdf import export
from handey_studio.task.bench.peer_process import PeerProcess

WORKER = Path(__file__).with_name("peer_worker.py")
HOW = "pip install 'handey-studio[bench]' adds OMPL and roboplan"


class MotionPeers(PeerProcess):
    """A worker that plans motions."""

    def __init__(self, python: str | None = None, seed: int = 0) -> None:
        super().__init__(WORKER, python)
        self._problem: Problem | None = None
        self.names: tuple[str, ...] = tuple(self.ask(do="hello", seed=seed)["peers"])
        if not self.names:
            self.close()
            raise BadInput(f"no peer can be run by {self.python}: {HOW} (--peer-python names another interpreter).")

    def show(self, problem: Problem) -> None:
        """Give the worker a problem's bodies, once."""
        if problem is self._problem:
            return
        self._problem = problem
        with tempfile.TemporaryDirectory(prefix="handey-peers-") as folder:
            exported = export(problem, Path(folder))
            self.ask(do="scene", urdf=str(exported.file), pairs=exported.pairs)


class Peer:
    """One of a worker's peers as a method. Its seconds run from the query to the shortened path; its scene was made before."""

    def __init__(self, process: MotionPeers, name: str) -> None:
        self._process, self.name = process, name

    def plan(self, problem: Problem, seed: int) -> Answer:
        self._process.show(problem)
        start, goal = problem.start.tolist(), problem.goal.tolist()
        told = self._process.ask(do="plan", peer=self.name, start=start, goal=goal, seed=seed)
        path = np.array(told["path"], dtype=float).reshape(-1, len(start))
        return Answer(path, told["seconds"], "" if len(path) else "no path in its time")
