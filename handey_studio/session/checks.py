"""What a session read from a file must hold before anyone trusts it."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import shapely

from handey_studio.base import BadInput
from handey_studio.cell.recording import Recording
from handey_studio.geometry import Polyhedron, polyhedron_from_polygons
from handey_studio.geometry.transforms import is_rigid
from handey_studio.grasping import ForbiddenRange
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.session.session import Session, ViewState
from handey_studio.task.plan import MovePlan

MAX_NAME = 120
NOT_IN_NAMES = '/\\:*?"<>|'
MAX_PARTS, MAX_COMMANDS, MAX_RESULTS, MAX_BODIES = 200, 500, 500, 500
MAX_ATTEMPTS, MAX_IMPROVE = 20, 1000
MAX_MAP_SIDE, MAX_CELL_M = 4000, 0.05
MAX_COORDINATE_M = 1e3
MOST_TURN = 20.0  # [rad] hand angles are told from the grasp plane's axes, at most a few turns on
ANY_NUMBER = ("elevation", "depth")  # arrays in which NaN says that nothing was read


def check_session(session: Session) -> None:
    """Raises BadInput with one sentence when something in a session cannot be: its frames, numbers, shapes or counts."""
    _check_counts(session)
    for path, value in _walk(session, "session"):
        if isinstance(value, np.ndarray):
            _check_array(path, value)
        elif isinstance(value, Polyhedron):
            _check_solid(path, value)
        elif isinstance(value, DepthMap):
            _check_map(path, value)
        elif isinstance(value, MovePlan):
            _check_plan(path, value)
        elif isinstance(value, Recording):
            _check_recording(path, value)
        elif isinstance(value, ForbiddenRange) and not -MOST_TURN <= value.low <= value.high <= MOST_TURN:
            raise BadInput(
                f"{path} goes from {value.low:.3g} to {value.high:.3g} rad; angles go from -{MOST_TURN} to {MOST_TURN} rad, upwards."
            )
        elif isinstance(value, ViewState) and not value.camera_position.shape == value.camera_look_at.shape == (3,):
            raise BadInput(f"{path} needs a camera position and a point to look at, three coordinates each.")


def check_name(name: str) -> str:
    """A session's name, which is also the name of its file: printable, no folder separators, not hidden."""
    fits = 0 < len(name) <= MAX_NAME and name == name.strip() and name.isprintable()
    if not fits or name.startswith(".") or set(name) & set(NOT_IN_NAMES):
        raise BadInput(f'the session name "{name[:60]}" cannot be used; give 1 to {MAX_NAME} letters, digits, spaces, "-" or "_".')
    return name


def _check_counts(session: Session) -> None:
    check_name(session.name)
    counts = (
        ("parts", len(session.parts), MAX_PARTS),
        ("located parts", len(session.located), MAX_PARTS),
        ("commands", len(session.commands), MAX_COMMANDS),
        ("results", len(session.results), MAX_RESULTS),
        ("states of commands", len(session.states), MAX_COMMANDS),
        ("bodies", len(session.workcell.setup.bodies), MAX_BODIES),
        ("blocks", len(session.workcell.blocks), MAX_BODIES),
    )
    for thing, count, limit in counts:
        if count > limit:
            raise BadInput(f"the session has {count} {thing}, the limit is {limit}.")
    for thing, number, least, most in (("attempts", session.attempts, 1, MAX_ATTEMPTS), ("improve", session.improve, 0, MAX_IMPROVE)):
        if not least <= number <= most:
            raise BadInput(f"{thing} is {number}; it must be from {least} to {most}.")
    missing = sorted(set(session.workcell.parts) - {part.name for part in session.parts})
    if missing:
        raise BadInput(f"the session lacks the model of {', '.join(missing)}.")


