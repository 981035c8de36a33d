"""What a driver for a real arm implements, so that the rest of the program can work with it.

A driver is five readings and one act, done `1 / dt` times a second; `ControlledCell` makes the cell's protocol of them: motions, guarded
motions, settling, grips. The simulated physics is driven through the same door. To put an arm behind it, write a class with these
members (it need not inherit anything) and hand it to `ControlledCell` with the robot and a function that scans:

    cell = ControlledCell(library.robot("ur5"), MyUr5("192.168.0.7"), lambda: depth_map_of(my_camera.capture()))
    run_move(station, cell, MoveCommand("l_block", "0.45,0.32,0,0,0,90"))

How to fill them in, for an arm that takes streamed set points (Universal Robots' servoj, Franka's joint position interface, ROS 2
controllers): `tick` sends `to.q` and waits for the controller's next cycle; arms that take more get velocity and acceleration as well.
The hand's width and force limit go to the gripper only when they change. The wrist's readings come from a force-torque sensor or from
the arm's own estimate, turned into the world's axes, less the hand's own weight. The arm's own protective stops, limits and
emergency stop stay as they are: the program counts on them and does not replace them.
"""

from typing import NamedTuple, Protocol

from numpy.typing import NDArray

from handey_studio.cell.faults import Call


class Reference(NamedTuple):
    """Where the arm's joints are to be at the end of one tick: `q` [rad] and their velocity and acceleration there, each (joints,)."""

    q: NDArray
    velocity: NDArray
    acceleration: NDArray


class Drive(NamedTuple):
    """What the fingers are to do in one tick: the `opening` [m] they go to, its `speed` [m/s], the `force` [N] each may use."""

    opening: float
    speed: float
    force: float


class Driver(Protocol):
    """An arm with a hand, as the controller sees it."""

    @property
    def dt(self) -> float:
        """Length of a tick [s]: 0.002 to 0.01."""
        ...

    @property
    def q(self) -> NDArray:
        """Measured joints (joints,) [rad], in the robot's order."""
        ...

    @property
    def velocity(self) -> NDArray:
        """Measured velocities (joints,) [rad/s]."""
        ...

    @property
    def opening(self) -> float:
        """How far the fingers are open [m], as measured."""
        ...

    @property
    def finger_force(self) -> float:
        """With how much force [N] each finger's drive closes; negative when it presses outwards. A gripper that only tells whether it
        holds something gives its set force or 0."""
        ...

    def wrench(self) -> tuple[NDArray, NDArray]:
        """Force (3,) [N] and torque (3,) [N m] on the hand along the world's axes about the hand's origin, without its own weight."""
        ...

    def begin(self, call: Call) -> None:
        """A call of the protocol begins: the place to zero a sensor, or to find that a protective stop must be released by a person;
        then raise `CannotAct` with one sentence."""
        ...

    def tick(self, to: Reference, fingers: Drive) -> None:
        """Act for one tick and return at its end."""
        ...
