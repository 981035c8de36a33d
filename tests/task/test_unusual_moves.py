"""Whole MOVEs of parts of others' shape and to places of all kinds: each is planned, and checked by hands that share nothing with the
planner, or refused with the right reason, its number and its limit."""

import numpy as np
import pytest

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.checker import check_plan
from handey_studio.geometry import HeightField, box
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.grasping import stable_placements, topples_by
from handey_studio.task import MoveCommand, MoveOptions, SearchOptions
from handey_studio.task.carrying import Start
from handey_studio.task.destination import format_pose
from handey_studio.task.move import plan_move
from handey_studio.world import Block, Library, Part, PlacedPart, World
from tests.grasping.test_classes import UNUSUAL, manifold, solid

LIBRARY = Library.choose()
ROBOT = LIBRARY.robot("ur5")
SHAPES = UNUSUAL | {
    "thin frame": solid(manifold((90, 90, 8)) - manifold((70, 70, 20))),  # it lies flat: 8 mm between table and top
    "bar": box((0.3, 0.02, 0.02)),
    "nut": box((0.012, 0.012, 0.012)),
    "cube": box((0.01, 0.01, 0.01)),
    "plate": box((0.1, 0.07, 0.003)),
    "needle": box((0.002, 0.002, 0.08)),
    "crate": box((0.15, 0.15, 0.15)),
}
PARTS = {name: Part(name, body) for name, body in SHAPES.items()} | {"l_block": LIBRARY.part("l_block"), "brick": LIBRARY.part("brick")}
HERE, THERE = (0.45, -0.2, 0.0), (0.4, 0.22, 0.0)
LYING = from_xyz_rpy((0.0, 0.0, 0.001), (0.0, np.pi / 2, 0.0))


def standing(name, up=None):
    """T_plane_part of a part's placement with that direction up, the steadiest one if None."""
    placements, _ = stable_placements(PARTS[name])
    found = [placement.T_plane_part for placement in placements if up in (None, placement.name)]
    return found[0] if found else LYING


def placed(name, at=HERE, yaw=0.3, up=None):
    return PlacedPart(f"{name}#1", PARTS[name], from_xyz_rpy(at, (0, 0, yaw)) @ standing(name, up))


def move(here, to, *others, blocks=(), terrain=None, effort=20.0):
    world = World(ROBOT, 0.0, blocks, (here, *others), terrain)
    start = Start(ROBOT.home, ROBOT.hand.opening_max, ROBOT.home)
    options = MoveOptions(search=SearchOptions(effort=effort))
    return plan_move(world, MoveCommand(here.name, to), PARTS, start, options)


def violations(result, here, bodies=()):
    table = SolidBody("table", box((4.0, 4.0, 0.1)), from_xyz_rpy((0.0, 0.0, -0.05)), fixed=True)
    body = SolidBody(here.name, here.part.solid, here.T_world_part)
    return check_plan(result.plan.steps, (table, body, *bodies), ROBOT, {here.name: here.name}).violations


@pytest.mark.parametrize(
    ("name", "up"),
    [("peg", None), ("bracket", None), ("tetromino S", None), ("frame", "+y up"),
     ("thin frame", None), ("bar", None), ("nut", None)],
)  # fmt: skip
def test_parts_of_others_shape_are_moved(name, up):
    here = placed(name)
    result = move(here, format_pose(placed(name, THERE, 0.3 + np.pi, up).T_world_part))
    assert result.status == "planned", result.reason
    assert not violations(result, here)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("crate", "the hand does not open that far (3 of 3 ways to take it), at best 150 mm, limit 86 mm"),
        ("cube", "the faces overlap too little (3 of 3 ways to take it), at best 100 mm², limit 120 mm²"),
        ("needle", "the fingers find too little contact behind this edge"),
        ("plate", "× the hand collides at every angle at the pickup (table"),
        ("pyramid", "× the hand collides at every angle at the pickup (table"),
    ],
)
def test_parts_that_the_hand_cannot_take_are_refused_with_the_reason(name, says):
    result = move(placed(name), format_pose(placed(name, THERE, 0.3).T_world_part))
    assert result.status == "failed" and says in result.reason, result.reason


