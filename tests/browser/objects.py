"""Objects in front of simulated cameras, written to files as a person's camera would write them."""

import json
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.camera import STRUCTURED_LIGHT, DepthCamera, SensorFaults, look_exactly, with_faults
from handey_studio.geometry import Polyhedron, box
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.sensing.depth_view import Pinhole

PINHOLE, SHAPE = Pinhole(570.0, 570.0, 319.5, 239.5), (480, 640)
TABLE = SolidBody("table", box((2.0, 2.0, 0.02)), from_xyz_rpy((0.0, 0.0, -0.01)), fixed=True)


def looking(eye: tuple[float, float, float], at: tuple[float, float, float]) -> NDArray:
    """T_world_camera (4, 4) of a camera at `eye` [m] that looks at a point, its rows level."""
    z = np.subtract(at, eye) / np.linalg.norm(np.subtract(at, eye))
    x = np.cross(z, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(z, (0.0, 0.0, 1.0)))
    return transform(np.stack([x, np.cross(z, x), z], axis=1), eye)


def write_scan(
    folder: Path, name: str, solid: Polyhedron, T_world_solid: NDArray, T_world_camera: NDArray, noise: float, seed: int
) -> tuple[Path, Path]:
    """A 16-bit PNG and its camera file, of a solid on a table seen by a camera with that noise [m]; they do not tell where it stood."""
    camera = DepthCamera(PINHOLE, SHAPE, T_world_camera)
    seen = look_exactly(camera, [TABLE, SolidBody("object", solid, T_world_solid)])
    faults = STRUCTURED_LIGHT if noise > 0.001 else SensorFaults()
    depth = with_faults(seen, SensorFaults(**{**vars(faults), "noise_m": noise}), np.random.default_rng(seed))
    raw = np.nan_to_num(np.round(depth * 1e4)).astype(np.uint16)
    image, told = folder / f"{name}.png", folder / f"{name}.json"
    cv2.imwrite(str(image), raw)
    told.write_text(json.dumps({"fx": PINHOLE.fx, "fy": PINHOLE.fy, "cx": PINHOLE.cx, "cy": PINHOLE.cy, "depth_scale": 0.1}))
    return image, told
