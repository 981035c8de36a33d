"""A part in hand that cannot go straight up or straight down: into a shelf, out of it, and why not into a box (Handey 1987 §5.2)."""

import numpy as np
import pytest

from handey_studio.cell.bodies import SolidBody
from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, inverse
from handey_studio.session.leading import led_at
from handey_studio.session.replay import Replay
from handey_studio.task.destination import format_pose
from handey_studio.task.report import move_report
from handey_studio.world import Block, PlacedPart, arm_of
from tests.task.test_unusual_moves import PARTS, ROBOT, THERE, move, placed, standing, violations

DECK_M, CEILING_M = 0.10, 0.10


def shelf(sill=0.0):
    """A deck, and a board over it that reaches farther than the fingers; its mouth looks at the robot, with a sill or without."""
    boxes = {
        "deck": ((0.2, 0.24, 0.02), (0.55, 0.25, DECK_M - 0.01)),
        "board": ((0.2, 0.24, 0.02), (0.55, 0.25, DECK_M + CEILING_M + 0.01)),
    }
    if sill:
        walls = {"left": (0.55, 0.38), "right": (0.55, 0.12), "back": (0.66, 0.25)}
        boxes |= {name: ((0.02, 0.24, CEILING_M) if name == "back" else (0.2, 0.02, CEILING_M), (*at, DECK_M + CEILING_M / 2))
                  for name, at in walls.items()} | {"sill": ((0.02, 0.24, sill), (0.44, 0.25, DECK_M + sill / 2))}  # fmt: skip
    return tuple(Block(name, np.array(size), from_xyz_rpy(at)) for name, (size, at) in boxes.items())


def in_shelf(name):
    return PlacedPart(f"{name}#1", PARTS[name], from_xyz_rpy((0.53, 0.25, DECK_M)) @ standing(name))


def true_bodies(blocks):
    return [SolidBody(block.name, box(tuple(block.size)), block.T_world_block, fixed=True) for block in blocks]


@pytest.fixture(scope="module")
def into():
    here, blocks = placed("brick"), shelf(sill=0.03)
    return move(here, format_pose(in_shelf("brick").T_world_part), blocks=blocks), here, blocks


@pytest.fixture(scope="module")
def out():
    here, blocks = in_shelf("brick"), shelf()
    return move(here, format_pose(placed("brick", THERE).T_world_part), blocks=blocks), here, blocks


def test_a_part_is_led_into_a_shelf_and_the_last_bit_is_straight_down(into):
    """Under the board there is no way straight down; a checker that shares nothing with the planner finds nothing that touches."""
    result, here, blocks = into
    assert result.plan is not None, result.reason
    (carry,), steps = result.plan.carries, result.plan.steps
    assert carry.lowering is not None and carry.lowering.found_by == "plane search" and carry.lifting is None
    assert not violations(result, here, true_bodies(blocks))
    k = next(k for k, step in enumerate(steps) if step.kind == "place")
    assert [step.kind for step in steps[k - 2 : k]] == ["transfer", "transfer"]
    parts = arm_of(ROBOT).hand_pose(steps[k].q_rad) @ steps[k].T_hand_part
    assert np.abs(parts[:, :2, 3] - parts[-1, :2, 3]).max() < 1e-3 and (np.diff(parts[:, 2, 3]) < 1e-6).all()
    assert 0.005 < parts[0, 2, 3] - parts[-1, 2, 3] < CEILING_M
    assert all("deck" not in pair for step in steps[k - 2 : k] for pair in step.allowed_contacts), "what is led touches nothing on its way"
    assert any(entry.stage == "lowering" and entry.reason is None for entry in result.ledger)
    assert any(entry.stage == "straight motion" and "board" in entry.bodies for entry in result.ledger)


def test_a_part_is_led_out_of_a_shelf(out):
    result, here, blocks = out
    assert result.plan is not None, result.reason
    (carry,) = result.plan.carries
    assert carry.lifting is not None and carry.lifting.found_by in ("bump lines", "another start") and carry.lowering is None
    assert not violations(result, here, true_bodies(blocks))
    assert np.allclose(carry.lifting.plane.T_world_plane[:2, :3], (here.T_world_part @ carry.grasp.T_part_plane)[:2, :3])


@pytest.mark.parametrize("case", ["into", "out"])
def test_what_led_the_part_is_told_in_the_json_and_on_the_timeline(case, request):
    """The path in the plane is where the hand goes, by the arm's own kinematics."""
    result, *_ = request.getfixturevalue(case)
    told = move_report([result], ROBOT)["moves"][0]
    name, other = ("lowering", "lifting") if case == "into" else ("lifting", "lowering")
    led = told["carries"][0][name]
    assert told["carries"][0][other] is None and led["found_by"] and told["options"]["tried"] > 0
    replay, plan = Replay(ROBOT, result.plan), result.plan
    shown = {led_at(replay, t) for t in np.linspace(0.0, replay.duration, 60)} - {None}
    run = getattr(plan.carries[0], name)
    assert shown and all(one.run is run for one in shown) and len({one.at for one in shown}) > 3
    k = next(k for k, step in enumerate(plan.steps) if step.kind == ("place" if case == "into" else "lift"))
    step = plan.steps[k - 1 if case == "into" else k + 1]
    hands = inverse(np.array(led["T_world_plane"])) @ arm_of(ROBOT).hand_pose(step.q_rad)
    apart = [np.linalg.norm(hands[:, 1:3, 3] - point[:2], axis=1).min() for point in led["path"]]
    assert np.abs(hands[:, 0, 3]).max() < 1e-3 and max(apart) < 2e-3


def test_a_place_that_is_walled_in_is_refused_with_what_stood_in_the_way():
    """The same with a higher sill: between it and the board the hand with the part does not pass."""
    result = move(placed("brick"), format_pose(in_shelf("brick").T_world_part), blocks=shelf(sill=0.05), effort=5.0)
    assert result.plan is None and "board" in result.reason, result.reason


@pytest.mark.parametrize(("gap", "says"), [(0.001, "something lies or leans on the part where it is"), (0.004, "l_block#1 and beam")])
def test_what_lies_on_a_part_keeps_it_where_it_is(gap, says):
    """A part is not pulled from under what it may hold up, though there would be a way out aside."""
    here = placed("l_block")
    top = float(here.corners_world[:, 2].max())
    beam = Block("beam", np.array((0.05, 0.3, 0.02)), from_xyz_rpy((*here.corners_world.mean(axis=0)[:2], top + gap + 0.01)))
    result = move(here, format_pose(placed("l_block", THERE).T_world_part), blocks=(beam,))
    assert result.plan is None and says in result.reason and "limit 1.2 mm" in result.reason, result.reason
