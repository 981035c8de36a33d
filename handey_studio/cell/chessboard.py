"""A printed chessboard before the range finder's cameras, as a body with a pattern on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import Value, frozen_array
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.photographs import Paint, body_paint
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, inverse, transform

WHITE, BLACK = 0.9, 0.12
THICK_M = 0.003
LAID_RAD = np.deg2rad(11.0)  # nobody lays a board down square
MARGIN = 0.8  # of a square: the paper's white around the pattern


@dataclass(frozen=True, eq=False)
class Chessboard(Value):
    """A board of `columns` × `rows` inner corners, squares of side `square` [m].

    Its frame: the middle of the pattern, z out of the paper.
    """

    T_range_board: NDArray
    columns: int = 9
    rows: int = 6
    square: float = 0.02

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_range_board", frozen_array(self.T_range_board))

    @property
    def body(self) -> SolidBody:
        """The board as a body of the range frame; its printed side is z = 0 of the board's frame."""
        sides = [(n + 1 + 2 * MARGIN) * self.square for n in (self.columns, self.rows)]
        return SolidBody("board", box((*sides, THICK_M)), self.T_range_board @ transform(None, (0.0, 0.0, -THICK_M / 2)), fixed=True)

    def white(self, points_range: NDArray) -> NDArray:
        """How white (n,) the board is at points (n, 3) of the range frame."""
        on_board = apply(inverse(self.T_range_board), points_range)
        column, row = (on_board[:, k] / self.square + (n + 1) / 2 for k, n in ((0, self.columns), (1, self.rows)))
        inside = (column >= 0) & (column < self.columns + 1) & (row >= 0) & (row < self.rows + 1) & (on_board[:, 2] > -THICK_M / 2)
        black = inside & ((np.floor(column) + np.floor(row)) % 2 == 0)
        return np.where(black, BLACK, WHITE)


def painted(board: Chessboard, bodies: Sequence[SolidBody]) -> tuple[list[SolidBody], Paint]:
    """The bodies with the board in front of them, and how white all of it is. The bodies' world is the range frame."""
    together = [board.body, *bodies]
    plain, board_faces = body_paint(together), len(board.body.solid.faces)
    return together, lambda face, points: np.where(face < board_faces, board.white(points), plain(face, points))


def board_poses(count: int, rng: np.random.Generator, reach: float = 0.03, height: float = 0.12, tilt: float = 0.5) -> list[NDArray]:
    """Poses (4, 4) of a board: the first flat at the range frame's origin, the others about it.

    They are raised up to `height` [m] and tilted up to `tilt` [rad].
    """
    poses = [transform(Rotation.from_rotvec((0.0, 0.0, LAID_RAD)).as_matrix())]
    for k in range(1, count):
        away = rng.uniform(-reach, reach, 2)
        turn = rng.uniform(0.4, 1.0) * tilt
        axis = rng.uniform(0.0, 2 * np.pi)
        R = Rotation.from_rotvec((turn * np.cos(axis), turn * np.sin(axis), 0.0)) * Rotation.from_rotvec((0.0, 0.0, rng.uniform(-0.3, 0.3)))
        poses.append(transform(R.as_matrix(), (*away, height * k / count + 0.02)))
    return poses
