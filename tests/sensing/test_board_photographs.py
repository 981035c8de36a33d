"""Photographs with the laser off and on find each other, by their names or by what they show."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from handey_studio.base import BadInput, Silent
from handey_studio.sensing.stripes.board import Board
from handey_studio.sensing.stripes.board_photographs import look_at_boards, partners
from tests.sensing.stripe_images import noisy, stripe

BOARD = Board(6, 4, 0.02)


def board_at(left: int, top: int, lit: bool, rng: np.random.Generator) -> np.ndarray:
    """A chessboard of 7 × 5 squares of 20 px on a grey wall, with a red stripe across it or without."""
    image = np.full((200, 300, 3), 90.0)
    v, u = np.mgrid[:100, :140]
    image[top - 10 : top + 110, left - 10 : left + 150] = 200.0
    image[top : top + 100, left : left + 140] = np.where((u // 20 + v // 20) % 2 == 0, 30.0, 200.0)[..., None]
    if lit:
        image += stripe(np.full(200, left + 67.0), 300, 1.5, 140.0)[..., None] * np.array([0.1, 0.1, 1.0])
    return noisy(image, rng)


@pytest.fixture
def folders(tmp_path) -> tuple[Path, Path]:
    """Three poses in two folders, named in different orders, and a picture of another size."""
    rng = np.random.default_rng(0)
    off, on = tmp_path / "off", tmp_path / "on"
    off.mkdir()
    on.mkdir()
    for k, (left, top) in enumerate(((20, 30), (80, 60), (130, 40))):
        cv2.imwrite(str(off / f"{k}.png"), board_at(left, top, False, rng))
        cv2.imwrite(str(on / f"{2 - k}.png"), board_at(left, top, True, rng))
    cv2.imwrite(str(off / "thumbnail.png"), board_at(20, 30, False, rng)[:150])
    return off, on


def test_partners_are_found_by_what_they_show_in_any_order_and_folder(folders):
    left_out: dict[str, str] = {}
    found = look_at_boards(folders, BOARD, left_out, Silent())
    assert len(found) == 6 and "most have (300, 200)" in left_out["thumbnail"]
    assert {name: path.relative_to(path.parents[1]).as_posix() for name, path in partners(found).items()} == {
        "off/0.png": "on/2.png",
        "off/1.png": "on/1.png",
        "off/2.png": "on/0.png",
    }


def test_a_name_that_tells_is_believed_and_unlit_photographs_have_no_partner(folders):
    off, on = folders
    assert partners(look_at_boards([on], BOARD, {}, Silent())) == {}
    (off / "1.laser.png").write_bytes((on / "1.png").read_bytes())
    assert partners(look_at_boards([off], BOARD, {}, Silent())) == {"1": off / "1.laser.png"}
    with pytest.raises(BadInput, match="inner corners"):
        look_at_boards([off], Board(9, 8, 0.02), {}, Silent())
