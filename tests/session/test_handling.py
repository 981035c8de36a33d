"""What the hand can do with a part: ranked classes, the rows of a MOVE, the way of a plan through the grasp–placement table."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput, Ledger
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.grasping import GOAL, START, ForbiddenRange
from handey_studio.session import check_session, session_from_bytes, session_to_bytes
from handey_studio.session.handling import column_of, fates, handling, row_of, way_through
from tests.session.samples import T_START, full_session, library


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return full_session(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return library(tmp_path_factory.mktemp("library")).robot("ur5")


@pytest.fixture(scope="module")
def told(session, robot):
    return handling(session.part("l_block"), "l_block#1", robot, session.workcell, session.scene, session.result)


def test_without_a_move_the_rows_are_the_placements_and_the_part_lies_as_it_is_modelled(session, robot):
    alone = handling(session.part("l_block"), "l_block", robot, session.workcell, None, None)
    assert alone.rows == tuple(range(len(alone.table.Ts_plane_part))) and alone.start is None and not alone.putdowns
    np.testing.assert_array_equal(alone.T_world_part, np.eye(4))
    other = handling(session.part("brick"), "brick#1", robot, session.workcell, session.scene, session.result)
    assert START not in other.rows, "the MOVE was another part's"
    assert np.allclose(other.T_world_part[:3, 3], (0.42, -0.08, 0.0))


def test_classes_and_groups_are_ranked_by_cost_and_none_is_lost(told):
    ranked = told.ranked()
    best = [min(told.costs[told.groups_of(k)]) for k in ranked]
    assert best == sorted(best) and len(ranked) >= 3
    groups = [g for k in ranked for g in told.groups_of(k)]
    assert sorted(groups) == list(range(len(told.groups)))


def test_a_move_adds_its_ends_and_the_putdown_seen_from_the_pickup(session, told):
    assert (told.rows[0], told.rows[-1]) == (START, GOAL) and not (told.legal(START) & ~told.table.sound).any()
    pickup, putdown = session.result.plan.carries[0].approach.plane, told.putdowns[0]
    middles = [plane.origin + plane.cell * len(plane.fingers) / 2.0 for plane in (pickup, putdown)]
    np.testing.assert_allclose(*middles, atol=1e-9)


def test_a_plan_goes_through_the_table_by_its_grasps_and_placements(session, told):
    table, plan = told.table, session.result.plan
    between = table.Ts_plane_part[2]
    one, other = (replace(plan.carries[0].grasp, group=table.groups[g].name, angle=float(table.groups[g].angle) + 0.05) for g in (3, 9))
    turned = from_xyz_rpy((0.3, 0.1, 0.0), (0.0, 0.0, 1.1)) @ between
    carries = (
        replace(plan.carries[0], grasp=one, T_world_part_goal=turned),
        replace(plan.carries[0], grasp=other, T_world_part_start=turned),
    )
    way = way_through(table, replace(plan, carries=carries))
    assert [row for row, _ in way] == [START, 2, 2, GOAL]
    assert way[0][1] == way[1][1] and table.group_of[way[0][1]] == 3 and table.group_of[way[2][1]] == 9
    assert abs(table.angles[way[0][1]] - one.angle) < 0.06
    assert way_through(table, plan) == () and column_of(table, plan.carries[0].grasp) is None, "a grasp of another table"
    assert all(row_of(table, T) == row for row, T in enumerate(table.Ts_plane_part))


def test_a_group_that_stood_somewhere_stood():
    book = Ledger()
    book.add("grasp group", "a", "first")
    book.add("grasp group", "a, symmetry 2")
    book.add("grasp group", "b", "first")
    book.add("grasp group", "b, symmetry 1", "second")
    book.add("approach", "c", "no group")
    found = fates(book.entries)
    assert {name: entry.reason for name, entry in found.items()} == {"a": None, "b": "first"}


def test_forbidden_angles_are_kept_in_a_session(session):
    plan = session.result.plan
    ranges = (ForbiddenRange(0.2, 0.4, "putdown", "depth map"), ForbiddenRange(0.5, 0.6, "both", "", "contact"))
    carry = replace(plan.carries[0], grasp=replace(plan.carries[0].grasp, forbidden=ranges))
    kept = replace(session, results=(replace(session.result, plan=replace(plan, carries=(carry,))),))
    back = session_from_bytes(session_to_bytes(kept), "x")
    assert back.result.plan.carries[0].grasp.forbidden == ranges
    assert session_from_bytes(session_to_bytes(session), "x").result.plan.carries[0].grasp.forbidden == ()
    assert np.allclose(back.result.plan.T_world_part_start, T_START)


def test_a_forged_range_of_angles_is_refused(session):
    plan = session.result.plan
    for low, high in ((0.0, 1e9), (2.0, 1.0), (float("nan"), 1.0)):
        grasp = replace(plan.carries[0].grasp, forbidden=(ForbiddenRange(low, high, "both", "x"),))
        forged = replace(session.result, plan=replace(plan, carries=(replace(plan.carries[0], grasp=grasp),)))
        with pytest.raises(BadInput, match="rad"):
            check_session(replace(session, results=(forged,)))
