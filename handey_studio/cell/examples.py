"""Example workcells. Their true state is data for the simulated cell; no planner sees it."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell
from handey_studio.geometry.transforms import from_xyz_rpy, rotation_about, transform

# The L block of parts/l_block.obj, in metres: its foot lies along x, its leg along y.
L_FOOT, L_LEG, L_THICK = 0.060, 0.070, 0.0295
LEAN = np.deg2rad(20.0)  # of the hooked L; upright it would look the same from above when turned by half a turn
HOOK_GAP = 0.003  # between the hooked L's leg and the block that it hangs on


def figure1() -> Workcell:
    """The task of Handey 1987, Figure 1: two L blocks among blocks that no model describes.

    One stands on its foot. The other is upside down: it stands on the end of its leg and leans with its foot's underside
    on an unmodelled block. Upside down on the first one it makes a block (the mating pose `block`).
    """
    T_upright = _pose(0.40, -0.06, 0.0, 25.0)
    T_hooked = _pose(0.55, 0.07, 0.0, -40.0)
    bodies = (
        TrueBody("l_block#1", T_upright @ transform(rotation_about((1, 0, 0), np.pi / 2)), part="l_block"),
        TrueBody("l_block#2", T_hooked @ _hooked_on_its_leg(), part="l_block"),
        _hook(T_hooked),
        TrueBody("backing", T_upright @ _pose(-0.0153, -0.015, 0.0175), size=np.array([0.030, 0.060, 0.035])),
        TrueBody("tower", _pose(0.36, 0.11, 0.055, 15.0), size=np.array([0.030, 0.035, 0.110])),
        TrueBody("leaning", _pose(0.32674, 0.10419, 0.03725, 15.0, pitch_deg=20.297), size=np.array([0.012, 0.050, 0.075])),
        TrueBody("plank", _pose(0.47, 0.13, 0.010, 8.0), size=np.array([0.090, 0.060, 0.020])),
        TrueBody("cube", _pose(0.485, 0.135, 0.035, -25.0), size=np.array([0.030, 0.030, 0.030])),
        TrueBody("brick", _pose(0.60, -0.09, 0.0225, 30.0), size=np.array([0.050, 0.040, 0.045])),
    )
    return Workcell(robot="ur5", parts=("l_block",), setup=SimulatedSetup(bodies))


def _pose(x: float, y: float, z: float, yaw_deg: float = 0.0, pitch_deg: float = 0.0) -> NDArray:
    return from_xyz_rpy((x, y, z), np.deg2rad((0.0, pitch_deg, yaw_deg)))


def _hooked_on_its_leg() -> NDArray:
    """The L upside down, tilted by LEAN about the outer edge of its leg's end, which lies on the origin along y."""
    c, s = np.cos(LEAN), np.sin(LEAN)
    R = np.array([[c, s, 0.0], [0.0, 0.0, 1.0], [s, -c, 0.0]])
    return transform(R, -R @ (0.0, L_LEG, 0.0))


def _hook(T_hooked: NDArray) -> TrueBody:
    """The block below the foot's underside, whose upper edge just meets it; narrow, so that the scan sees past it."""
    c, s = np.cos(LEAN), np.sin(LEAN)
    near = L_THICK * c + HOOK_GAP
    hang = L_LEG - L_THICK  # underside of the foot above the leg's end
    height = (near + hang * s) / c * s + hang * c
    size = np.array([0.030, 0.016, height])
    return TrueBody("hook", T_hooked @ _pose(near + size[0] / 2, 0.010, height / 2), size=size)
