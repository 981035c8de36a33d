"""Paths and their certificates, rechecked by another engine at a fine step."""

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.geometry import box
from handey_studio.geometry.transforms import transform
from handey_studio.motion import (
    PathOptions,
    certify,
    distance_field,
    forbidden_ranges,
    marching,
    plan_path,
    proof,
    regions,
    search,
    self_collision,
    straight_path,
    three_legs,
    warm_up,
    wrist_box,
)
from handey_studio.world import Block, Held, Part, World, arm_of, collision_queries, gjk
from handey_studio.world.collision import collision_model
from tests.motion.oracle import DOWN, ROBOT, Judge, reach, scene

BRICK = Part("brick", box([0.04, 0.06, 0.05]))
BIG = Held("plank#1", Part("plank", box([0.03, 0.20, 0.03])), np.eye(4))


def at(T: np.ndarray, near: np.ndarray = ROBOT.home) -> np.ndarray:
    """The configuration nearest to another that puts the hand at a pose, without the arm meeting the bare table where that can be."""
    branches = arm_of(ROBOT).nearest_turns(arm_of(ROBOT).ik(T), near)
    bare = collision_model(World(ROBOT))
    branches = np.array([q for q in branches if bare.in_contact(q, 0.0) is None] or branches)
    return branches[int(np.argmin(np.abs(branches - near).max(axis=1)))]


@pytest.mark.parametrize("seed", range(3))
def test_found_paths_hold_under_another_engine(seed):
    world, rng = scene(seed), np.random.default_rng(seed)
    model, judge = collision_model(world), Judge(world, 0.05)
    start, goal = reach(model, rng), reach(model, rng)
    found = plan_path(world, start, goal, 0.05)
    assert found.found, found.reason
    assert (found.q_rad[0] == start).all() and (found.q_rad[-1] == goal).all()
    assert (ROBOT.limit_margin(found.q_rad) >= 0).all()
    assert found.certificate.proved and found.certificate.least_clearance >= found.certificate.margin == 0.001
    assert judge.first_meeting(found.q_rad) is None
    assert found.legs[0].first == 0 and found.legs[-1].last == len(found.q_rad) - 1


def test_a_held_plank_is_carried_over_a_wall():
    wall = Block("wall", [0.5, 0.03, 0.25], transform(None, [0.5, 0.0, 0.125]))
    world = World(ROBOT, blocks=(wall,))
    start = at(transform(DOWN[:3, :3], [0.45, -0.3, 0.1]))
    goal = at(transform(DOWN[:3, :3], [0.45, 0.3, 0.1]), start)
    assert not certify(world, [start, goal], 0.03, BIG).proved
    found = plan_path(world, start, goal, 0.03, BIG)
    assert found.found and len(found.q_rad) > 2
    assert Judge(world, 0.03, BIG).first_meeting(found.q_rad) is None
    assert found.space.blocked.any() and len(found.space.path_cells) > 1


def test_same_question_same_answer():
    world = scene(5)
    rng = np.random.default_rng(5)
    start, goal = reach(collision_model(world), rng), reach(collision_model(world), rng)
    one, other = (plan_path(world, start, goal, 0.05, rng=np.random.default_rng(7)) for _ in range(2))
    assert one.q_rad.tobytes() == other.q_rad.tobytes() and one.certificate == other.certificate


def test_ends_without_hope_are_told_at_once():
    world = World(ROBOT, blocks=(Block("rock", [0.1, 0.1, 0.2], transform(None, [0.5, 0.0, 0.1])),))
    inside = at(transform(DOWN[:3, :3], [0.5, 0.0, 0.1]))
    found = plan_path(world, ROBOT.home, inside, 0.05)
    assert found.status == "none" and "goal" in found.reason and "rock" in found.reason and "mm" in found.reason
    assert found.entries[0].bodies and found.entries[0].value < 0
    beyond = ROBOT.home.copy()
    beyond[2] = ROBOT.upper[2] + 0.1
    told = plan_path(world, beyond, ROBOT.home, 0.05)
    assert told.status == "none" and "elbow_joint" in told.reason and "5.7°" in told.reason
    with pytest.raises(BadInput, match="finite"):
        plan_path(world, np.full(6, np.nan), ROBOT.home, 0.05)


