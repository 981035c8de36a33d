"""STEP files (ISO 10303-21), read through Open CASCADE where it is installed: an optional extra."""

import importlib
import io
from pathlib import Path

import numpy as np

from handey_studio.base import BadInput
from handey_studio.world.model_files import MAX_MODEL_BYTES, Mesh

STEP_SUFFIXES = (".step", ".stp")
CHORD_MM, TURN_RAD = 0.05, 0.3  # how far triangles may be off what is round


def read_step(path: Path) -> Mesh:
    """The triangles of a STEP file's bodies, in metres; the file tells its own unit. Raises BadInput with one sentence."""
    try:
        cascadio = importlib.import_module("cascadio")
    except ImportError:
        raise BadInput(
            "reading STEP files takes the extra: pip install 'handey-studio[step]'; or export it as STL and give its unit."
        ) from None
    import trimesh  # slow to import

    try:
        if path.stat().st_size > MAX_MODEL_BYTES:
            raise BadInput(f"it has {path.stat().st_size} bytes, the limit is {MAX_MODEL_BYTES}.")
        data = path.read_bytes()
    except FileNotFoundError:
        raise BadInput("it does not exist.") from None
    except OSError as error:
        raise BadInput(f"it cannot be read: {error.strerror}.") from None
    glb = cascadio.load(data, file_type="step", tol_linear=CHORD_MM, tol_angular=TURN_RAD, merge_primitives=True)
    if not glb:
        raise BadInput("it is no STEP file with a solid that Open CASCADE can read.")
    mesh = trimesh.load_mesh(io.BytesIO(glb), file_type="glb", process=False)
    return Mesh(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces).tolist())
