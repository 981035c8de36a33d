"""An arm with its hand in the scene: meshes are sent once, then only frames move."""

from functools import lru_cache
from typing import Any

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.scene.units import SCALE, place, scaled
from handey_studio.world import LinkBody, Robot, arm_of

CREASE_RAD = np.deg2rad(35.0)
Box = tuple[NDArray, NDArray]


class ArmModel:
    """The arm by its collision meshes and the hand by its boxes, below the node `root`; as a ghost all in one colour and see-through."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot, ghost: palette.RGB | None = None, opacity: float | None = None):
        scene, self._arm, self._hand = server.scene, arm_of(robot), robot.hand
        self.root = scene.add_frame(root, show_axes=False)
        self._frames = [scene.add_frame(f"{root}/link{i}", show_axes=False) for i in range(self._arm.n + 1)]
        for number, body in enumerate(self._arm.bodies):
            vertices, triangles = creased(body)
            colour = ghost or (palette.ARM_DARK if body.link in (0, self._arm.n) else palette.ARM_LIGHT)
            scene.add_mesh_simple(f"{root}/link{body.link}/{number}", scaled(vertices), triangles, color=colour, opacity=opacity)
        self._frames.append(scene.add_frame(f"{root}/hand", show_axes=False))
        self._fingers: dict[str, Any] = {}
        for name, (lower, upper) in robot.hand.boxes(robot.hand.opening_max).items():
            colour = ghost or (palette.FINGER if name.startswith("finger") else palette.HAND)
            size, middle = tuple((upper - lower) * SCALE), (lower + upper) / 2 * SCALE
            self._fingers[name] = scene.add_box(f"{root}/hand/{name}", color=colour, dimensions=size, position=middle, opacity=opacity)

    def move(self, q: NDArray, opening: float) -> None:
        """To the joints [rad], with the fingers open so far [m]."""
        boxes = self._hand.boxes(opening)
        for frame, T in zip(self._frames, [*self._arm.link_poses(q), self._arm.hand_pose(q)], strict=True):
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
