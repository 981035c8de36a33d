"""Calibration as a procedure: a hidden frame is recovered by showing a cube; what goes wrong is told."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.camera import DepthCamera, SensorFaults, look_exactly, with_faults
from handey_studio.cell.in_view import arm_bodies
from handey_studio.cell.protocol import Moved
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, pose_difference, rotation_about, transform
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.frame_fit import fit_frame
from handey_studio.sensing.range_calibration import Shown, TablePoint, three_pose_frame
from handey_studio.sensing.view_map import depth_map_of
from handey_studio.session import find_session, read_session
from handey_studio.session.calibrating import calibrated, cell_with_cube, misplaced, really_at
from handey_studio.session.run import cell_of, station_of
from handey_studio.task.calibrating.calibrate import CUBE, CalibrateOptions, calibrate_range
from handey_studio.task.calibrating.report import calibration_lines, calibration_report
from handey_studio.world import Library, arm_of
from handey_studio.world.library import bundled

OFFSET = from_xyz_rpy((0.015, -0.02, 0.004), (0.0, 0.0, np.deg2rad(2.5)))
POSES = 5


@pytest.fixture(scope="module")
def library():
    return Library(bundled())


@pytest.fixture(scope="module")
def session(library):
    """Figure 1 before a range finder of fewer pixels and planes, which scans in a third of the time."""
    session = read_session(find_session(library, "figure1"))
    finder = session.workcell.finder
    cameras = tuple(replace(camera, focal_px=1000.0, width=560, height=480) for camera in finder.cameras)
    coarse = replace(finder, cameras=cameras, planes=480, cell=0.0015)
    return misplaced(replace(session, workcell=replace(session.workcell, finder=coarse)), OFFSET)


@pytest.fixture(scope="module")
def found(session, library):
    cell = cell_with_cube(session, library, 0.05)
    result = calibrate_range(station_of(session, library), cell, CalibrateOptions(POSES))
    assert cell.held_truly() == CUBE and np.abs(cell.joints() - station_of(session, library).robot.home).max() < 1e-3
    return result


def test_a_hidden_frame_is_recovered(session, found):
    assert found.status == "found" and not found.reason and not found.fit.warnings
    assert sum(showing.face.found for showing in found.showings) == POSES
    off, turn = pose_difference(found.fit.T_world_range, really_at(session))
    assert off < 3e-4 and np.rad2deg(turn) < 0.1
    assert pose_difference(found.T_world_range_before, really_at(session))[0] > 0.01, "it was not known before"


def test_the_papers_three_poses_are_among_them_and_right(session, found):
    off = np.linalg.norm(apply(found.three, found.fit.middle_range) - apply(really_at(session), found.fit.middle_range))
    assert off < 5e-4 and np.rad2deg(pose_difference(found.three, really_at(session))[1]) < 0.1
    first = [Shown(showing.T_world_hand, showing.face.middle_range) for showing in found.showings[:3]]
    three_pose_frame(first, TablePoint(np.zeros(3), 0.0))  # the poses are those that §6 asks for, or this would raise


def test_the_report_tells_poses_residuals_and_both_answers(found):
    report = calibration_report(found)
    assert report["schema"] == "handey/calibration/1" and len(report["poses"]) == POSES
    shown = [Shown(np.array(pose["T_world_hand"]), np.array(pose["face_range_m"])) for pose in report["poses"]]
    again = fit_frame(shown, None)
    np.testing.assert_allclose(again.T_world_range[:2], np.array(report["T_world_range"])[:2], atol=1e-6)
    assert max(np.linalg.norm(pose["residual_m"]) for pose in report["poses"]) < 5e-4
    lines = "\n".join(calibration_lines(found))
    assert "pose 5: off by" in lines and "the paper's answer from its three poses" in lines and "note:" not in lines


def test_the_calibrated_session_sees_what_is_there(session, library, found):
    """Readings before and after, held against the true bodies' heights: the same scan, mapped by another frame."""
    after = calibrated(session, found.fit.T_world_range)
    assert pose_difference(really_at(after), really_at(session))[0] < 1e-9, "the instrument itself stays where it is"
    assert after.scene is None and after.workcell.setup.held is None
    scans = [cell_of(one, library).scan() for one in (session, after)]
    np.testing.assert_allclose(scans[0].elevation, scans[1].elevation, rtol=0, atol=1e-9)
    truth = [really_at(session) @ np.linalg.inv(scan.T_world_range) for scan in scans]
    points = [scan.points_world() for scan in scans]
    off = [np.linalg.norm(apply(T, p) - p, axis=1).max() for T, p in zip(truth, points, strict=True)]
    assert off[0] > 0.02 and off[1] < 5e-4


def test_without_a_cube_the_fingers_close_on_nothing(session, library):
    result = calibrate_range(station_of(session, library), cell_of(session, library))
    assert result.status == "failed" and "put the cube between them" in result.reason


def test_a_cube_that_is_lost_on_the_way_is_noticed(session, library):
    cell = cell_with_cube(session, library, 0.05)
    follow = cell.follow

    def drop(motion) -> Moved:
        moved = follow(motion)
        cell.grip(0.06)
        return moved

    cell.follow = drop
    result = calibrate_range(station_of(session, library), cell, CalibrateOptions(3))
    assert result.status == "failed" and "the cube was lost on the way: the fingers went from 50.0 to 60.0 mm" in result.reason


def test_no_room_is_told(session, library):
    finder = replace(session.workcell.finder, max_height=0.2)
    low = replace(session, workcell=replace(session.workcell, finder=finder))
    result = calibrate_range(station_of(low, library), cell_with_cube(low, library, 0.05), CalibrateOptions(3))
    assert result.status == "failed" and "there is no room to show a cube of 50 mm" in result.reason


@pytest.mark.parametrize(("options", "words"), [({"poses": 2}, "2 poses cannot be shown"), ({"side_m": 0.2}, "a cube of 200 mm")])
def test_options_that_mean_nothing_are_refused(options, words):
    with pytest.raises(BadInput, match=words):
        CalibrateOptions(**options)


def test_a_depth_camera_is_calibrated_by_the_same_procedure(session, library):
    """The guide's recipe for a real camera: the same arm and cube before a pinhole camera whose pose is known within a centimetre."""
    cell = cell_with_cube(session, library, 0.05)
    finder = session.workcell.finder
    down = transform(rotation_about((1, 0, 0), np.deg2rad(172.0)), (0.48, 0.1, 0.95))
    believed, true = down, OFFSET @ down
    rng, projection = np.random.default_rng(4), Pinhole(1100.0, 1100.0, 320.0, 320.0)

    def scan() -> DepthMap:
        bodies = (*cell.true_scene(), *arm_bodies(arm_of(library.robot("ur5")), cell.joints(), cell.opening()))
        depth = with_faults(look_exactly(DepthCamera(projection, (640, 640), true), bodies), SensorFaults(), rng)
        low = finder.T_world_range[:2, 3]
        return depth_map_of(DepthView(depth, projection, believed, 0.0005, 0.001), 0.001, low, low + finder.area)

    cell.scan = scan
    found = calibrate_range(station_of(session, library), cell, CalibrateOptions(4))
    assert found.status == "found", found.reason
    T_world_sensor = found.fit.T_world_range @ inverse(finder.T_world_range) @ believed
    middle = apply(inverse(true), (0.48, 0.0, 0.2))
    assert np.linalg.norm(apply(T_world_sensor, middle) - apply(true, middle)) < 1e-3
    assert np.rad2deg(pose_difference(T_world_sensor, true)[1]) < 0.3
