"""The failure that is looked at in the ledger: the arm or the hand as it stood then, and what collided in red."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.scene.arm_model import creased
from handey_studio.app.scene.parts import add_solid
from handey_studio.app.scene.units import SCALE, place, scaled
from handey_studio.app.state import State
from handey_studio.base import Entry, Posture
from handey_studio.session.failing import hand_of, pose_of, readings_met
from handey_studio.world import Robot, arm_of

ROOT = "/failure"
GHOST, SOLID = 0.28, 0.9  # opacity of what stood there, and of what collided


class FailureScene:
    """Built when an entry is looked at, gone when none is."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene

    def render(self, old: State | None, new: State) -> None:
        if old is not None and old.entry is new.entry and old.session.located is new.session.located:
            return
        if old is None or old.entry is not None:
            self._scene.remove_by_name(ROOT)
        entry = new.entry
        if entry is None or (entry.posture is None and not entry.bodies):
            return
        self._scene.add_frame(ROOT, show_axes=False)
        if entry.posture is not None:
            self._arm(new.robot, entry.posture, entry.bodies)
            self._part(new, entry, entry.posture)
        self._others(new, entry)
        self._readings(new, entry)

    def _arm(self, robot: Robot, posture: Posture, bodies: tuple[str, ...]) -> None:
        """The arm at its joints, or the hand alone."""
        arm = arm_of(robot)
        hand = hand_of(robot, posture)
        if len(posture.q_rad) == arm.n:
            q = np.array(posture.q_rad)
            for number, body in enumerate(arm.bodies):
                vertices, triangles = creased(body)
                self._mesh(f"link{number}", vertices, triangles, arm.link_poses(q)[body.link], body.name in bodies)
        if hand is None:
            return
        for name, (lower, upper) in robot.hand.boxes(posture.opening_m).items():
            met = name in bodies
            box = self._scene.add_box(
                f"{ROOT}/{name}",
                color=palette.VERMILLION if met else palette.HAND,
                dimensions=tuple((upper - lower) * SCALE),
                opacity=SOLID if met else GHOST,
            )
            middle = hand.copy()
            middle[:3, 3] = hand[:3, :3] @ (lower + upper) / 2 + hand[:3, 3]
            place(box, middle)

    def _mesh(self, name: str, vertices: NDArray, triangles: NDArray, T: NDArray, met: bool) -> None:
        colour, opacity = (palette.VERMILLION, SOLID) if met else (palette.ARM_DARK, GHOST)
        mesh = self._scene.add_mesh_simple(f"{ROOT}/{name}", scaled(vertices), triangles, color=colour, opacity=opacity)
        place(mesh, T)

    def _part(self, state: State, entry: Entry, posture: Posture) -> None:
        """The part that was to be moved, where it stood."""
        part, T = state.session.part(posture.part) if posture.part else None, pose_of(posture.T_world_part)
        if part is not None and T is not None:
            met = posture.part in entry.bodies
            add_solid(self._scene, f"{ROOT}/part", part, palette.VERMILLION if met else palette.TEAL, T, SOLID if met else GHOST)

    def _readings(self, state: State, entry: Entry) -> None:
        """Readings that reach into what met the depth map."""
        if state.session.scan is None:
            return
        met = readings_met(state.session.scan, state.robot, entry)
        if len(met):
            colours = np.tile(np.array(palette.VERMILLION, dtype=np.uint8), (len(met), 1))
            self._scene.add_point_cloud(
                f"{ROOT}/readings", scaled(met), colours, point_size=0.025, point_shape="circle", precision="float32"
            )

    def _others(self, state: State, entry: Entry) -> None:
        """Located parts and known blocks that were met."""
        moved = entry.posture.part if entry.posture is not None and entry.posture.T_world_part else ""
        for number, placed in enumerate(state.session.located):
            if placed.name in entry.bodies and placed.name != moved:
                add_solid(self._scene, f"{ROOT}/met{number}", placed.part, palette.VERMILLION, placed.T_world_part, SOLID)
        for number, block in enumerate(state.session.workcell.blocks):
            if block.name in entry.bodies:
                box = self._scene.add_box(
                    f"{ROOT}/block{number}", color=palette.VERMILLION, dimensions=tuple(1.002 * block.size * SCALE), opacity=SOLID
                )
                place(box, block.T_world_block)