def test_a_goal_in_a_closed_box_has_no_path():
    walls = [
        Block(f"wall {k}", size, transform(None, centre))
        for k, (size, centre) in enumerate(
            [([0.02, 0.6, 1.6], [0.28, 0.0, 0.8]), ([1.6, 0.02, 1.6], [0.0, 0.3, 0.8]), ([1.6, 0.02, 1.6], [0.0, -0.3, 0.8])]
        )
    ]
    world = World(ROBOT, blocks=(*walls, Block("back", [0.02, 0.6, 1.6], transform(None, [-0.28, 0.0, 0.8]))))
    folded = next(
        q
        for q in np.random.default_rng(0).uniform([-3, -2.2, -2.8, -3, -3, -3], [3, -0.9, 2.8, 3, 3, 3], (20000, 6))
        if collision_model(world).in_contact(q, 0.0, margin=0.002) is None
    )
    goal = at(transform(DOWN[:3, :3], [0.6, 0.0, 0.2]))
    found = plan_path(World(ROBOT, blocks=()), folded, goal, 0.0, options=PathOptions(steps_deg=(5.0,)))
    assert found.found
    blocked = plan_path(world, folded, folded + np.array([0, 0, 0, 0, 0, 1e-3]), 0.0, options=PathOptions(steps_deg=(5.0,)))
    assert blocked.found
    shut = plan_path(world, folded, goal, 0.0, options=PathOptions(steps_deg=(5.0,), tree_growths=40))
    assert shut.status == "none" and shut.reason and shut.entries


def test_a_part_is_lifted_off_what_it_stands_on():
    """At the start the brick touches the table: that pair may touch while the arm leaves, and nowhere else."""
    world = World(ROBOT)
    held = Held("brick#1", BRICK, transform(None, [0.0, 0.0, -0.015]))
    start = at(transform(DOWN[:3, :3], [0.45, 0.1, 0.0098]))
    goal = at(transform(DOWN[:3, :3], [0.3, -0.35, 0.2]), start)
    assert plan_path(world, start, goal, 0.04, held).status == "none"
    found = plan_path(world, start, goal, 0.04, held, allowed_start=[("brick#1", "table")])
    assert found.found and ("brick#1", "table") in found.certificate.pairs_allowed
    lowest = [BRICK.lowest(arm_of(ROBOT).hand_pose(q) @ held.T_hand_part) for q in found.q_rad]
    assert lowest[0] < 0 < min(lowest[1:])


def test_an_end_that_is_close_lends_its_own_margin():
    start = at(transform(DOWN[:3, :3], [0.45, 0.1, 0.0006]))
    found = plan_path(World(ROBOT), start, ROBOT.home, 0.05)
    assert found.found and found.certificate.margin == pytest.approx(0.0003, abs=1e-6)
    assert found.certificate.least_clearance == pytest.approx(0.0006, abs=1e-6)


class Impatient:
    """Cancels at once."""

    cancelled = True

    def report(self, fraction, message):
        pass


def test_cancel_brings_back_the_record():
    walled = World(ROBOT, blocks=(Block("wall", [0.5, 0.03, 1.2], transform(None, [0.5, 0.0, 0.6])),))
    start, goal = at(transform(DOWN[:3, :3], [0.45, -0.3, 0.1])), at(transform(DOWN[:3, :3], [0.45, 0.3, 0.1]))
    found = plan_path(walled, start, goal, 0.05, progress=Impatient(), options=PathOptions(repairs=0))
    assert found.cancelled and found.status == "none" and len(found.entries) == 1


def test_certificate_against_fine_steps():
    world, rng = scene(6), np.random.default_rng(11)
    model, judge = collision_model(world), Judge(world, 0.05)
    proved = 0
    for _ in range(12):
        q = reach(model, rng)
        path = np.array([q, q + rng.uniform(-0.5, 0.5, 6)])
        certificate = certify(world, path, 0.05)
        here = path[0] + (certificate.at[0] + certificate.at[1]) * (path[1] - path[0])
        assert model.clearance(here, 0.05).distance == pytest.approx(max(certificate.least_clearance, 0.0), abs=1e-6) or (
            certificate.least_clearance <= 0
        )
        meeting = judge.first_meeting(path)
        if certificate.proved:
            proved += 1
            assert meeting is None
            samples = [model.clearance(path[0] + t * (path[1] - path[0]), 0.05).distance for t in np.linspace(0, 1, 200)]
            assert min(samples) >= certificate.margin
        else:
            assert model.clearance(here, 0.05).distance <= certificate.margin + 1e-9
            assert certificate.reason and len(certificate.bodies) == 2
    assert 2 <= proved <= 11


