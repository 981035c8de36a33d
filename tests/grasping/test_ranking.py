"""What groups are ranked by, which branches of the arm serve them, and the outlines of what is in their way."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse
from handey_studio.grasping import (
    GraspEnd,
    RankTerms,
    grasp_groups,
    hand_in_plane,
    legal_rotations,
    plane_outlines,
    rank_terms,
    within_reach,
)
from handey_studio.grasping.reach import LEAST_MARGIN_RAD
from handey_studio.world import Block, Library, PlacedPart, World, arm_of
from handey_studio.world.collision import collision_model

LIBRARY = Library.choose()
ROBOT = LIBRARY.robot("ur5")
HAND = ROBOT.hand
PART = LIBRARY.part("l_block")
T = from_xyz_rpy((0.45, 0.0, 0.0))


def end(T_world_part, *blocks, terrain=None, robot=ROBOT):
    return GraspEnd(World(robot, blocks=blocks, terrain=terrain, parts=(PlacedPart("it", PART, T_world_part),)), T_world_part)


def legal_groups(*ends):
    found = [(group, legal_rotations(group, *ends)) for group in grasp_groups(PART, HAND)[0]]
    return [(group, rotations) for group, rotations in found if rotations.legal]


def test_terms_are_measured_where_the_hand_will_be():
    here, there = end(T), end(from_xyz_rpy((0.4, 0.25, 0.0), (0, 0, 1.0)))
    for group, rotations in legal_groups(here, there)[::7]:
        terms = rank_terms(group, here, there, rotations)
        (angle,) = rotations.best(1)
        poses = [e.hand_pose(group, angle) for e in (here, there)]
        assert np.isclose(terms.tilt, sum(np.arccos(np.clip(-pose[2, 2], -1, 1)) for pose in poses))
        opening = group.opening(HAND)
        free = min(collision_model(e.world).hand_contact(pose, opening).distance for e, pose in zip((here, there), poses, strict=True))
        assert terms.clearance is not None and np.isclose(terms.clearance, min(free, terms.clearance)) and terms.clearance >= 0.001
        assert terms.contact >= 1 and terms.off_centre >= 0
        alone = rank_terms(group, here, there)
        assert alone.tilt <= terms.tilt + 0.02 and alone.clearance is None and alone.cost <= terms.cost + 0.02


def test_upright_fingers_count_first_then_clearance_then_contact_then_joint_margin():
    upright = RankTerms(0.0, 0.0, 1.0, 0.001, 0.0)
    tilted = RankTerms(0.3, 0.0, 4.0, 0.010, 1.0)
    assert upright.key < tilted.key and upright.cost < tilted.cost
    best = RankTerms(0.0, 0.0, 4.0, 0.010, 1.0)
    worse = [
        replace(best, joint_margin=0.1),
        replace(best, contact=1.0),
        replace(best, clearance=0.001),
        replace(best, off_centre=0.05),
        tilted,
    ]
    ranked = sorted([*worse, best], key=lambda terms: terms.key)
    assert ranked == [best, *worse]
    assert best.cost == min(terms.cost for terms in ranked) == 0.0
    assert list(best.costs) == ["tilt", "off centre", "clearance", "contact", "joint margin"]


@pytest.mark.parametrize("x", [0.5, 0.78, 0.83, 0.9])
def test_angles_out_of_reach_are_forbidden_at_their_end(x):
    """Oracle: inverse kinematics at angles all over the legal ranges."""
    near, far, arm = end(T), end(from_xyz_rpy((x, 0.0, 0.0))), arm_of(ROBOT)

    def reached(group, angle, at):
        return any(
            all((ROBOT.limit_margin(_branches(arm, e.hand_pose(group, angle, s))) >= LEAST_MARGIN_RAD).any() for e in at) for s in (1, -1)
        )

    for group, rotations in legal_groups(near, far)[::6]:
        angles, left = within_reach(rotations, near, far, 4)
        assert all(reached(group, angle, (near, far)) for angle in angles) and bool(angles) == left.legal
        if not angles:
            fault = left.fault()
            assert fault is not None and fault.reason == "the arm reaches no legal angle at the putdown" and x > 0.75
            sampled = [a for low, high in rotations.ranges() for a in np.linspace(low, high, 2 + int((high - low) / 0.05))]
            assert sum(reached(group, angle, (far,)) for angle in sampled) <= 0.2 * len(sampled)


def _branches(arm, T_world_hand):
    return arm.nearest_turns(arm.ik(T_world_hand), ROBOT.home).reshape(-1, len(ROBOT.home))


def test_outlines_are_what_the_hand_meets():
    """Oracle: points of a wall and of columns that lie in a finger's slab lie in the outlines, the putdown's carried back with the part."""
    rng = np.random.default_rng(0)
    wall = Block("wall", np.array((0.16, 0.16, 0.10)), from_xyz_rpy((0.47, 0.06, 0.05)))
    top = np.zeros((200, 200))
    top[70:130, 60:100] = 0.04
    field = HeightField(top, 0.002, from_xyz_rpy((0.25, 0.05, 0.0)))
    here, there = end(T, wall), end(from_xyz_rpy((0.4, 0.25, 0.0), (0, 0, 1.0)), terrain=field)
    in_wall = apply(wall.T_world_block, rng.uniform(-0.5, 0.5, (4000, 3)) * wall.size)
    in_columns = apply(field.T_world_range, rng.uniform((0.12, 0.14, 0.002), (0.2, 0.26, 0.04), (4000, 3)))
    checked = {"wall": 0, "depth map": 0}
    for group in grasp_groups(PART, HAND)[0][::11]:
        outlines = plane_outlines(group, here, there)
        assert "it" not in {outline.body for outline in outlines}
        for e, name, body, points in ((here, "pickup", "wall", in_wall), (there, "putdown", "depth map", in_columns)):
            local = apply(inverse(e.T_world_part @ group.grasp_class.T_part_plane), points)
            half = group.opening(HAND) / 2
            inside = local[(local[:, 0] > half) & (local[:, 0] < half + HAND.finger_thickness)][:, 1:]
            inside = inside[np.linalg.norm(inside - group.point, axis=1) < HAND.finger_length]
            seen = [shapely.Polygon(o.corners) for o in outlines if (o.end, o.body, o.volume) == (name, body, "finger_right")]
            assert shapely.distance(shapely.points(inside), shapely.union_all(seen)).max(initial=0.0) < 1e-6
            checked[body] += len(inside)
    assert min(checked.values()) > 50


def test_the_hand_stands_clear_of_all_outlines_at_a_legal_angle():
    wall = Block("wall", np.array((0.03, 0.05, 0.10)), from_xyz_rpy((0.47, 0.09, 0.05)))
    here = end(T, wall)
    for group, rotations in legal_groups(here, here)[::9]:
        (angle,) = rotations.best(1)
        T_plane_hand = hand_in_plane(group.point, angle, 1)
        half = HAND.finger_width / 2
        finger = np.array([[0, -half, 0], [0, half, 0], [0, half, -HAND.finger_length], [0, -half, -HAND.finger_length]])
        pad = shapely.Polygon(apply(T_plane_hand, finger)[:, 1:])
        for outline in plane_outlines(group, here, here):
            if outline.volume.startswith("finger"):
                assert shapely.Polygon(outline.corners).distance(pad) > 0.0009