@pytest.mark.parametrize(
    ("at", "turn", "says"),
    [
        ((0.4, 0.22, 0.1), 0.0, "nothing holds the part up at the destination: 100 mm, limit 10 mm"),
        ((0.4, 0.22, -0.02), 0.0, "the part would stand in something at the destination (l_block#1 and table): 20 mm"),
        ((0.3, 0.35, 0.0), 0.0, "the part would stand in something at the destination (l_block#1 and wall)"),
        ((0.24, 0.35, 0.2), 0.0, "the part would fall over at the destination: its centre of mass is not above what it stands on: 9 mm"),
        ((0.4, 0.22, 0.006), 0.2, "the part would fall over at the destination"),
        ((1.15, 0.3, 0.0), 0.0, "× the arm reaches no legal angle at the putdown"),
        ((3.0, 0.3, 0.0), 0.0, "the destination lies outside the free space"),
    ],
)
def test_places_where_nothing_can_stand_are_told_apart(at, turn, says):
    wall = Block("wall", np.array((0.1, 0.1, 0.2)), from_xyz_rpy((0.3, 0.35, 0.1)))
    to = from_xyz_rpy(at, (turn, 0.0, 0.3)) @ standing("l_block")
    result = move(placed("l_block"), format_pose(to), blocks=(wall,))
    assert result.status == "failed" and says in result.reason, result.reason


def test_a_part_under_another_is_not_pulled_from_below_it():
    here = placed("l_block")
    top = float(here.corners_world[:, 2].max())
    brick = placed("brick", (*here.corners_world.mean(axis=0)[:2], top))
    result = move(here, format_pose(placed("l_block", THERE).T_world_part), brick)
    assert "l_block#1 and brick#1" in result.reason and "limit 1.2 mm" in result.reason


def test_an_unmodelled_height_serves_for_a_regrasp_where_there_is_no_table():
    """All the table within reach is under a plateau that only the depth map knows; the part has to be turned over."""
    height = 0.03
    top = np.full((100, 100), height)
    top[40:60, 40:60] = 0.0  # where the robot stands
    plateau = HeightField(top, 0.02, from_xyz_rpy((-1.0, -1.0, 0.0)))
    here = placed("side plate", (*HERE[:2], height))
    there = placed("side plate", (*THERE[:2], height), 0.1, "−z up")
    result = move(here, format_pose(there.T_world_part), terrain=plateau)
    assert result.plan is not None and result.plan.regrasps == 1, result.reason
    between = PlacedPart(here.name, here.part, result.plan.carries[0].T_world_part_goal)
    assert between.corners_world[:, 2].min() == pytest.approx(height, abs=1e-6)
    sides = [((0, y, 0), (2.0, 0.8, height)) for y in (0.6, -0.6)] + [((x, 0, 0), (0.8, 0.4, height)) for x in (0.6, -0.6)]
    bodies = [SolidBody(f"side {k}", box(size), from_xyz_rpy((*at[:2], height / 2)), fixed=True) for k, (at, size) in enumerate(sides)]
    assert not violations(result, here, bodies)


@pytest.mark.parametrize("tilt", [0.0, 0.02, 0.15])
def test_what_stands_is_told_from_what_topples(tilt):
    """Oracle: a block on a table tilted by more than a little stands on an edge; one whose middle is beyond a shelf's edge topples."""
    shelf = Block("shelf", np.array((0.2, 0.2, 0.02)), from_xyz_rpy((0.5, 0.0, 0.01)))
    brick = PARTS["brick"]
    lifted = from_xyz_rpy((0.5, 0.0, 0.05), (0.0, tilt, 0.0))
    on_shelf = PlacedPart("brick#1", brick, lifted)
    assert (topples_by(World(ROBOT, 0.0, (shelf,)), on_shelf) > 0) == (tilt > 0.1)
    for x, falls in ((0.58, False), (0.595, False), (0.605, True), (0.62, True)):
        level = PlacedPart("brick#1", brick, from_xyz_rpy((x, 0.0, 0.035)))
        assert (topples_by(World(ROBOT, 0.0, (shelf,)), level) > 0) == falls
