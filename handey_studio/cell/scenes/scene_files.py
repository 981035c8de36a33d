"""Simulated scenes as folders: depth.png and camera.json as a user's own files, truth.json beside them."""

import json
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from handey_studio.base import BadInput
from handey_studio.base.files import replace_file
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.scenes.pile_scenes import SimulatedScene, TruePose
from handey_studio.geometry import Face, Polyhedron
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from handey_studio.sensing.reading.files import read_depth

DEPTH_SCALE_MM = 0.1  # a unit of depth.png
SCHEMA = "handey/scene/1"


def save_scene(scene: SimulatedScene, folder: str | os.PathLike) -> None:
    """Write depth.png (16 bit, 0.1 mm a unit, 0 = no reading), camera.json and truth.json into a folder, which is made. Raises OSError."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    raw = np.nan_to_num(np.round(scene.view.depth * 1e3 / DEPTH_SCALE_MM)).clip(0, 65535).astype(np.uint16)
    replace_file(folder / "depth.png", cv2.imencode(".png", raw)[1].tobytes())
    replace_file(folder / "camera.json", json.dumps(_camera(scene.view), indent=1).encode())
    replace_file(folder / "truth.json", json.dumps(_truth(scene), indent=1).encode())


def load_scene(folder: str | os.PathLike) -> SimulatedScene:
    """A scene from its folder. A camera's image is read as any user's depth file is: nothing but the files tells about the sensor.

    Raises BadInput.
    """
    folder = Path(folder)
    truth = read_json(folder / "truth.json")
    if truth.get("schema") != SCHEMA:
        raise BadInput(f'"{folder / "truth.json"}" has the schema {truth.get("schema")!r}; it must be "{SCHEMA}".')
    camera = read_json(folder / "camera.json")
    view = _map_view(folder, camera) if "pixel_m" in camera else read_depth(folder / "depth.png", folder / "camera.json").view
    poses = (TruePose(p["part"], np.array(p["T_world_part"]), p["visible_fraction"], p["visible_px"]) for p in truth["parts"])
    return SimulatedScene(truth["seed"], view, tuple(poses), tuple(_body(body) for body in truth["clutter"]))


def read_json(path: Path) -> dict[str, Any]:
    """An object from a JSON file; BadInput when there is none."""
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise BadInput(f'"{path}" cannot be read as JSON: {error}.') from None
    if not isinstance(content, dict):
        raise BadInput(f'"{path}" must hold a JSON object.')
    return content


def _camera(view: DepthView) -> dict[str, Any]:
    height, width = view.depth.shape
    common = {"width": width, "height": height, "depth_scale": DEPTH_SCALE_MM, "T_world_sensor": view.T_world_sensor.tolist()}
    seen_by = view.projection
    if isinstance(seen_by, Pinhole):
        return {"fx": seen_by.fx, "fy": seen_by.fy, "cx": seen_by.cx, "cy": seen_by.cy, **common}
    measures = {"noise_m": view.noise, "outline_error_m": view.outline_error}
    return {"pixel_m": seen_by.pixel, "cx": seen_by.cx, "cy": seen_by.cy, **measures, **common}


def _map_view(folder: Path, camera: dict[str, Any]) -> DepthView:
    """The range finder's map from above: parallel light, which the BOP keys cannot say."""
    raw = cv2.imread(str(folder / "depth.png"), cv2.IMREAD_UNCHANGED)
    if raw is None or raw.dtype != np.uint16 or raw.ndim != 2:
        raise BadInput(f'"{folder / "depth.png"}" is not a 16-bit depth image.')
    depth = np.where(raw > 0, raw * (camera["depth_scale"] * 1e-3), np.nan)
    light = Orthographic(camera["pixel_m"], camera["cx"], camera["cy"])
    return DepthView(depth, light, np.array(camera["T_world_sensor"]), camera["noise_m"], camera["outline_error_m"])


def _truth(scene: SimulatedScene) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "seed": scene.seed,
        "parts": [
            {
                "part": pose.part,
                "visible_fraction": pose.visible_fraction,
                "visible_px": pose.visible_px,
                "T_world_part": pose.T_world_part.tolist(),
            }
            for pose in scene.truth
        ],
        "clutter": [
            {
                "name": body.name,
                "T_world_body": body.T_world_body.tolist(),
                "vertices": body.solid.vertices.tolist(),
                "faces": [list(face.outer) for face in body.solid.faces],
            }
            for body in scene.clutter
        ],
    }


def _body(saved: dict[str, Any]) -> SolidBody:
    solid = Polyhedron(np.array(saved["vertices"]), tuple(Face(tuple(face)) for face in saved["faces"]))
    return SolidBody(saved["name"], solid, np.array(saved["T_world_body"]))
