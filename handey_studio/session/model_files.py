"""Scans and parts that come as bytes from a browser."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from handey_studio.base import BadInput
from handey_studio.modeling.scans import Scan, read_scan


@dataclass(frozen=True, eq=False)
class Upload:
    """A scan as it was uploaded: a depth image with its camera, or a cloud in a unit. `trial`: a model is to be looked for in it."""

    name: str
    content: bytes
    camera: bytes = b""
    unit: str = "m"
    trial: bool = False


def scan_of_upload(upload: Upload) -> Scan | str:
    """The scan in an upload, or one sentence that says why it cannot be used."""
    with tempfile.TemporaryDirectory(prefix="handey-") as folder:
        depth, camera = Path(folder) / Path(upload.name).name, Path(folder) / "camera.json"
        depth.write_bytes(upload.content)
        camera.write_bytes(upload.camera)
        try:
            scan = read_scan("scan", depth, camera if upload.camera else None, upload.unit)
        except BadInput as error:
            return str(error).replace(f"{folder}/", "")
    return Scan(scan.name, scan.view, upload.name)
