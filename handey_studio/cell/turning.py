"""A person turns a body over by hand: the simulated cell's own act on its hidden truth, so that a next scan sees other sides."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody, check_names, fixed_bodies, solid_body
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.workcell import SimulatedSetup, Workcell
from handey_studio.geometry.transforms import rotation_about, transform
from handey_studio.world import Library

LIFT_M = 0.002  # it is let go this high above the table
LEVEL = 0.05  # an edge that rises by less than this share of its length counts as level


def turned_over(workcell: Workcell, library: Library, near: NDArray | None = None) -> SimulatedSetup:
    """The cell's true state once the body nearest to a place (x, y) [m] of the table, or to the scan's middle, lies on another side.

    It is taken up, turned by a quarter about its longest level edge, put down where it was and let go; it falls until it rests, and so
    does what leaned on it. Raises BadInput when nothing lies there.
    """
    bodies = tuple(solid_body(body, library.part) for body in workcell.setup.bodies)
    check_names(bodies)
    if not bodies:
        raise BadInput("nothing lies in the cell that could be turned over; open a session whose cell has an object.")
    middle = workcell.finder.T_world_range @ (workcell.finder.area[0] / 2, workcell.finder.area[1] / 2, 0.0, 1.0)
    place = middle[:2] if near is None else np.asarray(near, dtype=float)[:2]
    chosen = min(bodies, key=lambda body: float(np.linalg.norm(_middle(body)[:2] - place)))
    turned = _turned(chosen, workcell.table_z)
    rested = settle((*fixed_bodies(workcell), *(turned if body is chosen else body for body in bodies))).bodies
    now = {body.name: body.T_world_body for body in rested}
    moved = tuple(replace(body, T_world_body=now[body.name]) for body in workcell.setup.bodies)
    return replace(workcell.setup, bodies=moved, drop=False, seed=workcell.setup.seed + 1)


def _turned(body: SolidBody, table_z: float) -> SolidBody:
    """The body turned by a quarter about its longest level edge's direction, just above the table over the same place."""
    middle = _middle(body)
    about = transform(None, middle) @ transform(rotation_about(_longest_level(body), np.pi / 2)) @ transform(None, -middle)
    T = about @ body.T_world_body
    T = transform(None, (0.0, 0.0, table_z + LIFT_M - body.at(T).corners_world[:, 2].min())) @ T
    return body.at(T)


def _longest_level(body: SolidBody) -> NDArray:
    """Direction (3,) of the longest edge that lies level; x if none does."""
    corners = body.corners_world
    ways = np.array([corners[edge.end] - corners[edge.start] for edge in body.solid.edges])
    level = ways[np.abs(ways[:, 2]) < LEVEL * np.linalg.norm(ways, axis=1)]
    return level[int(np.argmax(np.linalg.norm(level, axis=1)))] if len(level) else np.array([1.0, 0.0, 0.0])


def _middle(body: SolidBody) -> NDArray:
    return (body.corners_world.min(axis=0) + body.corners_world.max(axis=0)) / 2.0
