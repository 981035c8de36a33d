"""Other libraries' ways to locate a part, run in an interpreter of their own: it needs numpy, and Open3D or OpenCV's contributed modules.

This file imports nothing of Handey Studio. It reads requests, one JSON object a line, and answers each with one: `hello` tells which peers
this interpreter has; `part` and `scene` name files of arrays to look at from now on; `locate` gives a peer's best pose and its seconds.
A peer's time runs from the scene's points to the pose; what is made once a part is made when the part comes in.
"""

import json
import sys
import time
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

RANSAC_TRIALS = 400_000
PPF_STEP = (
    0.1  # of the diameter, between sampled points and in distances; pairs on flat faces fill one hash chain: at 0.05 a cuboid takes minutes
)
PPF_VOXEL_M = 0.0025  # between points of the scene, and of the model that poses are refined with
PPF_POSES = 30  # the best clusters that are refined
LEAST_POINTS = 50  # above the table; with fewer nobody is asked
EXPLAINED_M = 0.003  # points in voxels of this size at a found part's surface, or next to such, are explained by it
SCENE_VOXELS = 0.5  # points of the scene that poses are refined on, in voxels apart


class Peer(Protocol):
    """A way to locate a part."""

    def learn(self, points: NDArray, normals: NDArray) -> Any:
        """What is made once a part, from points and outward normals (n, 3) [m] all over its surface."""
        ...

    def locate(self, model: Any, points: NDArray) -> tuple[NDArray, float]:
        """The best T_sensor_part (4, 4) among scene points (m, 3) [m], and the share of the model's points that it lays on them."""
        ...


class Open3D:
    """Fast point feature histograms, RANSAC over their matches, point-to-plane ICP, at one voxel size [m]."""

    def __init__(self, voxel: float) -> None:
        self.o3d: Any = import_module("open3d")
        self.voxel = voxel

    def learn(self, points: NDArray, normals: NDArray) -> Any:
        cloud = self.o3d.geometry.PointCloud(self.o3d.utility.Vector3dVector(points))
        cloud.normals = self.o3d.utility.Vector3dVector(normals)
        return self._with_features(cloud.voxel_down_sample(self.voxel))

    def locate(self, model: Any, points: NDArray) -> tuple[NDArray, float]:
        o3d, registration = self.o3d, self.o3d.pipelines.registration
        o3d.utility.random.seed(0)
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        fine = self._facing(cloud.voxel_down_sample(SCENE_VOXELS * self.voxel))
        coarse, features = self._with_features(self._facing(cloud.voxel_down_sample(self.voxel)))
        reach = 1.5 * self.voxel
        found = registration.registration_ransac_based_on_feature_matching(
            model[0],
            coarse,
            model[1],
            features,
            False,
            reach,
            registration.TransformationEstimationPointToPoint(False),
            3,
            [
                registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                registration.CorrespondenceCheckerBasedOnDistance(reach),
            ],
            registration.RANSACConvergenceCriteria(RANSAC_TRIALS, 0.999),
        )
        plane = registration.TransformationEstimationPointToPlane()
        refined = registration.registration_icp(model[0], fine, self.voxel, found.transformation, plane)
        return np.array(refined.transformation), float(refined.fitness)

    def _facing(self, cloud: Any) -> Any:
        """The cloud with normals towards the sensor."""
        cloud.estimate_normals(self.o3d.geometry.KDTreeSearchParamHybrid(radius=2.0 * self.voxel, max_nn=30))
        cloud.orient_normals_towards_camera_location(np.zeros(3))
        return cloud

    def _with_features(self, cloud: Any) -> tuple[Any, Any]:
        search = self.o3d.geometry.KDTreeSearchParamHybrid(radius=5.0 * self.voxel, max_nn=100)
        return cloud, self.o3d.pipelines.registration.compute_fpfh_feature(cloud, search)


class PointPairs:
    """OpenCV's point-pair features (Drost 2010): votes of pairs of oriented points, clusters of poses, ICP. It counts in millimetres."""

    def __init__(self, voxel: float) -> None:
        self.cv2: Any = import_module("cv2")
        self.voxel = 1e3 * voxel

    def learn(self, points: NDArray, normals: NDArray) -> Any:
        cloud = np.hstack([1e3 * points, normals]).astype(np.float32)
        detector = self.cv2.ppf_match_3d.PPF3DDetector(PPF_STEP, PPF_STEP)
        detector.trainModel(cloud)
        return detector, cloud[first_of_voxels(cloud[:, :3], self.voxel)]

    def locate(self, model: Any, points: NDArray) -> tuple[NDArray, float]:
        detector, cloud = model
        middle = 1e3 * points.mean(axis=0)  # poses are averaged in clusters, which goes astray far from the origin
        thinned = 1e3 * points - middle
        thinned = thinned[first_of_voxels(thinned, self.voxel)].astype(np.float32)
        _, scene = self.cv2.ppf_match_3d.computeNormalsPC3d(thinned, 12, True, tuple(-middle))
        found = detector.match(scene, 1.0, PPF_STEP)
        if not len(found):
            return np.eye(4), 0.0
        _, refined = self.cv2.ppf_match_3d.ICP(100, 0.005, 2.5, 8).registerModelToScene(cloud, scene, list(found[:PPF_POSES]))
        poses = [np.array(pose.pose) for pose in refined]
        held = around(thinned, self.voxel)
        shares = [share_on(cloud[:, :3] @ T[:3, :3].T + T[:3, 3], held, self.voxel) for T in poses]
        best = int(np.argmax(shares))
        T = poses[best].copy()
        T[:3, 3] = 1e-3 * (T[:3, 3] + middle)
        return T, shares[best]


