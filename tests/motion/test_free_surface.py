"""The free regions as surfaces: closed, outward, and as large as the cells that they are around."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from handey_studio.motion import CSpaceSummary
from handey_studio.motion.free_surface import free_surfaces, shares


def summary(blocked: np.ndarray, path: np.ndarray, step: float = 0.1) -> CSpaceSummary:
    centres = tuple(-1.0 + step * (np.arange(n) + 0.5) for n in blocked.shape)
    return CSpaceSummary(step, centres, blocked, path, None, None, np.zeros((8, 3)), 3, 0)


NOWHERE = np.empty((0, 3), dtype=int)


@given(arrays(bool, array_shapes(min_dims=3, max_dims=3, max_side=5)))
def test_a_surface_is_closed_and_holds_the_free_cells(blocked):
    _, (corners, triangles) = free_surfaces(summary(blocked, NOWHERE))
    a, b, c = (corners[triangles[:, k]] * np.array(blocked.shape) for k in range(3))
    assert np.isclose(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0, (~blocked).sum())  # outward: the volume is positive
    assert np.allclose(np.cross(b - a, c - a).sum(axis=0), 0.0)  # closed: the areas' vectors cancel


def test_the_region_of_the_free_leg_is_told_from_the_others():
    blocked = np.zeros((9, 4, 4), dtype=bool)
    blocked[4] = True
    (mine, _), (others, _) = free_surfaces(summary(blocked, np.array([[0, 0, 0], [1, 1, 1]])))
    assert np.isclose(mine[:, 0].max(), 4 / 9) and np.isclose(others[:, 0].min(), 5 / 9)


def test_a_fine_space_is_shown_by_blocks_of_cells():
    blocked = np.ones((90, 40, 12), dtype=bool)
    blocked[:45] = False
    _, (corners, _) = free_surfaces(summary(blocked, NOWHERE), most=36)
    assert len(np.unique(corners[:, 0])) == 16 and np.isclose(corners[:, 0].max(), 0.5)  # 15 of 30 blocks


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_an_angle_a_turn_away_is_the_same_place(angle, other):
    space = summary(np.zeros((63, 63, 63), dtype=bool), NOWHERE)  # a turn is 62.8 cells
    q = np.array([angle, other, 0.0])
    here, there = shares(space, q), shares(space, q + 2 * np.pi * np.array([1.0, -2.0, 0.0]))
    apart = np.abs(here - there)
    assert ((apart < 1e-6) | (apart > 0.99)).all()
    assert ((here >= 0.0) & (here <= 1.0)).all()
