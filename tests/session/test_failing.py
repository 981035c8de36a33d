"""What a failure in the ledger looks like."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handey_studio.base import Ledger
from handey_studio.session.failing import NEAR_M, columns_meet
from handey_studio.session.ledger_tree import ROOT, children_of, path_to, sizes_below


@settings(max_examples=40)
@given(seed=st.integers(0, 10_000))
def test_columns_that_reach_into_a_body_are_those_with_a_point_in_it(seed):
    rng = np.random.default_rng(seed)
    R = Rotation.random(rng=rng).as_matrix()
    half = rng.uniform(0.01, 0.05, 3)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half @ R.T
    tops = rng.uniform(-0.06, 0.06, (40, 3))
    for top, meets in zip(tops, columns_meet(tops, corners), strict=True):
        points = np.c_[np.tile(top[:2], (4000, 1)), np.linspace(-0.2, top[2], 4000)] @ R
        off = (np.abs(points) - half).max(axis=1).min()  # how far the nearest of them lies outside one of the box's faces
        assert meets == (off <= NEAR_M) or abs(off - NEAR_M) < 1e-4


def test_the_tree_knows_what_is_below_what():
    book = Ledger()
    here, there = book.add("destination", "here"), book.add("destination", "there", "outside")
    group = book.add("grasp group", "edge", parent=here)
    book.add("approach", "hand", "stuck", parent=group)
    below = children_of(book.entries)
    assert [entry.id for entry in below[ROOT]] == [here, there] and [entry.id for entry in below[here]] == [group]
    assert sizes_below(book.entries) == {here: (2, 1), there: (0, 0), group: (1, 1), 3: (0, 0)}
    assert [entry.id for entry in path_to(book.entries, 3)] == [here, group, 3] and path_to(book.entries, ROOT) == ()
