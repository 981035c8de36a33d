"""§6: hidden frames come back from shown cubes; what the poses do not determine is told, and so are slipped cubes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, from_xyz_rpy, pose_difference, rotation_about, rotation_angle
from handey_studio.sensing.frame_fit import FitOptions, fit_frame
from handey_studio.sensing.range_calibration import Shown, rigid_between, three_pose_frame, upright_between
from tests.sensing.showing import FACE_HAND, frame, hand_at, many_hands, shown_from, table_of, three_hands

lengths = st.floats(-2.0, 2.0)
angles = st.floats(-np.pi, np.pi)
FREELY = FitOptions(upright=False)


@settings(max_examples=60, deadline=None)
@given(x=lengths, y=lengths, z=lengths, yaw=angles, hand_yaw=angles, dx=st.floats(0.02, 0.4))
def test_three_poses_recover_any_upright_frame(x, y, z, yaw, hand_yaw, dx):
    T = frame(x, y, z, yaw)
    found = three_pose_frame(shown_from(T, three_hands(dx, hand_yaw)), table_of(T, 0.05))
    off, turn = pose_difference(found, T)
    assert off < 1e-9 and turn < 1e-9


def test_the_formulas_as_printed_do_not_recover_it():
    """The two slips of §6, so that nobody puts them back."""
    T = frame()
    shown = shown_from(T, three_hands())
    v1, v2, v3 = (one.face_range for one in shown)
    R = rotation_about((0, 0, 1), np.arctan2(v2[0] - v1[0], v2[1] - v1[1]))
    assert rotation_angle(R @ T[:3, :3]) > 0.1, "atan2(Δx, Δy) is no turn between the frames"
    right = T[:3, :3].T
    offset = shown[1].T_world_hand[:3, 3] + 0.5 * right.T @ (v2 - v3) + right.T @ v2
    assert np.linalg.norm(offset[:2] - T[:2, 3]) > 0.1, "the face seen from the range frame is to be taken off, not added"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda hands: hands[:2], "takes 3 poses, these are 2"),
        (lambda hands: [hands[1], hands[0], hands[2]], "along +x of pose 1"),
        (lambda hands: [hands[0], hand_at(hands[1][:3, 3], 0.4), hands[2]], "orientation of pose 1"),
        (lambda hands: [hands[0], hands[1], hand_at(hands[1][:3, 3], 1.0)], "turned by 180°"),
        (lambda hands: [hands[0], hands[1], hand_at(hands[0][:3, 3], 0.3 + np.pi)], "its wrist in the same place"),
    ],
)
def test_other_poses_are_refused(change, words):
    T = frame()
    with pytest.raises(BadInput, match=words.replace("+", r"\+")):
        three_pose_frame(shown_from(T, change(three_hands())), table_of(T))


@settings(max_examples=30, deadline=None)
@given(x=lengths, y=lengths, z=lengths, yaw=angles, seed=st.integers(0, 10_000), n=st.integers(3, 10))
def test_many_poses_recover_any_upright_frame(x, y, z, yaw, seed, n):
    T = frame(x, y, z, yaw)
    shown = shown_from(T, many_hands(n, np.random.default_rng(seed)))
    closed, fit = upright_between(shown), fit_frame(shown, table_of(T))
    assert np.linalg.norm(closed[:2, 3] - T[:2, 3]) < 1e-9 and pose_difference(closed, T)[1] < 1e-9
    off, turn = pose_difference(fit.T_world_range, T)
    assert off < 1e-9 and turn < 1e-9 and fit.rms_m < 1e-9
    np.testing.assert_allclose(fit.face_hand, FACE_HAND, atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(rpy=st.tuples(angles, st.floats(-1.4, 1.4), angles), seed=st.integers(0, 10_000))
def test_a_free_turn_recovers_any_frame_when_the_hand_tilts(rpy, seed):
    rng, T = np.random.default_rng(seed), from_xyz_rpy((0.3, -0.2, 0.5), rpy)
    tilts = [rotation_about(rng.normal(size=3), rng.uniform(0, 1.0)) for _ in range(8)]
    hands = [hand_at(rng.uniform(-0.2, 0.2, 3), rng.uniform(-3, 3), tilt) for tilt in tilts]
    fit = fit_frame(shown_from(T, hands), None, FREELY)
    off, turn = pose_difference(fit.T_world_range, T)
    assert off < 1e-8 and turn < 1e-8, (off, turn, fit.warnings)


def test_kabsch_recovers_a_transform_and_never_mirrors():
    T, rng = frame(roll=0.7), np.random.default_rng(1)
    points = rng.normal(size=(6, 3)) * (1, 1, 0)
    assert pose_difference(rigid_between(apply(T, points), points), T)[1] < 1e-9
    assert np.linalg.det(rigid_between(points * (1, 1, -1) + (0, 0, 0.1), rng.normal(size=(6, 3)))[:3, :3]) > 0


@pytest.mark.parametrize("upright", [True, False])
def test_ten_poses_beat_three_and_their_sigmas_hold(upright):
    """0.1 mm of noise in each face; the sigmas that are told are those that occur."""
    rng, T, many, three, told, left_out = np.random.default_rng(3), frame(), [], [], [], 0
    for _ in range(24):
        shown = shown_from(T, [*three_hands(), *many_hands(7, rng)], 1e-4, rng)
        fit = fit_frame(shown, table_of(T), FitOptions(upright=upright, face_sigma_m=1e-4))
        middle = apply(T, fit.middle_range)
        many.append(apply(fit.T_world_range, fit.middle_range) - middle)
        three.append(apply(three_pose_frame(shown[:3], table_of(T)), fit.middle_range) - middle)
        told.append(fit.sigma_m)
        assert not fit.warnings or not fit.used.all()
        left_out += int((~fit.used).sum())
    rms = np.sqrt(np.mean(np.square(many), axis=0))
    assert left_out <= 1, "a set without outliers has one in a hundred times"
    assert rms.max() < 1.5e-4 and rms[0] < np.sqrt(np.mean(np.square(three), axis=0))[0]
    assert (rms[:2] < 1.5 * np.mean(told, axis=0)[:2]).all() and (rms[:2] > 0.5 * np.mean(told, axis=0)[:2]).all()


def test_a_slipped_cube_is_told_and_left_out():
    rng, T = np.random.default_rng(5), frame()
    shown = shown_from(T, many_hands(10, rng), 5e-5, rng)
    shown[4] = Shown(shown[4].T_world_hand, shown[4].face_range + np.array([0.0, 0.003, 0.0]))
    fit = fit_frame(shown, table_of(T))
    assert fit.used.tolist() == [k != 4 for k in range(10)]
    assert fit.warnings[0].startswith("pose 5 is 3.") and np.linalg.norm(fit.residuals_m[4]) > 0.0025
    assert pose_difference(fit.T_world_range, T)[1] < np.deg2rad(0.05)


def test_what_the_poses_leave_open_is_told():
    rng, T = np.random.default_rng(6), frame()

    def told(hands, options=FitOptions(), table=True):
        return " ".join(fit_frame(shown_from(T, hands, 1e-5, rng), table_of(T) if table else None, options).warnings)

    assert "the offset is not determined" in told(many_hands(8, rng, turned=False)) and "turned by at most 0°" in told(
        many_hands(8, rng, turned=False)
    )
    assert "the turn about the vertical is known to" in told(many_hands(8, rng, spread=0.003))
    assert "the height is not determined: measure the table" in told(many_hands(8, rng), table=False)
    in_line = [hand_at((0.4 + 0.02 * k, 0.0, 0.2), np.pi * (k % 2)) for k in range(8)]
    assert "the tilt" in told(in_line, FREELY) and "nearly on one line" in told(in_line, FREELY)
    assert "hardly anything over to check" in told(three_hands())
    assert told(many_hands(8, rng)) == "" == told(many_hands(8, rng), FREELY)


def test_a_frame_that_leans_is_told_whatever_was_assumed():
    rng = np.random.default_rng(7)
    leaning = frame(roll=np.deg2rad(1.0))
    shown = shown_from(leaning, many_hands(10, rng), 1e-5, rng)
    assert "may not be parallel" in " ".join(fit_frame(shown, table_of(leaning)).warnings)
    fit = fit_frame(shown, table_of(leaning), FREELY)
    assert "z is 1.0" in fit.warnings[0] and abs(np.rad2deg(fit.tilt_rad) - 1.0) < 0.05


def test_too_little_is_refused():
    with pytest.raises(BadInput, match="shown at 1 poses"):
        fit_frame(shown_from(frame(), three_hands()[:1]), None)
    with pytest.raises(BadInput, match="rigid"):
        Shown(np.zeros((4, 4)), np.zeros(3))
