"""The independent check: it passes a clean plan and catches every kind of fault that is put into one."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.checker import check_plan, names_in_plan
from handey_studio.cell.check.shapes import Shape, body_shape, depth
from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.world import arm_of
from tests.cell.conftest import OPEN, over_l_block, raised

NAME = "l_block#2"
FINGERS = (("finger_left", NAME), ("finger_right", NAME))
SUPPORT = (("table", NAME), ("depth map", NAME))


@pytest.fixture
def plan(cell, arms):
    """Pick the hooked L from above, lift it and set it down again: free of collisions."""
    T_hand = over_l_block(cell.true_pose(NAME), (0.0147, 0.015, 0.02))
    above = arms.at(raised(T_hand, 0.12), cell.joints())
    down = arms.line(raised(T_hand, 0.12), T_hand, above)
    return [
        arms.step("free", [cell.joints(), above], OPEN),
        arms.step("approach", down, np.linspace(OPEN, 0.06, len(down))),
        arms.step("close", [down[-1]] * 2, (0.06, 0.04), allowed=FINGERS),
        arms.step("lift", down[::-1], 0.04, NAME, FINGERS + SUPPORT),
        arms.step("place", down, 0.04, NAME, FINGERS + SUPPORT),
        arms.step("open", [down[-1]] * 2, (0.04, OPEN), None, FINGERS),
        arms.step("retreat", down[::-1], OPEN, None, FINGERS),
    ]


@pytest.fixture
def called(cell):
    return names_in_plan(cell.true_scene(), {name: cell.true_pose(name) for name in ("l_block#1", "l_block#2")})


def reasons(report) -> set[str]:
    return {violation.reason for violation in report.violations}


def test_a_clean_plan_passes_at_a_fine_step(plan, cell, robot, called):
    report = check_plan(plan, cell.true_scene(), robot, called)
    assert report.ok, report.violations
    assert report.configurations > 1500


def test_a_body_in_the_way_is_told_by_name_step_and_time(plan, cell, arms, robot, called):
    q = 0.7 * plan[0].q_rad[0] + 0.3 * plan[0].q_rad[1]
    post = SolidBody("post", box((0.03, 0.03, 0.03)), transform(None, arm_of(robot).hand_pose(q)[:3, 3]))
    waiting = arms.step("free", plan[0].q_rad[[0, 0]], OPEN)
    report = check_plan([waiting, plan[0]], [*cell.true_scene(), post], robot, called)
    assert {violation.step for violation in report.violations} == {1}
    assert reasons(report) == {"bodies collide"}
    assert {body for violation in report.violations for body in violation.bodies} >= {"depth map", "finger_left"}
    assert all(0 < violation.time_s < plan[0].time_s[-1] and violation.value > 0.001 for violation in report.violations)


def test_a_thin_post_is_not_stepped_over(plan, cell, robot, called):
    tip = arm_of(robot).hand_pose(plan[0].q_rad.mean(axis=0))[:3, 3]
    wire = SolidBody("wire", box((0.001, 0.001, 0.2)), transform(None, tip - np.array([0.0, 0.0, 0.05])))
    assert not check_plan(plan[:1], [wire], robot).ok


def test_contacts_that_the_plan_does_not_allow_are_caught(plan, cell, robot, called):
    squeezed = replace(plan[2], hand_opening_m=np.array([0.06, 0.0398]), allowed_contacts=())
    report = check_plan([*plan[:2], squeezed], cell.true_scene(), robot, called)
    assert {frozenset(violation.bodies) for violation in report.violations} == {frozenset(pair) for pair in FINGERS}


@pytest.mark.parametrize("allowed", [True, False])
def test_a_part_pressed_half_a_millimetre_into_its_support(plan, cell, arms, robot, called, allowed):
    T_hand = arm_of(robot).hand_pose(plan[3].q_rad[0])
    lower = arms.step("place", arms.line(T_hand, raised(T_hand, -0.0005), plan[3].q_rad[0], 3), 0.04, NAME, FINGERS + SUPPORT * allowed)
    report = check_plan([*plan[:3], lower], cell.true_scene(), robot, called)
    assert report.ok == allowed
    if not allowed:
        told = {violation.bodies: violation.value for violation in report.violations}
        assert told[NAME, "table"] == pytest.approx(0.0005, abs=2e-5)


@pytest.mark.parametrize(("squeeze", "passes"), [(0.0016, True), (0.0024, False)])
def test_allowed_contacts_may_be_a_millimetre_deep(plan, cell, robot, called, squeeze, passes):
    """Each finger sinks in by half of the squeeze."""
    close = replace(plan[2], hand_opening_m=np.array([0.06, 0.04 - squeeze]))
    report = check_plan([*plan[:2], close], cell.true_scene(), robot, called)
    assert report.ok == passes
    for violation in report.violations:
        assert violation.value == pytest.approx(squeeze / 2, abs=1e-5) and violation.limit == 0.001


def test_the_held_body_collides_too(plan, cell, robot, called):
    """Something over the far end of the foot, where the lifted part passes and the hand does not."""
    T = cell.true_pose(NAME)
    over = T[:3, 3] + T[:3, :3] @ (0.055, 0.0147, 0.02) + (0.0, 0.0, 0.06)
    report = check_plan(plan[:4], [*cell.true_scene(), SolidBody("crumb", box((0.01, 0.01, 0.01)), transform(None, over))], robot, called)
    assert {frozenset(violation.bodies) for violation in report.violations if violation.step == 3} == {frozenset((NAME, "depth map"))}


def test_a_body_put_down_stays_where_the_hand_let_go_of_it(plan, cell, arms, robot, called):
    """The fingers close freely once they are above it, and hit it when they come down again."""
    shut = arms.step("free", plan[6].q_rad[[-1, -1]], (OPEN, 0.02))
    again = replace(plan[1], hand_opening_m=np.full(len(plan[1].q_rad), 0.02))
    report = check_plan([*plan, shut, again], cell.true_scene(), robot, called)
    assert {violation.step for violation in report.violations} == {8}
    assert {body for violation in report.violations for body in violation.bodies} >= {NAME, "finger_left", "finger_right"}


def test_limits_speed_and_seams(plan, cell, robot, called):
    scene = cell.true_scene()
    beyond = replace(plan[0], q_rad=np.array([plan[0].q_rad[0], plan[0].q_rad[1] + (20, 0, 0, 0, 0, 0)]), time_s=np.array([0.0, 100.0]))
    assert "beyond a joint limit" in reasons(check_plan([beyond], [], robot))
    fast = replace(plan[0], time_s=plan[0].time_s / 2)
    assert reasons(check_plan([fast], scene, robot, called)) == {"a joint is faster than its limit (as a share of it)"}
    backwards = replace(plan[0], time_s=plan[0].time_s[::-1])
    assert "time runs backwards" in reasons(check_plan([backwards], scene, robot, called))
    assert reasons(check_plan([plan[0], plan[6]], scene, robot, called)) >= {"the arm jumps between steps"}
    wide = replace(plan[1], hand_opening_m=plan[1].hand_opening_m - 0.01)
    assert "the fingers jump between steps" in reasons(check_plan([plan[0], wide], scene, robot, called))
    agape = replace(plan[0], hand_opening_m=np.array([OPEN, 0.12]))
    assert "beyond the hand's opening" in reasons(check_plan([agape], scene, robot, called))


def test_the_arm_may_not_hit_itself(robot):
    folded = np.array(robot.home)
    folded[1], folded[2] = np.deg2rad(-90), np.deg2rad(170)
    still = type("Still", (), {})()
    still.kind, still.q_rad, still.time_s = "free", np.array([folded, folded]), np.array([0.0, 1.0])
    still.hand_opening_m, still.held, still.allowed_contacts = np.array([OPEN, OPEN]), None, ()
    report = check_plan([still], [], robot)
    assert reasons(report) == {"bodies collide"}
    still.q_rad = np.array([robot.home, robot.home])
    assert check_plan([still], [], robot).ok


def test_what_is_wholly_inside_a_mesh_is_not_overlooked():
    """Meshes are hollow to a triangle tree; a link is such a mesh."""
    solid = box((0.4, 0.4, 0.4))
    mesh = Shape("link", solid.vertices, solid.triangles)
    crumb = body_shape("crumb", SolidBody("crumb", box((0.004, 0.004, 0.004)), np.eye(4)))
    room = body_shape("room", SolidBody("room", box((3, 3, 3)), np.eye(4)))
    assert depth(mesh, np.eye(4), room, np.eye(4)) > 0 and depth(room, np.eye(4), mesh, np.eye(4)) > 0
    assert depth(mesh, np.eye(4), crumb, transform(None, (0.1, 0, 0))) > 0
    assert depth(mesh, np.eye(4), crumb, transform(None, (0.2, 0, 0))) > 0
    assert depth(mesh, np.eye(4), crumb, transform(None, (0.203, 0, 0))) == 0


def test_the_arms_own_meshes_hold_water(robot):
    """The winding number needs closed meshes: far out it is zero, and no link holds a point beyond its bounds."""
    for link in arm_of(robot).bodies:
        shape = Shape(link.name, link.vertices, link.triangles)
        inside = np.random.default_rng(0).uniform(*shape.bounds, (400, 3))
        share = np.mean([shape.holds(point) for point in inside])
        assert 0.1 < share < 1.0, link.name
        assert not shape.holds(shape.bounds[1] + 0.01)


def test_winding_numbers_tell_inside_from_outside(library):
    solid = library.part("l_block").solid
    shape = Shape("ell", solid.vertices, solid.triangles)
    assert shape.holds(np.array([0.01, 0.05, 0.02])) and shape.holds(np.array([0.05, 0.01, 0.02]))
    assert not shape.holds(np.array([0.05, 0.05, 0.02])) and not shape.holds(np.array([0.01, 0.08, 0.02]))


def test_names_follow_the_nearest_located_pose(cell):
    swapped = {"l_block#1": cell.true_pose("l_block#2"), "l_block#2": from_xyz_rpy((0.001, 0, 0)) @ cell.true_pose("l_block#1")}
    assert names_in_plan(cell.true_scene(), swapped) == {"l_block#2": "l_block#1", "l_block#1": "l_block#2"}
    assert names_in_plan(cell.true_scene(), {"l_block#1": np.eye(4)}) == {}


def test_a_plan_that_holds_what_is_not_there_is_refused(plan, cell, robot):
    with pytest.raises(BadInput, match="none of the true bodies"):
        check_plan(plan, cell.true_scene(), robot, {})
