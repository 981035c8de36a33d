from itertools import islice, pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry import box, prism
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.grasping import (
    GOAL,
    START,
    GraspEnd,
    TableOptions,
    Transfer,
    grasp_placement_table,
    legal_at,
    sequences,
    tilts_at,
    why_none,
)
from handey_studio.grasping.regrasps import cheapest_sequences
from handey_studio.world import Library, Part, PlacedPart, World
from handey_studio.world.collision import collision_model

LIBRARY = Library.choose()
ROBOT = LIBRARY.robot("ur5")
HAND = ROBOT.hand
COARSE = TableOptions(steps=1)


@pytest.mark.parametrize("name", ["l_block", "brick"])
def test_cells_agree_with_the_collision_model(name):
    """Oracle: the part stands on the table in an empty world, and the open hand is put there."""
    part = LIBRARY.part(name)
    table = grasp_placement_table(part, HAND, COARSE)
    rng = np.random.default_rng(1)
    for row, T in enumerate(table.Ts_plane_part):
        T_world_part = from_xyz_rpy((0.5, 0.1, 0.0), (0.0, 0.0, 0.4)) @ T
        model = collision_model(World(ROBOT, parts=(PlacedPart(name, part, T_world_part),)))
        for column in rng.choice(len(table.angles), 40, replace=False):
            found = model.hand_contact(T_world_part @ table.Ts_part_hand[column], float(table.openings[column]))
            least = min(table.heights[row, column], table.gaps[column])
            assert np.isclose(max(found.distance, 0.0), max(least, 0.0), atol=1e-6)
            words, value, limit, _ = table.reason(row, int(column))
            assert bool(words) is not bool(table.legal[row, column])
            assert not words or value < limit


def test_grasps_at_an_end_are_those_that_the_hand_fits_at():
    part = LIBRARY.part("l_block")
    table = grasp_placement_table(part, HAND, COARSE)
    T_world_part = from_xyz_rpy((0.5, 0.1, 0.0)) @ table.Ts_plane_part[0]
    end = GraspEnd(World(ROBOT, parts=(PlacedPart("l_block", part, T_world_part),)), T_world_part)
    assert (legal_at(table, end, margin=table.options.least_height) == table.legal[0]).all()
    assert np.allclose(tilts_at(table, T_world_part), table.tilts[0])


def plain(visits, rows, start, goal, most):
    """Every sequence by brute force, with its cost: all placements, all grasps."""
    found = []
    for k in range(1, most + 1):
        for places in product(range(len(rows)), repeat=k):
            for grasps in product(range(len(start)), repeat=k + 1):
                if any(a == b for a, b in pairwise(grasps)) or any(a == b for a, b in pairwise(places)):
                    continue
                cost = start[grasps[0]] + goal[grasps[-1]] + sum(rows[p] for p in places)
                cost += sum(visits[p, a] + visits[p, b] for p, a, b in zip(places, grasps, grasps[1:], strict=False))
                if np.isfinite(cost):
                    route = (START, *places, GOAL)
                    found.append((cost, tuple(Transfer(route[i], grasps[i], route[i + 1]) for i in range(k + 1))))
    return sorted(found)


def random_costs(seed, rows, columns):
    rng = np.random.default_rng(seed)
    visits = np.where(rng.random((rows, columns)) < 0.5, rng.random((rows, columns)), np.inf)
    start, goal = (np.where(rng.random(columns) < 0.6, rng.random(columns), np.inf) for _ in range(2))
    return visits, 1.0 + rng.random(rows), start, goal


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 3), st.integers(1, 4))
def test_sequences_come_cheapest_first_and_none_is_missed(seed, rows, columns):
    costs = random_costs(seed, rows, columns)
    found = list(cheapest_sequences(*costs, fewest=1, most=2, ruled_out=lambda transfer: False))
    naive = plain(*costs, most=2)
    assert np.allclose([s.cost for s in found], [cost for cost, _ in naive])
    assert {s.transfers for s in found} == {transfers for _, transfers in naive}


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_what_failed_is_never_tried_again_and_all_else_is(seed):
    costs = random_costs(seed, 3, 4)
    failed: set[Transfer] = set()
    asked = []
    for sequence in cheapest_sequences(*costs, fewest=1, most=2, ruled_out=failed.__contains__):
        assert not failed & set(sequence.transfers)
        asked.append(sequence.transfers)
        failed.add(sequence.transfers[-1])
    left = [transfers for _, transfers in plain(*costs, most=2) if transfers not in asked]
    assert all(failed & set(transfers) for transfers in left)


def test_a_part_is_turned_over_by_one_regrasp():
    part = LIBRARY.part("brick")
    table = grasp_placement_table(part, HAND)
    down = [int(np.argmax(np.abs(T[2, :3]))) * np.sign(T[2, :3].sum()) for T in table.Ts_plane_part]
    flat, turned = (i for i, axis in enumerate(down) if axis in (2, -2))
    start, goal = (np.where(table.legal[row], table.tilts[row], np.inf) for row in (flat, turned))
    assert not (table.legal[flat] & table.legal[turned] & (table.tilts[flat] < 1.2)).any()
    first = next(sequences(table, start, goal))
    assert first.regrasps == 1 and why_none(table, start, goal) == ""
    for before, after in pairwise(first.transfers):
        assert before.target == after.source and before.column != after.column
        assert table.legal[before.target, before.column] and table.legal[before.target, after.column]
    assert len({s.transfers for s in islice(sequences(table, start, goal), 50)}) == 50


def test_why_there_is_no_sequence_is_told():
    table = grasp_placement_table(LIBRARY.part("brick"), HAND, COARSE)
    never, always = np.full(len(table.angles), np.inf), np.zeros(len(table.angles))
    assert why_none(table, never, always) == "none of the part's grasps is legal and in reach at the start"
    assert next(sequences(table, never, always), None) is None
    ball = Part("crate", box((0.2, 0.3, 0.25)))
    nothing = grasp_placement_table(ball, HAND, COARSE)
    assert nothing.legal.shape == (6, 0) and next(sequences(nothing, np.empty(0), np.empty(0)), None) is None
    needle = grasp_placement_table(Part("spike", prism([(0, 0), (0.004, 0), (0.002, 0.004)], 0.06)), HAND, COARSE)
    assert why_none(needle, np.empty(0), np.empty(0))
