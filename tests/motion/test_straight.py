"""Straight motions of the hand: on its lines, on one branch, slowed where a joint must hurry, and refused with a reason."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry.transforms import rotation_about, transform
from handey_studio.motion import PathResult, straight_path, time_path
from handey_studio.motion.hand_way import LINE_M, hand_way, slowest
from handey_studio.world import NO_TABLE, World, arm_of
from tests.motion.oracle import DOWN, ROBOT
from tests.motion.test_path import at

WORLD, ARM = World(ROBOT, NO_TABLE), arm_of(ROBOT)


def line(start: np.ndarray, shift: np.ndarray, turn_rad: float = 0.0, count: int = 20) -> np.ndarray:
    """Hand poses from one on along a straight line, turning evenly about the vertical."""
    shares = np.linspace(0.0, 1.0, count)
    return np.array([transform(rotation_about([0, 0, 1], turn_rad * s) @ start[:3, :3], start[:3, 3] + s * shift) for s in shares])


def distance_to_lines(hands: np.ndarray, path: PathResult) -> np.ndarray:
    """How far (k,) [m] the hand is from the lines from pose to pose, at many places of the curve."""
    a, b = hands[:-1, :3, 3], hands[1:, :3, 3]
    places = ARM.hand_pose(path.curve.at(np.linspace(0.0, path.curve.ends[-1], 900)))[:, None, :3, 3]
    share = np.clip(np.einsum("kpx,px->kp", places - a, b - a) / ((b - a) ** 2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(places - a - share[..., None] * (b - a), axis=2).min(axis=1)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_the_hand_keeps_to_its_lines_and_tells_how_far_it_is_off(seed, stairs):
    rng = np.random.default_rng(seed)
    start = transform(DOWN[:3, :3], [0.42, -0.05, 0.22])
    hands = line(start, rng.uniform(-0.06, 0.06, 3), rng.uniform(-0.5, 0.5))
    if stairs:
        corner = line(hands[-1], rng.uniform(-0.02, 0.02, 3), 0.0, 6)
        hands = np.concatenate([hands, corner[1:]])
    found = straight_path(WORLD, at(hands[0]), hands, 0.05)
    assert found.found and found.straight and found.certificate.proved
    measured = distance_to_lines(hands, found).max()
    assert measured <= found.off_line + 2e-5 and found.off_line <= LINE_M
    ends = ARM.hand_pose(time_path(ROBOT, found, 0.05).q_rad[[0, -1]])
    assert np.abs(ends - hands[[0, -1]]).max() < 1e-6


def test_a_motion_past_a_singularity_is_slowed_and_says_which_joint():
    start = at(transform(DOWN[:3, :3], [0.42, -0.05, 0.22]))
    inner = np.array(start)
    inner[4] = np.deg2rad(-2.0)  # the wrist's first and third axes all but in line
    hands = line(ARM.hand_pose(inner), ARM.hand_pose(inner)[:3, 2] * 0.03, 0.0, 16)
    way = hand_way(ARM, inner, hands)
    speed, k, joint = slowest(ROBOT, way)
    assert not way.reason and joint.startswith("wrist") and speed < ROBOT.tool_speed / 2 and 0 <= k < len(way.points) - 1
    free = straight_path(WORLD, inner, hands, 0.05)
    plain = straight_path(WORLD, start, line(ARM.hand_pose(start), np.array([0.03, 0, 0]), 0.0, 16), 0.05)
    assert joint in free.entries[-1].option and "slows" in free.entries[-1].option and "slows" not in plain.entries[-1].option
    assert time_path(ROBOT, free, 0.05).time_s[-1] > 1.5 * time_path(ROBOT, plain, 0.05).time_s[-1]


def test_a_jump_between_branches_names_the_joint_the_angle_and_the_limit():
    start = transform(DOWN[:3, :3], [0.42, -0.05, 0.22])
    jump = np.array([start, transform(rotation_about([0, 0, 1], 1.2) @ start[:3, :3], start[:3, 3])])
    refused = straight_path(WORLD, at(start), jump, 0.05)
    assert not refused.found and "would jump by" in refused.reason and "more than 20°" in refused.reason and "_joint" in refused.reason


def test_one_pose_is_no_motion():
    start = transform(DOWN[:3, :3], [0.42, -0.05, 0.22])
    still = straight_path(WORLD, at(start), start[None], 0.05)
    assert still.found and still.curve is None and len(time_path(ROBOT, still, 0.05).time_s) == 1
