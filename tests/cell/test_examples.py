"""The Figure 1 workcell stands as it is drawn, and its task can be done in principle."""

from itertools import combinations

import numpy as np

from handey_studio.cell.bodies import fixed_bodies, solid_body
from handey_studio.cell.check.checker import check_plan, names_in_plan
from handey_studio.cell.examples import figure1
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.scenes.fitness import graspable, visible_share
from handey_studio.cell.stripes import Surfaces
from handey_studio.geometry.transforms import apply, inverse, pose_difference
from handey_studio.world import arm_of
from tests.cell.conftest import AHEAD, OPEN, over_l_block, raised
from tests.cell.overlaps import body_overlap


def bodies_of(library):
    workcell = figure1()
    return workcell, [*fixed_bodies(workcell), *(solid_body(body, library.part) for body in workcell.setup.bodies)]


def test_everything_stands_as_it_is_drawn(library):
    _, bodies = bodies_of(library)
    settled = settle(bodies)
    assert settled.resting
    for before, after in zip(bodies, settled.bodies, strict=True):
        moved, turned = pose_difference(before.T_world_body, after.T_world_body)
        assert moved < 1e-4 and turned < 1e-3, before.name
    for a, b in combinations(bodies, 2):
        assert body_overlap(a, b) < 5e-5, (a.name, b.name)


def test_both_ls_are_in_view_and_the_hand_fits_over_them(library, robot):
    workcell, bodies = bodies_of(library)
    for name in ("l_block#1", "l_block#2"):
        target = next(body for body in bodies if body.name == name)
        inside = apply(inverse(workcell.finder.T_world_range), target.corners_world)[:, :2]
        assert (inside > 0.02).all() and (inside < np.array(workcell.finder.area) - 0.02).all()
        assert visible_share(workcell.finder, bodies, target) > 0.95
        assert graspable(robot.hand, target, bodies)
    assert sum(body.part is None for body in workcell.setup.bodies) >= 4


def test_the_two_ls_make_a_block_that_stands(library, robot):
    _, bodies = bodies_of(library)
    by_name = {body.name: body for body in bodies}
    mate = library.part("l_block").mates["block"]
    goal = by_name["l_block#2"].at(by_name["l_block#1"].T_world_body @ mate.T_this_part)
    others = [body for body in bodies if body.name != "l_block#2"]
    assert max(body_overlap(goal, other) for other in others) < 1e-5
    stood = settle([*others, goal])
    moved, turned = pose_difference(stood.bodies[-1].T_world_body, goal.T_world_body)
    assert stood.resting and moved < 1e-3 and turned < 0.02
    assert np.linalg.norm(goal.T_world_body[:3, 3] - arm_of(robot).link_poses(robot.home)[1, :3, 3]) < 0.8


def test_the_task_can_be_done(library, arms, robot, cell):
    """By the truth alone: a grip from above, a straight joint line across and a guarded descent end in the mating pose."""
    name = "l_block#2"
    start, base = cell.true_pose(name), cell.true_pose("l_block#1")
    goal = base @ library.part("l_block").mates["block"].T_this_part
    T_pick = over_l_block(start, (0.0147, 0.015, 0.02))
    T_put = goal @ inverse(start) @ T_pick
    down = arms.line(raised(T_pick, 0.12), T_pick, arms.at(raised(T_pick, 0.12), AHEAD))
    place = arms.line(raised(T_put, 0.10), T_put, arms.at(raised(T_put, 0.10), down[0]))
    fingers = (("finger_left", name), ("finger_right", name))
    steps = [
        arms.step("free", [AHEAD, down[0]], OPEN),
        arms.step("approach", down, np.linspace(OPEN, 0.06, len(down))),
        arms.step("close", [down[-1]] * 2, (0.06, 0.04), allowed=fingers),
        arms.step("lift", down[::-1], 0.04, name, (*fingers, (name, "table"), (name, "depth map"))),
        arms.step("transfer", [down[0], place[0]], 0.04, name, fingers),
        arms.step("place", place, 0.04, name, (*fingers, (name, "l_block#1"))),
    ]
    called = names_in_plan(cell.true_scene(), {name: start, "l_block#1": base})
    report = check_plan(steps, cell.true_scene(), robot, called)
    assert report.ok, report.violations

    for step in steps[:2]:
        cell.follow(step.motion)
    cell.grip(0.0375)
    cell.follow(steps[3].motion)
    cell.follow(steps[4].motion)
    below = arms.line(raised(T_put, 0.10), raised(T_put, -0.005), place[0], 40)
    assert cell.descend(arms.step("place", below, 0.04).motion).contact
    cell.grip(robot.hand.opening_max)
    moved, turned = pose_difference(cell.true_pose(name), goal)
    assert moved < 2e-4 and turned < 2e-3


def test_the_hooked_l_would_stand_out_if_it_were_turned_half_a_turn(library):
    """Turned by half a turn about its foot's normal, its leg would fill space that the scan sees to be empty."""
    workcell, bodies = bodies_of(library)
    hooked = next(body for body in bodies if body.name == "l_block#2")
    turned = np.diag([-1.0, 1.0, -1.0, 1.0])
    turned[:3, 3] = (0.06, 0.0, 0.04)
    shown = [visible_cells(workcell, [*bodies[:1], hooked.at(T)]) for T in (hooked.T_world_body, hooked.T_world_body @ turned)]
    assert (shown[1] - shown[0] > 0.005).sum() > 300


def visible_cells(workcell, bodies) -> np.ndarray:
    """Heights of the first surfaces straight below a grid of points, by the laser's own beams."""
    x, y = np.meshgrid(np.arange(0, 0.4, 0.001), np.arange(0, 0.4, 0.001))
    beams = np.stack([x, y, np.zeros(x.shape)], axis=-1).reshape(-1, 3) - workcell.finder.laser
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    return Surfaces(bodies, inverse(workcell.finder.T_world_range)).first(workcell.finder.laser, beams).points[:, 2]
