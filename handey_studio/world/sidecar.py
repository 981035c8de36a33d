"""The `.toml` beside a part's OBJ: what the OBJ cannot say. Lengths in metres, angles in degrees."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import from_xyz_rpy, is_rigid, to_xyz_rpy
from handey_studio.world.part import Mate, Part, Provenance

MAX_BYTES = 1_000_000
DENSITY_KG_M3 = (1.0, 30_000.0)  # from foam to osmium and a little
FRICTION = (0.0, 3.0)
MOST_TOLD = 120  # symmetries of a shape that are written; a fine prism has hundreds


def sidecar_part(name: str, solid: Polyhedron, path: Path) -> Part:
    """The part of that name and shape, with what the sidecar at `path` says if it is there. Raises BadInput with one sentence."""
    table: dict[str, Any] = {}
    if path.is_file():
        try:
            if path.stat().st_size > MAX_BYTES:
                raise BadInput(f'the sidecar "{path}" has {path.stat().st_size} bytes, the limit is {MAX_BYTES}.')
            table = tomllib.loads(path.read_text())
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
            raise BadInput(f'the sidecar "{path}" cannot be read as TOML: {error}.') from None
    try:
        density, friction = float(table.get("density_kg_m3", 700.0)), float(table.get("friction", 0.5))
        mates = {mate_name: _mate(mate) for mate_name, mate in table.get("mates", {}).items()}
        part = Part(name, solid, density, friction, mates, _provenance(table.get("provenance", {})))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise BadInput(f'the sidecar "{path}" is broken: {error!r}.') from None
    for what, value, (low, high) in (("density_kg_m3", density, DENSITY_KG_M3), ("friction", friction, FRICTION)):
        if not low <= value <= high:
            raise BadInput(f'the sidecar "{path}" says {what} = {value:g}; it must be {low:g} to {high:g}.')
    return part


def _mate(mate: dict[str, Any]) -> Mate:
    T = from_xyz_rpy(mate["xyz_m"], np.deg2rad(mate.get("rpy_deg", (0, 0, 0))))
    if not is_rigid(T):
        raise ValueError("a mate's xyz_m and rpy_deg are three finite numbers each")
    return Mate(str(mate["part"]), T)


def _provenance(table: dict[str, Any]) -> Provenance:
    told = {key: float(table[key]) for key in ("rms_m", "explained", "seen") if key in table}
    scans, faces = table.get("scans", []), table.get("assumed_faces", [])
    return Provenance(str(table.get("source", "")), tuple(str(scan) for scan in scans), **told, assumed_faces=tuple(int(f) for f in faces))


def sidecar_text(part: Part) -> str:
    """What the sidecar of a part holds. The same part gives the same text. Raises BadInput for numbers that it may not have."""
    for what, value, (low, high) in (("density [kg/m³]", part.density, DENSITY_KG_M3), ("friction", part.friction, FRICTION)):
        if not low <= value <= high:
            raise BadInput(f'part "{part.name}" has the {what} {value:g}; it must be {low:g} to {high:g}.')
    lines = ["# What the OBJ cannot say. Lengths in metres, angles in degrees."]
    lines += [f"density_kg_m3 = {_number(part.density)}", f"friction = {_number(part.friction)}"]
    lines += _provenance_lines(part.provenance)
    lines += ["", "# Found in the shape: its turns onto itself, as axis and angle about its centroid.", "[symmetry]"]
    turns = [_turn(T) for T in part.symmetries[1:]]
    lines += [f"count = {len(turns) + 1}", f"turns_deg = [{', '.join(turns[:MOST_TOLD])}]"]
    for name, mate in part.mates.items():
        xyz, rpy = to_xyz_rpy(mate.T_this_part)
        lines += ["", f"[mates.{_text(name)}]", f"part = {_text(mate.part)}"]
        degrees = np.round(np.rad2deg(rpy), 9)
        lines += [f"xyz_m = {_numbers(xyz, 12)}", f"rpy_deg = {_numbers(np.where(degrees == -180.0, 180.0, degrees), 9)}"]
    return "\n".join(lines) + "\n"


def _provenance_lines(told: Provenance) -> list[str]:
    if told == Provenance():
        return []
    lines = [
        "",
        "# Where the model came from, and how well it agrees with what was seen.",
        "[provenance]",
        f"source = {_text(told.source)}",
    ]
    if told.scans:
        lines.append(f"scans = [{', '.join(_text(scan) for scan in told.scans)}]")
    for key in ("rms_m", "explained", "seen"):
        value = getattr(told, key)
        if value is not None and np.isfinite(value):
            lines.append(f"{key} = {_number(value)}")
    if told.assumed_faces:
        lines.append(f"assumed_faces = {list(told.assumed_faces)}")
    return lines


def _turn(T: NDArray) -> str:
    turn = Rotation.from_matrix(T[:3, :3]).as_rotvec()
    angle = float(np.linalg.norm(turn))
    return f"{{ axis = {_numbers(turn / angle, 6)}, angle = {_number(round(float(np.rad2deg(angle)), 4))} }}"


def _numbers(values: NDArray, digits: int) -> str:
    return "[" + ", ".join(_number(round(float(value), digits)) for value in values) + "]"


def _number(value: float) -> str:
    return repr(float(value) + 0.0)


def _text(text: str) -> str:
    """A TOML string; JSON's are TOML's but for one character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
