"""What is noticed, and what is not: each limit from both sides, and geometry that is made, hidden and recovered."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handey_studio.cell.protocol import Moved, Wrench
from handey_studio.cell.recording import Event, Recording
from handey_studio.geometry.transforms import from_xyz_rpy, inverse, pose_difference, transform
from handey_studio.localization import LocatedPose, LocateResult, Rival
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.task.acting.looking import PlaceLimits, changed, check_place, readings_of, wrong_place
from handey_studio.task.acting.noticing import Hold, came_down, closed_on, fingers_went, gave_way, still_held
from handey_studio.task.acting.performance import thinned
from handey_studio.task.acting.recover import felt_block
from handey_studio.task.ruled_out import TURNED, RuledOut, grasp_ruled_out, place_ruled_out, way_ruled_out
from handey_studio.task.sense import Scene
from handey_studio.world import Library, PlacedPart

LIBRARY = Library.choose()
ROBOT, BRICK = LIBRARY.robot("ur5"), LIBRARY.part("brick")
STANDS = from_xyz_rpy((0.2, 0.15, 0.015), (0.0, 0.0, 0.5))
GRIPPED = Hold(0.030, 40.0, 0.82, np.zeros(3))


def recording(n: int = 1, opening: float = 0.03) -> Recording:
    force = np.zeros((n, 3))
    force[n // 3, 2] = 9.0
    time = np.linspace(0.0, 1.0, n) if n > 1 else np.zeros(1)
    q = np.linspace(0.0, 1.0, n)[:, None] * np.ones(6)
    return Recording(time, q, q, np.full(n, opening), np.zeros(n), force, force, (Event(0.71, "touch", 9.0),))


def depth_map(T_world_part: np.ndarray | None = STANDS, seed: int = 0) -> DepthMap:
    """A table with noise, and a brick on it seen straight from above."""
    noise = np.random.default_rng(seed).normal(0.0, 0.0003, (300, 400))
    if T_world_part is None:
        return DepthMap(noise, 0.001, np.eye(4), noise)
    x, y = np.meshgrid((np.arange(400) + 0.5) * 0.001, (np.arange(300) + 0.5) * 0.001)
    centre = BRICK.solid.vertices.mean(axis=0)
    half = np.ptp(BRICK.solid.vertices, axis=0) / 2
    inside = (np.abs(np.c_[x.ravel(), y.ravel()] @ T_world_part[:2, :2] - (inverse(T_world_part)[:2, 3] * -1) - centre[:2]) < half[:2]).all(
        axis=1
    )
    top = float((BRICK.solid.vertices @ T_world_part[2, :3] + T_world_part[2, 3]).max())
    elevation = np.where(inside.reshape(300, 400), top, 0.0) + noise
    return DepthMap(elevation, 0.001, np.eye(4), elevation)


SCAN = depth_map()


def scene(scan: DepthMap, T_seen: np.ndarray | None, rivals: tuple[Rival, ...] = ()) -> Scene:
    if T_seen is None:
        return Scene(scan, LocateResult((), (), (), ()), ())
    pose = LocatedPose("brick", T_seen, T_seen, 0.9, 9, 9, 1.0, 0.0, rivals=rivals)
    return Scene(scan, LocateResult((pose,), (), (), ()), (PlacedPart("brick#1", BRICK, T_seen),))


@pytest.mark.parametrize(
    ("opening", "ended", "kind"), [(0.0275, "arrived", "missed"), (0.0302, "contact", None), (0.036, "contact", "missed")]
)
def test_closing_is_told_by_width_and_contact(opening, ended, kind):
    told = closed_on(Moved(ended, recording(opening=opening)), 0.030, 3)
    assert (told.kind if told else None) == kind


@pytest.mark.parametrize(
    ("now", "kind"),
    [
        (GRIPPED, None),
        (replace(GRIPPED, width=0.0304), None),
        (replace(GRIPPED, width=0.0309), "slipped"),
        (replace(GRIPPED, width=0.0276, force=0.0), "dropped"),
        (replace(GRIPPED, force=2.0), "dropped"),
        (replace(GRIPPED, weight=0.2), "dropped"),
        (replace(GRIPPED, lever=np.array([0.0, 0.82 * 0.004, 0.0])), None),
        (replace(GRIPPED, lever=np.array([0.0, 0.82 * 0.008, 0.0])), "slipped"),
    ],
)
def test_a_carried_part_is_told_by_width_force_weight_and_lever(now, kind):
    told = still_held(now, GRIPPED, 0.0275, True, 5)
    assert (told.kind if told else None) == kind
    if told is not None:
        assert told.value is not None and told.limit is not None and str(told.step) == "5"


def test_without_forces_weight_and_lever_say_nothing():
    assert still_held(replace(GRIPPED, weight=0.0, lever=np.ones(3)), GRIPPED, 0.0275, False, 5) is None


def test_descents_and_fingers_are_told_with_their_number():
    assert came_down(0.003, True, 6) is None
    early, late = came_down(0.005, True, 6), came_down(-0.001, False, 6)
    assert early is not None and early.kind == "early contact" and "5 mm, limit 4 mm" in str(early)
    assert late is not None and late.kind == "late contact"
    assert fingers_went(Moved("arrived", recording(opening=0.0501)), 0.050, ROBOT.hand, 0) is None
    stuck = fingers_went(Moved("contact", recording(opening=0.040)), 0.050, ROBOT.hand, 0)
    assert stuck is not None and stuck.kind == "hand stuck" and stuck.value == pytest.approx(0.010)


def test_a_part_that_its_support_bears_without_a_touch_slipped_in_the_fingers():
    borne = replace(GRIPPED, weight=0.1)
    told = gave_way(borne, GRIPPED, True, 6)
    assert told is not None and told.kind == "slipped" and told.overcome and "0.1 N, limit 0.41 N" in str(told)
    assert gave_way(replace(GRIPPED, weight=0.8), GRIPPED, True, 6) is None, "it hangs in the fingers: there is nothing below"
    assert gave_way(borne, GRIPPED, False, 6) is None and gave_way(borne, None, True, 6) is None
    assert gave_way(replace(borne, weight=0.0), replace(GRIPPED, weight=0.4), True, 6) is None, "too light to be weighed"


def test_two_scans_of_the_same_scene_do_not_differ_and_a_moved_part_shows():
    before = depth_map()
    assert changed(before, depth_map(seed=1)) is None
    aside = changed(before, depth_map(transform(None, (0.004, 0.0, 0.0)) @ STANDS, seed=1))
    gone = changed(before, depth_map(None, seed=1))
    assert aside is not None and gone is not None and aside.kind == "moved"
    assert gone.value == pytest.approx(0.08 * 0.05, rel=0.05)
    shifted = replace(depth_map(seed=1), T_world_range=transform(None, (0.006, 0.0, 0.0)))
    assert changed(before, shifted) is not None, "a scan that is told from elsewhere is another scene"


@given(st.floats(-0.015, 0.015), st.floats(-0.015, 0.015), st.floats(-0.3, 0.3), st.integers(0, 3))
def test_the_check_finds_how_far_off_a_part_stands_whatever_its_symmetry(x, y, yaw, symmetry):
    off = from_xyz_rpy((x, y, 0.0), (0.0, 0.0, yaw))
    T_seen = STANDS @ off @ BRICK.symmetries[symmetry]
    check = check_place(scene(SCAN, T_seen), BRICK, STANDS, STANDS)
    wanted = pose_difference(STANDS @ off, STANDS)
    assert (
        check.found == "seen" and check.off_m == pytest.approx(wanted[0], abs=1e-9) and check.off_rad == pytest.approx(wanted[1], abs=1e-6)
    )
    told, limits = wrong_place(check, PlaceLimits(), 10), PlaceLimits()
    assert (told is not None) == (wanted[0] > limits.off_m or wanted[1] > limits.off_rad)


def test_a_part_that_is_not_recognised_is_judged_by_the_readings_at_its_place():
    assert check_place(scene(depth_map(), None), BRICK, STANDS, STANDS).found == "agrees"
    empty = check_place(scene(depth_map(None), None), BRICK, STANDS, STANDS)
    assert empty.found == "not there" and wrong_place(empty, PlaceLimits(), 10) is not None
    under = transform(None, (0.0, 0.0, -0.008)) @ STANDS
    assert check_place(scene(depth_map(), None), BRICK, under, under).found == "not there"
    beside = transform(None, (1.0, 0.0, 0.0)) @ STANDS
    hidden = check_place(scene(depth_map(), None), BRICK, beside, beside)
    assert hidden.found == "hidden" and wrong_place(hidden, PlaceLimits(), 10) is None
    agree, read, missing = readings_of(depth_map(), BRICK, STANDS)
    assert agree == read > 3000 and missing == 0


def test_of_readings_that_the_view_cannot_tell_apart_the_commanded_one_counts():
    otherwise = from_xyz_rpy((0.01, 0.0, 0.0)) @ STANDS
    check = check_place(scene(depth_map(), otherwise, (Rival("brick", STANDS, 0.45),)), BRICK, STANDS, STANDS)
    assert check.found == "seen" and check.off_m == pytest.approx(0.0, abs=1e-12) and "the hand put it so" in check.sentence
    assert check.rivals == ("brick",)


def test_ruled_out_grasps_are_known_by_either_way_round_and_every_symmetry():
    T = from_xyz_rpy((0.0, 0.0, 0.05), (np.pi, 0.0, 0.3))
    one = RuledOut("grasp", "it slipped", T)
    for S in BRICK.symmetries:
        for turn in (np.eye(4), TURNED):
            near = S @ T @ turn @ from_xyz_rpy((0.003, 0.0, 0.0), (0.0, 0.1, 0.0))
            assert grasp_ruled_out(near, BRICK.symmetries, (one,)) is one
    assert grasp_ruled_out(T @ from_xyz_rpy((0.02, 0.0, 0.0)), BRICK.symmetries, (one,)) is None
    assert grasp_ruled_out(T @ from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.5, 0.0)), BRICK.symmetries, (one,)) is None
    assert place_ruled_out(STANDS, (RuledOut("place", "it tipped", transform(None, (0.01, 0, 0)) @ STANDS),)) is not None
    assert place_ruled_out(STANDS, (one, RuledOut("place", "it tipped", transform(None, (0.03, 0, 0)) @ STANDS))) is None


@given(st.floats(0.0, 1.0), st.floats(-0.3, 0.3))
def test_a_way_is_ruled_out_where_it_passes_the_place_between_its_points_too(share, aside):
    way = np.array([np.zeros(6), np.ones(6), [2.0, 0.0, 1.0, 1.0, 1.0, 1.0]])
    point = way[0] + share * (way[1] - way[0])
    point[0] += aside
    dense = np.concatenate([np.linspace(a, b, 4000) for a, b in pairwise(way)])
    nearest = np.abs(dense - point).max(axis=1).min()
    found = way_ruled_out(way, (RuledOut("way", "blocked", q_rad=point),))
    assert found is None or nearest < 0.12 + 1e-3
    if abs(aside) < 0.1:
        assert found is not None


@given(st.floats(-0.03, 0.03), st.floats(-0.08, 0.0), st.floats(20.0, 90.0))
def test_what_the_hand_touches_is_found_by_force_and_torque(y, z, size):
    """Something presses on the outside of a finger along −x of the hand; the block must begin there."""
    T_world_hand = from_xyz_rpy((0.4, 0.1, 0.3), (np.pi, 0.0, 0.7))
    x = 0.025 + ROBOT.hand.finger_thickness
    touched = T_world_hand[:3, :3] @ (x, y, z)
    force = -size * T_world_hand[:3, 0]
    block = felt_block(Wrench(force, np.cross(touched, force)), T_world_hand, ROBOT, 0.05, None)
    assert block is not None
    inwards = inverse(T_world_hand) @ block.T_world_block[:, 3]
    assert inwards[0] > x and np.abs(inwards[1:3] - (y, z)).max() < 1e-6
    assert felt_block(Wrench(0.1 * force / size, np.zeros(3)), T_world_hand, ROBOT, 0.05, None) is None


@given(st.integers(1, 3000))
def test_a_thinned_recording_keeps_its_ends_its_peak_and_its_events(n):
    whole, thin = recording(n), thinned(recording(n))
    assert len(thin.time_s) <= 64 and thin.time_s[0] == whole.time_s[0] and thin.time_s[-1] == whole.time_s[-1]
    assert thin.force_N.max() == whole.force_N.max() and thin.events == whole.events
    assert np.abs(thin.time_s - 0.71).min() <= np.abs(whole.time_s - 0.71).min() + 1.0 / max(n - 1, 1)
