"""Photographs from a folder: PNG or JPEG, grey or colour, 8 or 16 bit, and the dark frame that belongs to each.

The laser is off in a dark frame and all else is as it was. `NAME.dark.png` is the dark frame of `NAME.png`,
`CAMERA.dark.png` that of every photograph of a camera of that name, and `dark.png` that of all others.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput

SUFFIXES = (".png", ".jpg", ".jpeg")
MAX_FILE_BYTES = 100_000_000
MAX_SIDE_PX = 8192
MAX_PIXELS = 40_000_000
MAX_PHOTOGRAPHS = 5000
SATURATED = 0.94  # of the full scale: lenses and JPEG pull the white of an overexposed stripe a little below its end
DARK = "dark"


@dataclass(frozen=True, eq=False)
class Photograph:
    """Light (H, W, 3) float32, blue, green, red, on a scale to 255; `saturated` (H, W) marks pixels at the scale's end."""

    light: NDArray
    saturated: NDArray

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.light.shape[1], self.light.shape[0]


def list_photographs(folder: Path) -> list[Path]:
    """The photographs of a folder in the order of their names, dark frames left out. Raises BadInput."""
    if not folder.is_dir():
        raise BadInput(f'the folder of photographs "{folder}" does not exist.')
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and not is_dark(path))
    if not found:
        raise BadInput(f'the folder "{folder}" holds no photograph; they must be one of {", ".join(SUFFIXES)}.')
    if len(found) > MAX_PHOTOGRAPHS:
        raise BadInput(f'the folder "{folder}" holds {len(found)} photographs, the limit is {MAX_PHOTOGRAPHS}.')
    return found


def is_dark(path: Path) -> bool:
    """Whether a file is a dark frame by its name."""
    return path.stem == DARK or path.stem.endswith(f".{DARK}")


def dark_frame_of(path: Path, common: Path | None = None, camera: str = "") -> Path | None:
    """The dark frame of a photograph: its own, else its camera's (by the camera's name), else `common`, else its folder's, else None."""
    own = _with_stem(path.parent, f"{path.stem}.{DARK}") or (_with_stem(path.parent, f"{camera}.{DARK}") if camera else None)
    return own or common or _with_stem(path.parent, DARK)


def _with_stem(folder: Path, stem: str) -> Path | None:
    return next((folder / f"{stem}{suffix}" for suffix in SUFFIXES if (folder / f"{stem}{suffix}").is_file()), None)


def read_photograph(path: Path) -> Photograph:
    """A photograph from its file. Raises BadInput with one sentence."""
    content = _bytes(path)
    width, height = _declared_size(path, content)
    if not (0 < width <= MAX_SIDE_PX and 0 < height <= MAX_SIDE_PX) or width * height > MAX_PIXELS:
        raise BadInput(f'photograph "{path}" is {width} × {height} px, the limit is {MAX_SIDE_PX} a side and {MAX_PIXELS} in all.')
    try:
        raw = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        raw = None
    if raw is None or raw.dtype not in (np.uint8, np.uint16):
        raise BadInput(f'photograph "{path}" is damaged and cannot be decoded as 8 or 16 bit.')
    full = 255.0 if raw.dtype == np.uint8 else 65535.0
    light = raw.astype(np.float32) * np.float32(255.0 / full)
    return Photograph(light, light.max(axis=2) >= SATURATED * 255.0)


def _bytes(path: Path) -> bytes:
    try:
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            raise BadInput(f'photograph "{path}" has {size} bytes, the limit is {MAX_FILE_BYTES}.')
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f'photograph "{path}" cannot be read: {error.strerror}.') from None


def _declared_size(path: Path, content: bytes) -> tuple[int, int]:
    """Width and height as the file's header tells, before anything is allocated."""
    if content[:8] == b"\x89PNG\r\n\x1a\n" and len(content) >= 33:
        return int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")
    place = 2
    while content[:2] == b"\xff\xd8" and place + 9 < len(content) and content[place] == 0xFF:
        kind, length = content[place + 1], int.from_bytes(content[place + 2 : place + 4], "big")
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):  # a start of frame
            return int.from_bytes(content[place + 7 : place + 9], "big"), int.from_bytes(content[place + 5 : place + 7], "big")
        place += 1 if kind == 0xFF else 2 + max(length, 2)
    raise BadInput(f'photograph "{path}" is neither a PNG nor a JPEG file.')