def _walk(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Every value inside a session with its path, such as `session.scene.depth_map.T_world_range`."""
    yield path, value
    if is_dataclass(value):
        for f in fields(value):
            yield from _walk(getattr(value, f.name), f"{path}.{f.name}")
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _walk(item, f"{path}.{key}")
    elif isinstance(value, tuple | list) and not (value and isinstance(value[0], int | float | str)):
        for number, item in enumerate(value):
            yield from _walk(item, f"{path}[{number}]")


def _check_array(path: str, array: np.ndarray) -> None:
    field = path.rsplit(".", 1)[-1].split("[")[0]
    if field.startswith("T_") and not is_rigid(array):
        raise BadInput(f"{path} is not a rigid 4×4 transform; its rotation must be proper and its numbers finite.")
    if field not in ANY_NUMBER and array.dtype.kind == "f" and not np.isfinite(array).all():
        raise BadInput(f"{path} holds a number that is not finite.")
    if field.startswith("T_") and np.abs(array[:3, 3]).max() > MAX_COORDINATE_M:
        raise BadInput(f"{path} lies {np.abs(array[:3, 3]).max():.3g} m away, the limit is {MAX_COORDINATE_M:.0f} m.")


def _check_solid(path: str, solid: Polyhedron) -> None:
    """The surface must be a closed solid, by the same test that a model file passes."""
    corners = {corner for face in solid.faces for loop in face.loops for corner in loop}
    if solid.vertices.ndim != 2 or solid.vertices.shape[1:] != (3,) or not corners <= set(range(len(solid.vertices))):
        raise BadInput(f"{path} has faces with corners that it lacks.")
    if not (far := float(np.abs(solid.vertices).max(initial=0.0))) <= MAX_COORDINATE_M:
        raise BadInput(f"{path} has a corner {far:.3g} m away, the limit is {MAX_COORDINATE_M:.0f} m.")
    if any(len(loop) < 3 for face in solid.faces for loop in face.loops):
        raise BadInput(f"{path} has a face with fewer than 3 corners.")
    try:
        polyhedron_from_polygons(solid.vertices, solid.triangles.tolist())
    except (ValueError, IndexError, shapely.errors.GEOSException) as error:
        raise BadInput(f"{path} is not a closed solid: {error}") from None


def _check_map(path: str, scan: DepthMap) -> None:
    shape = scan.elevation.shape
    if len(shape) != 2 or not all(1 <= n <= MAX_MAP_SIDE for n in shape) or scan.passed.shape != shape:
        raise BadInput(
            f"{path} has {shape} cells and {scan.passed.shape} light heights; both must be one grid of up to {MAX_MAP_SIDE} a side."
        )
    if not 0 < scan.cell <= MAX_CELL_M or not np.isfinite(scan.passed).all():
        raise BadInput(f"{path} needs cells of up to {MAX_CELL_M * 1e3:.0f} mm and finite light heights.")
    if np.isinf(scan.elevation).any() or not np.isfinite([scan.noise, scan.outline_error]).all():
        raise BadInput(f"{path} holds an infinite elevation or error.")


def _check_recording(path: str, recording: Recording) -> None:
    """Every quantity must have one row a sample, and time must not run backwards."""
    n, joints = len(recording.time_s), recording.q_rad.shape[1:]
    wanted = {"time_s": (n,), "q_rad": (n, *joints), "q_command_rad": (n, *joints), "opening_m": (n,), "finger_force_N": (n,)}
    wanted |= {"force_N": (n, 3), "torque_Nm": (n, 3)}
    for name, shape in wanted.items():
        if n == 0 or len(joints) != 1 or getattr(recording, name).shape != shape:
            raise BadInput(f"{path}.{name} has the shape {getattr(recording, name).shape}; it needs one row for each of {n} samples.")
    if (np.diff(recording.time_s) < 0).any():
        raise BadInput(f"{path} has times that run backwards.")


def _check_plan(path: str, plan: MovePlan) -> None:
    """Every step must have one opening and one configuration for each of its times, which do not run backwards."""
    for number, step in enumerate(plan.steps):
        n = len(step.time_s)
        shapes = (step.time_s.shape, step.q_rad.shape, step.hand_opening_m.shape)
        if n == 0 or shapes != ((n,), (n, len(step.joint_names)), (n,)):
            raise BadInput(f"{path}.steps[{number}] has times, joints and openings of shapes {shapes}; each needs one row a time.")
        if step.clearance_m.shape not in ((n,), (0,)):
            raise BadInput(f"{path}.steps[{number}] has clearances of shape {step.clearance_m.shape}; it needs one a time, {n}.")
        if (np.diff(step.time_s) < 0).any():
            raise BadInput(f"{path}.steps[{number}] has times that run backwards.")
    first = [carry.first_step for carry in plan.carries]
    if not first or first[0] != 0 or sorted(set(first)) != first or first[-1] > max(len(plan.steps) - 1, 0):
        raise BadInput(f"{path}.carries begin at the steps {first}; they must begin at step 0 and follow one another.")
