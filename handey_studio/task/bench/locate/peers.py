"""Asking `peer_worker.py`, which runs in an interpreter of its own: the peers' packages need not mix with ours."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.sensing.support import support_plane
from handey_studio.task.bench.locate.answers import Answer, Pose
from handey_studio.task.bench.locate.labelled_scenes import LabelledScene
from handey_studio.task.bench.peer_process import PeerProcess
from handey_studio.world.part import Part

VOXELS_M = (0.003, 0.005)
LEAST_FITNESS = 0.4  # of the model's points on the scene's: a sensor sees about half of a part
SAMPLES = 20000  # points on a part's surface
CLEARANCE_M = 0.004  # above the table, and at least three standard deviations: below is table
WORKER = Path(__file__).with_name("peer_worker.py")
HOW = (
    "pip install 'handey-studio[bench]' adds Open3D; OpenCV's point pairs need opencv-contrib-python-headless, in an environment of its own"
)


class LocatePeers(PeerProcess):
    """A worker that locates parts."""

    def __init__(self, python: str | None = None, voxels_m: Sequence[float] = VOXELS_M) -> None:
        super().__init__(WORKER, python)
        self._folder = tempfile.TemporaryDirectory(prefix="handey-peers-")
        self._known: set[Polyhedron] = set()
        self._scene: LabelledScene | None = None
        self.names: tuple[str, ...] = tuple(self.ask(do="hello", voxels_m=list(voxels_m))["peers"])
        if not self.names:
            self.close()
            raise BadInput(f"no peer can be run by {self.python}: {HOW} (--peer-python names its interpreter).")

    def close(self) -> None:
        super().close()
        self._folder.cleanup()

    def show(self, scene: LabelledScene) -> None:
        """Give the worker a scene, once: its points, and which of them lie above the table."""
        if scene is self._scene:
            return
        self._scene = scene
        T, found = scene.view.T_world_sensor, True
        if not scene.knows_world:
            support = support_plane(scene.view, np.random.default_rng(0))
            T, found = support.T_world_sensor, support.found
        points = scene.view.points_sensor()
        file = Path(self._folder.name) / "scene.npz"
        clearance = max(CLEARANCE_M, 3.0 * scene.view.noise) if found else -np.inf
        np.savez(file, points=points[np.isfinite(points).all(axis=-1)], up=T[2, :3], table=-T[2, 3], clearance=clearance)
        self.ask(do="scene", file=str(file))

    def teach(self, part: Part) -> None:
        """Give the worker a part, once."""
        if part.solid in self._known:
            return
        points, normals = surface_points(part.solid, SAMPLES, np.random.default_rng(0))
        file = Path(self._folder.name) / "part.npz"
        np.savez(file, points=points, normals=normals)
        self.ask(do="part", part=part.name, file=str(file))
        self._known.add(part.solid)


class Peer:
    """One of a worker's peers as a method: its best pose, and with `most` above one the next ones without what those before explain. It
    stands by a pose whose fitness is high enough. Its seconds are those of the first."""

    def __init__(self, process: LocatePeers, name: str, most: int = 1) -> None:
        self._process, self.name, self._most = process, name, most

    def see(self, scene: LabelledScene) -> None:
        self._process.show(scene)

    def locate(self, parts: Sequence[Part]) -> tuple[Answer, ...]:
        return tuple(self._one(part) for part in parts)

    def _one(self, part: Part) -> Answer:
        self._process.teach(part)
        told = self._process.ask(do="locate", peer=self.name, part=part.name, most=self._most, least=LEAST_FITNESS)
        poses = [Pose(np.array(pose["T_sensor_part"]), pose["fitness"]) for pose in told["poses"]]
        fit = tuple(pose for pose in poses if pose.score >= LEAST_FITNESS)
        if fit:
            return Answer(fit, told["seconds"])
        reason = f"fitness {poses[0].score:.2f}, limit {LEAST_FITNESS}" if poses else "too few points above the table"
        return Answer((), told["seconds"], reason)


def surface_points(solid: Polyhedron, count: int, rng: np.random.Generator) -> tuple[NDArray, NDArray]:
    """Points (count, 3) [m] spread evenly over a solid's surface, and their outward normals (count, 3)."""
    a, b, c = (solid.vertices[solid.triangles[:, k]] for k in range(3))
    vectors = np.cross(b - a, c - a)
    areas = np.linalg.norm(vectors, axis=1)
    picked = rng.choice(len(areas), count, p=areas / areas.sum())
    s, t = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    points = (1 - s) * a[picked] + s * (1 - t) * b[picked] + s * t * c[picked]
    return points, vectors[picked] / areas[picked, None]
