"""The arm by its collision meshes and the hand by its boxes: what the planner plans with is what is shown."""

from functools import lru_cache

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.scene.units import SCALE, place, scaled
from handey_studio.app.state import State
from handey_studio.world import LinkBody, Robot, arm_of

CREASE_RAD = np.deg2rad(35.0)
ROOT = "/robot"


class RobotScene:
    """Link frames are moved; meshes are sent once for each robot."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._frames: list[viser.FrameHandle] = []
        self._fingers: dict[str, viser.BoxHandle] = {}
        self._root: viser.FrameHandle | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is None or old.robot != new.robot:
            self._build(new.robot)
            old = None
        if self._root is not None and (old is None or _hidden(old) != _hidden(new)):
            self._root.visible = not _hidden(new)
        if old is None or _pose(old) != _pose(new):
            self._move(new)

    def _build(self, robot: Robot) -> None:
        scene = self._server.scene
        scene.remove_by_name(ROOT)
        arm = arm_of(robot)
        self._root = scene.add_frame(ROOT, show_axes=False)
        self._frames = [scene.add_frame(f"{ROOT}/link{i}", show_axes=False) for i in range(arm.n + 1)]
        for number, body in enumerate(arm.bodies):
            vertices, triangles = creased(body)
            colour = palette.ARM_DARK if body.link in (0, arm.n) else palette.ARM_LIGHT
            scene.add_mesh_simple(f"{ROOT}/link{body.link}/{number}", scaled(vertices), triangles, color=colour)
        self._frames.append(scene.add_frame(f"{ROOT}/hand", show_axes=False))
        self._fingers = {name: self._box(name, box) for name, box in robot.hand.boxes(robot.hand.opening_max).items()}

    def _box(self, name: str, box: tuple[NDArray, NDArray]) -> viser.BoxHandle:
        lower, upper = box
        colour = palette.FINGER if name.startswith("finger") else palette.HAND
        return self._server.scene.add_box(
            f"{ROOT}/hand/{name}", color=colour, dimensions=tuple((upper - lower) * SCALE), position=(lower + upper) / 2 * SCALE
        )

    def _move(self, state: State) -> None:
        arm = arm_of(state.robot)
        q, opening = _configuration(state)
        poses = [*arm.link_poses(q), arm.hand_pose(q)]
        boxes = state.robot.hand.boxes(opening)
        for frame, T in zip(self._frames, poses, strict=True):
            place(frame, T)
        for name, handle in self._fingers.items():
            handle.position = np.add(*boxes[name]) / 2 * SCALE


def creased(body: LinkBody) -> tuple[NDArray, NDArray]:
    """The body's mesh with its corners split where it has a crease, so that it is shaded smooth elsewhere."""
    return _creased(body.vertices.tobytes(), body.triangles.tobytes())


@lru_cache(maxsize=64)
def _creased(vertices: bytes, triangles: bytes) -> tuple[NDArray, NDArray]:
    mesh = trimesh.Trimesh(np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(triangles, dtype=np.int64).reshape(-1, 3))
    mesh = trimesh.graph.smooth_shade(mesh, angle=CREASE_RAD)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def _configuration(state: State) -> tuple[NDArray, float]:
    """Joints [rad] and opening [m] at the time that is looked at; at home when there is no plan."""
    replay = state.replay
    if replay is None:
        return state.robot.home, state.robot.hand.opening_max
    moment = replay.at(state.session.view.time_s)
    return moment.q_rad, moment.hand_opening_m


def _pose(state: State) -> tuple:
    return state.session.result, state.session.view.time_s


def _hidden(state: State) -> bool:
    return "robot" in state.session.view.hidden_layers