def first_of_voxels(points: NDArray, voxel: float) -> NDArray:
    """Numbers (k,) of one point (n, 3) a voxel."""
    return np.unique(np.floor(points / voxel).astype(np.int64), axis=0, return_index=True)[1]


def share_on(points: NDArray, held: NDArray, voxel: float) -> float:
    """Share of points (n, 3) whose voxel is one of `held`, from `around`."""
    return float(np.isin(_keys(np.floor(points / voxel).astype(np.int64)), held).mean())


def around(scene: NDArray, voxel: float) -> NDArray:
    """The voxels, as numbers, that hold a point of the scene (m, 3) or lie next to one that does."""
    cells = np.unique(np.floor(scene / voxel).astype(np.int64), axis=0)
    steps = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), axis=-1).reshape(-1, 3)
    return np.unique(_keys((cells[:, None] + steps).reshape(-1, 3)))


def _keys(cells: NDArray) -> NDArray:
    """One number a voxel (n, 3); voxels further than 2²⁰ from the origin share theirs with none that is near."""
    x, y, z = (np.clip(cells[:, k], -(2**20), 2**20 - 1) + 2**20 for k in range(3))
    return (x << 42) | (y << 21) | z


def peers(voxels_m: list[float]) -> dict[str, Peer]:
    """Name → peer, of those that this interpreter can run."""
    found: dict[str, Peer] = {}
    if find_spec("open3d") is not None:
        found |= {f"open3d {1e3 * voxel:g} mm": Open3D(voxel) for voxel in voxels_m}
    if find_spec("cv2") is not None and hasattr(import_module("cv2"), "ppf_match_3d"):
        found["opencv ppf"] = PointPairs(PPF_VOXEL_M)
    return found


class Worker:
    """Answers requests; it remembers the parts and the scene."""

    def __init__(self) -> None:
        self.peers: dict[str, Peer] = {}
        self.models: dict[tuple[str, str], Any] = {}
        self.surfaces: dict[str, NDArray] = {}
        self.points = np.zeros((0, 3))

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        return getattr(self, f"do_{request['do']}")(request)

    def do_hello(self, request: dict[str, Any]) -> dict[str, Any]:
        self.peers = peers(request["voxels_m"])
        return {"peers": list(self.peers)}

    def do_part(self, request: dict[str, Any]) -> dict[str, Any]:
        arrays = np.load(request["file"])
        self.surfaces[request["part"]] = arrays["points"]
        for name, peer in self.peers.items():
            self.models[name, request["part"]] = peer.learn(arrays["points"], arrays["normals"])
        return {}

    def do_scene(self, request: dict[str, Any]) -> dict[str, Any]:
        arrays = np.load(request["file"])
        points = arrays["points"]
        self.points = points[(points @ arrays["up"] - arrays["table"]) > arrays["clearance"]]
        return {}

    def do_locate(self, request: dict[str, Any]) -> dict[str, Any]:
        """The best pose and its seconds; then, while poses are at least `least` fit, the best one without the points they explain."""
        peer, model = self.peers[request["peer"]], self.models[request["peer"], request["part"]]
        points, poses, seconds = self.points, [], 0.0
        while len(poses) < request["most"] and len(points) >= LEAST_POINTS:
            begun = time.perf_counter()
            T, fitness = peer.locate(model, points)
            seconds = seconds or time.perf_counter() - begun
            poses.append({"T_sensor_part": T.tolist(), "fitness": fitness})
            if fitness < request["least"]:
                break
            surface = self.surfaces[request["part"]] @ T[:3, :3].T + T[:3, 3]
            points = points[~np.isin(_keys(np.floor(points / EXPLAINED_M).astype(np.int64)), around(surface, EXPLAINED_M))]
        return {"poses": poses, "seconds": seconds}


def main() -> None:
    """Answer until standard input ends. Libraries that write to standard output must not disturb the answers."""
    answers, sys.stdout = sys.stdout, sys.stderr
    worker = Worker()
    for line in sys.stdin:
        answers.write(json.dumps(worker.answer(json.loads(line))) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
