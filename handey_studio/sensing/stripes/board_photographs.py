"""Folders of board photographs: in which the board is found, and which two show it standing still with the laser off and on.

`NAME.laser.png` shows what `NAME.png` shows, with the laser on. Where no name says so the photographs do: two in which the board stands in
the same place are partners, and the one with more light in a narrow place has the laser on.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Progress
from handey_studio.sensing.stripes.board import Board, find_corners
from handey_studio.sensing.stripes.photographs import SUFFIXES, Photograph, list_photographs, read_photograph

LASER, MOVED = "laser", "moved"
SMALL_PX = 640  # longer side of the small copies by which photographs are compared
STILL = 0.002  # of the photograph's longer side: corners that moved by less did not move
MOST = 0.85  # of the corners, and of the pixels about the board: a stripe crosses fewer, a board that moved leaves more
ALIKE = 25.0  # of 255: greatest difference of most pixels about the board
LIT_SHARE, LEAST_LIT = 0.002, 8.0  # of a photograph's pixels that a stripe covers, and the light, of 255, that it adds there


@dataclass(frozen=True, eq=False)
class BoardPhotograph:
    """A photograph, by its name and file: its size (width, height), the board's corners (n, 2) [px] if found, and a small grey copy."""

    name: str
    path: Path
    size: tuple[int, int]
    corners: NDArray | None
    small: NDArray


def look_at_boards(folders: Sequence[Path], board: Board, left_out: dict[str, str], progress: Progress) -> list[BoardPhotograph]:
    """The folders' photographs, all of one size, but for those that other photographs name as partners; adds to `left_out` by name.

    Raises BadInput when none shows the board.
    """
    paths = [path for folder in folders for path in list_photographs(folder) if not path.stem.endswith((f".{LASER}", f".{MOVED}"))]
    stems = Counter(path.stem for path in paths)
    found: list[BoardPhotograph] = []
    for k, path in enumerate(paths):
        if progress.cancelled:
            break
        progress.report(k / len(paths), f"looking for the board in {path.name}")
        photograph = read_photograph(path)
        name = path.stem if stems[path.stem] == 1 else f"{path.parent.name}/{path.name}"
        found.append(BoardPhotograph(name, path, photograph.size, board_corners(photograph, board), _small(photograph)))
    sizes = Counter(one.size for one in found if one.corners is not None)
    if not sizes:
        raise BadInput(
            f"no photograph of {len(paths)} shows a {board.pattern} of {board.columns} × {board.rows} inner corners "
            "(a board of 10 × 7 squares has 9 × 6)."
        )
    size = sizes.most_common(1)[0][0]
    left_out |= {one.name: f"it has {one.size} px and most have {size}; one camera has one size" for one in found if one.size != size}
    return [one for one in found if one.size == size]


def board_corners(photograph: Photograph, board: Board) -> NDArray | None:
    """The board in a photograph: in all its light, else in the colour in which a laser across it may be dark."""
    corners = find_corners(photograph.light.mean(axis=2), board)
    if corners is not None:
        return corners
    singles = (find_corners(photograph.light[..., channel], board, thorough=False) for channel in (0, 2, 1))
    return next((corners for corners in singles if corners is not None), None)


def partner_by_name(path: Path, kind: str) -> Path | None:
    """The photograph that another's name tells to be its partner (`laser`, `moved`), or None."""
    return next((one for suffix in SUFFIXES if (one := path.with_name(f"{path.stem}.{kind}{suffix}")).is_file()), None)


def partners(photographs: Sequence[BoardPhotograph]) -> dict[str, Path]:
    """Photographs with the laser on by their dark partners' names: as the files' names tell, else as the photographs show."""
    named = {one.name: lit for one in photographs if (lit := partner_by_name(one.path, LASER)) is not None}
    if named:
        return named
    found: dict[str, Path] = {}
    for dark in photographs:
        if dark.corners is not None:
            lit = [one for one in photographs if one is not dark and _one_pose(dark, one) and _more_lit(one, dark)]
            if lit:
                found[dark.name] = max(lit, key=lambda one: _added(one, dark)).path
    return found


def _small(photograph: Photograph) -> NDArray:
    grey = photograph.light.mean(axis=2)
    scale = min(1.0, SMALL_PX / max(grey.shape))
    return cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1.0 else grey


def _one_pose(seen: BoardPhotograph, other: BoardPhotograph) -> bool:
    """Whether the board, whose corners the first shows, stands in the same place in the other."""
    corners = seen.corners
    if corners is None:
        return False
    if other.corners is not None:
        apart = np.linalg.norm(other.corners[:, None] - corners, axis=2).min(axis=1)  # a square board may be counted from any corner
        return float(np.quantile(apart, MOST)) <= STILL * max(seen.size)
    scale = max(seen.small.shape) / max(seen.size)
    (left, top), (right, bottom) = np.floor(corners.min(axis=0) * scale).astype(int), np.ceil(corners.max(axis=0) * scale).astype(int)
    a, b = (one.small[max(0, top) : bottom + 1, max(0, left) : right + 1] for one in (seen, other))
    return float(np.quantile(np.abs(a - b), MOST)) <= ALIKE


def _more_lit(one: BoardPhotograph, other: BoardPhotograph) -> bool:
    return _added(one, other) > max(LEAST_LIT, _added(other, one))


def _added(one: BoardPhotograph, other: BoardPhotograph) -> float:
    """The light that one photograph has more than the other in its brightest narrow place."""
    return float(np.quantile(one.small - other.small, 1.0 - LIT_SHARE))
