"""The independent check of paths: what stands in the way is told, near misses are not, and what is passed over was surely apart."""

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.check.contacts import near
from handey_studio.cell.check.path_check import _fixed, _moving, path_contacts
from handey_studio.cell.check.shapes import depth
from handey_studio.geometry import HeightField, box
from handey_studio.geometry.transforms import transform
from handey_studio.world import Block, Held, Part, World, arm_of, load_robot

ROBOT = load_robot("robots/ur5")
AHEAD = np.deg2rad([0.0, -110.0, 110.0, -90.0, -90.0, 0.0])
SWING = AHEAD + np.outer([-0.8, 0.8], np.eye(6)[0])


def world(*blocks: Block) -> World:
    return World(ROBOT, blocks=blocks)


def pole(gap: float) -> Block:
    """A pole that the hand's swing at the opening 0.04 passes at a gap [m] to the fingers' tips."""
    tip = arm_of(ROBOT).hand_pose(AHEAD)[:3, 3]
    return Block("pole", np.array([0.02, 0.02, tip[2] - gap]), transform(None, (tip[0], tip[1], (tip[2] - gap) / 2)))


def test_a_pole_just_below_the_fingers_is_passed_and_one_just_in_them_is_hit():
    assert path_contacts(world(pole(2e-4)), SWING, 0.02) == ()
    (hit, *_) = path_contacts(world(pole(-5e-4)), SWING, 0.02)
    assert "pole" in hit.bodies and hit.depth == pytest.approx(5e-4, abs=1e-6) and 0.4 < hit.time < 0.6


def test_what_is_held_and_the_arm_itself():
    held = Held("bar#1", Part("bar", box((0.02, 0.02, 0.1))), transform(None, (0, 0, 0.03)))
    assert any("bar#1" in contact.bodies for contact in path_contacts(world(pole(0.03)), SWING, 0.02, held))
    folded = np.array([AHEAD, [0.0, -1.9, 2.9, 0.4, -1.57, 0.0]])
    names = {name for contact in path_contacts(world(), folded, 0.02) for name in contact.bodies}
    assert names & {"upper_arm_link", "forearm_link"} and names & {"crosspiece", "finger_left", "wrist_2_link", "wrist_3_link", "mount"}


def test_instants_that_are_passed_over_are_apart():
    rng = np.random.default_rng(3)
    scene, q = world(pole(-0.05), Block("slab", np.array([0.4, 0.3, 0.02]), transform(None, (0.4, -0.2, 0.4)))), rng.uniform(-2, 2, (40, 6))
    arm, looked = _moving(scene, q, 0.02, None), 0
    for fixed in _fixed(scene, len(q)):
        for a in arm[3:]:
            for k in set(range(len(q))) - set(near(a, fixed).tolist()):
                assert depth(a.shape, a.poses[k], fixed.shape, fixed.poses[k]) <= 0
                looked += 1
    assert looked > 500


def test_a_depth_map_is_no_exact_body():
    seen = World(ROBOT, terrain=HeightField(np.zeros((4, 4)), 0.01, np.eye(4)))
    with pytest.raises(BadInput, match="depth map"):
        path_contacts(seen, SWING, 0.02)