def test_a_thin_obstacle_between_two_samples_is_found():
    """A sheet of a tenth of a millimetre, crossed by one long segment."""
    sheet = Block("sheet", [0.4, 0.0001, 0.4], transform(None, [0.45, 0.0, 0.2]))
    world = World(ROBOT, blocks=(sheet,))
    start, goal = at(transform(DOWN[:3, :3], [0.45, -0.3, 0.1])), at(transform(DOWN[:3, :3], [0.45, 0.3, 0.1]))
    certificate = certify(world, [start, goal], 0.05)
    assert not certificate.proved and "sheet" in certificate.bodies and 0.0 < certificate.at[1] < 1.0


def test_opening_fingers_are_part_of_the_motion():
    beside = Block("beside", [0.02, 0.1, 0.14], transform(None, [0.45 + 0.051, 0.0, 0.07]))
    world = World(ROBOT, blocks=(beside,))
    q = at(transform(DOWN[:3, :3], [0.45, 0.0, 0.1]))
    assert certify(world, [q, q], [0.0, 0.06]).proved
    opened = certify(world, [q, q], [0.0, 0.08])
    assert not opened.proved and "beside" in opened.bodies and set(opened.bodies) & {"finger_left", "finger_right"}


def test_a_pair_that_may_touch_may_not_sink_in():
    world = World(ROBOT)
    held = Held("brick#1", BRICK, transform(None, [0.0, 0.0, -0.015]))
    poses = [at(transform(DOWN[:3, :3], [0.45, 0.1, z])) for z in (0.02, 0.0095, 0.005)]
    pairs = [("brick#1", "table")]
    assert certify(world, poses[:2], 0.04, held, pairs).proved
    assert not certify(world, poses[:2], 0.04, held).proved
    sunk = certify(world, poses, 0.04, held, pairs)
    assert not sunk.proved and sunk.bodies == ("brick#1", "table") and sunk.at[0] == 1 and sunk.least_clearance < -0.002


def test_straight_motion():
    world, arm = World(ROBOT), arm_of(ROBOT)
    hands = np.repeat(transform(DOWN[:3, :3], [0.45, 0.1, 0.2])[None], 30, axis=0)
    hands[:, 2, 3] -= np.linspace(0.0, 0.18, 30)
    start = at(hands[0])
    found = straight_path(world, start, hands, 0.05)
    assert found.found and len(found.q_rad) == 30 and found.certificate.proved
    assert np.abs(arm.hand_pose(found.q_rad) - hands).max() < 1e-6
    middle = arm.hand_pose((found.q_rad[:-1] + found.q_rad[1:]) / 2)
    assert np.abs(middle[:, :2, 3] - hands[0, :2, 3]).max() < 1e-4
    hands[:, 2, 3] -= np.linspace(0.0, 0.05, 30)
    struck = straight_path(world, start, hands, 0.05)
    assert struck.status == "none" and "table" in struck.reason and struck.entries[-1].bodies
    far = hands.copy()
    far[:, 0, 3] += np.linspace(0.0, 0.9, 30)
    assert "out of reach" in straight_path(world, start, far, 0.05).reason or "jump" in straight_path(world, start, far, 0.05).reason
    with pytest.raises(BadInput):
        straight_path(world, start, np.zeros((0, 4, 4)), 0.05)


def test_warmed_up_nothing_is_left_to_compile():
    warm_up(ROBOT)
    compiled = _signatures()
    rng = np.random.default_rng(0)
    model = collision_model(scene(0))
    held = Held("brick#1", BRICK, transform(None, [0.0, 0.0, 0.01]))
    model.clearance(ROBOT.home, 0.04, held, [("brick#1", "table")])
    found = plan_path(scene(0), reach(model, rng), ROBOT.home, 0.05)
    certify(scene(0), found.q_rad, 0.05)
    straight_path(scene(0), ROBOT.home, arm_of(ROBOT).hand_pose(ROBOT.home)[None], 0.05)
    assert _signatures() == compiled and len(compiled) > 20


def _signatures() -> dict[str, int]:
    """Compiled versions of each function of collision and motion."""
    planning = (proof, marching, forbidden_ranges, distance_field, search, regions, self_collision, three_legs, wrist_box)
    modules = (gjk, collision_queries, *planning)
    functions = [(m.__name__, f) for m in modules for f in vars(m).values() if hasattr(f, "signatures") and f.__module__ == m.__name__]
    return {f"{name}.{f.__name__}": len(f.signatures) for name, f in functions}
