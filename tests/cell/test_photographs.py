"""Rendered photographs and the scan of them: the two ways from true bodies to readings check each other, and both the truth."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody, fixed_bodies
from handey_studio.cell.chessboard import Chessboard, board_poses, painted
from handey_studio.cell.photographs import Exposure, body_paint, develop, look, room_light, see, stripe_light
from handey_studio.cell.scenes.scan_folders import (
    BOARDS,
    STRIPES,
    TRUE_FILE,
    FolderOptions,
    moved_steps,
    write_stage_folder,
    write_sweep_folder,
)
from handey_studio.cell.stripes import Surfaces, photograph, stripe_peaks
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, transform
from handey_studio.sensing.stripes.board import Board, find_corners
from handey_studio.sensing.stripes.calibrate import CalibrateOptions, calibrate
from handey_studio.sensing.stripes.instrument_file import read_instrument
from handey_studio.sensing.stripes.photographs import Photograph
from handey_studio.sensing.stripes.scan import depth_map_of, scan_folder
from handey_studio.sensing.stripes.stripe_light import laser_colour, laser_light
from handey_studio.sensing.stripes.stripe_peaks import find_peaks

CELL = Workcell()
SMALL = tuple(replace(camera, focal_px=700.0, width=384, height=300) for camera in CELL.finder.cameras)
FINDER = replace(CELL.finder, cameras=SMALL, planes=40, cell=0.002, peak_noise_px=0.08)
T_BOX = from_xyz_rpy((0.50, 0.04, 0.03), (0.0, 0.0, 0.5))
BODIES = [*fixed_bodies(CELL), SolidBody("box", box((0.08, 0.12, 0.06)), T_BOX)]
EXPOSURE = Exposure(line_sigma=0.0009, samples=2)


def distance_to_bodies(points_world) -> np.ndarray:
    """Distance (n,) [m] of points from the nearest true triangle, one triangle after the other."""
    nearest = np.full(len(points_world), np.inf)
    for triangle in Surfaces(BODIES, np.eye(4)).triangles:
        closest = trimesh.triangles.closest_point(np.repeat(triangle[None], len(points_world), axis=0), points_world)
        nearest = np.minimum(nearest, np.linalg.norm(closest - points_world, axis=1))
    return nearest


@pytest.fixture(scope="module")
def placed():
    T_range_world = inverse(FINDER.T_world_range)
    bodies = [body.at(T_range_world @ body.T_world_body) for body in BODIES]
    return Surfaces(bodies, np.eye(4)), body_paint(bodies)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photographs") / "sweep"
    write_sweep_folder(folder, FINDER, BODIES, FolderOptions(stripes=40, exposure=EXPOSURE), np.random.default_rng(0))
    return folder


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photographs") / "stage"
    options = FolderOptions(stripes=12, boards=7, exposure=replace(Exposure(), samples=3))
    write_stage_folder(folder, FINDER, BODIES, options, np.random.default_rng(1))
    return folder


def test_rendered_peaks_are_where_the_analytic_ones_are(placed):
    """The same instrument, seen in two ways: rays and a Gaussian of light on one side, crossings of faces and planes on the other."""
    surfaces, paint = placed
    analytic = stripe_peaks(FINDER, 0, surfaces)
    room, seen = look(FINDER.cameras[0], surfaces, paint, EXPOSURE)
    rng = np.random.default_rng(0)
    dark = Photograph(develop(room, None, EXPOSURE, rng).astype(np.float32), np.zeros(room.shape, bool))
    apart, missing = [], 0
    for number in (12, 19, 27):
        stripe = stripe_light(seen, surfaces, FINDER.laser_planes[number], FINDER.laser, EXPOSURE)
        lit = Photograph(develop(room, stripe, EXPOSURE, rng).astype(np.float32), np.zeros(room.shape, bool))
        peaks = find_peaks(laser_light(lit, dark, laser_colour([(lit, dark)], "auto")), lit.saturated, "down")
        wanted = {v: u for u, v, plane in zip(analytic.u, analytic.v, analytic.plane, strict=True) if plane == number}
        single = {v: u for v, u in wanted.items() if list(analytic.v[analytic.plane == number]).count(v) == 1}
        found = dict(zip(peaks.uv[:, 1], peaks.uv[:, 0], strict=True))
        apart += [found[v] - u for v, u in single.items() if v in found]
        missing += sum(v not in found for v in single)
    assert missing < 0.03 * len(apart) and len(apart) > 600
    assert np.median(np.abs(apart)) < 0.05 and np.percentile(np.abs(apart), 95) < 0.3 and abs(np.mean(apart)) < 0.03


def test_a_scan_of_a_swept_folder_lies_on_the_true_bodies_and_tells_its_noise(sweep):
    instrument = read_instrument(sweep / TRUE_FILE)
    scan = scan_folder(sweep / STRIPES, instrument)
    assert scan.stripes == 80 and scan.directions == ("down", "down") and {colour.name for colour in scan.colours} == {"red"}
    points = apply(instrument.T_world_range, scan.points_range)
    off = distance_to_bodies(points[::3])
    assert len(points) > 15000 and np.sqrt(np.mean(off**2)) < 5e-4, "a pixel is 5 mm of height here"
    heights = points[::3][off < 2e-3, 2]
    table = heights[np.abs(heights) < 2e-3]
    assert 1.4826 * np.median(np.abs(table - np.median(table))) == pytest.approx(scan.noise, rel=0.4), "but for the rims"
    other = scan_folder(sweep / STRIPES, instrument)
    assert np.array_equal(scan.points_range, other.points_range)


def test_both_ways_give_the_same_depth_map(sweep):
    """The photographs' depth map and the fast simulated scan's, by the same triangulation and fusing."""
    instrument = read_instrument(sweep / TRUE_FILE)
    finder = replace(FINDER, cell=instrument.cell)
    rendered = depth_map_of(scan_folder(sweep / STRIPES, instrument), instrument)
    fast = photograph(finder, BODIES, np.random.default_rng(0))
    assert rendered.elevation.shape == fast.elevation.shape and rendered.cell == fast.cell
    both = np.isfinite(rendered.elevation) & np.isfinite(fast.elevation)
    either = np.isfinite(rendered.elevation) | np.isfinite(fast.elevation)
    assert both.sum() > 0.93 * either.sum()
    apart = np.abs(rendered.elevation - fast.elevation)[both]
    assert np.median(apart) < 3e-4 and (apart > 3e-3).mean() < 0.03


def test_from_board_photographs_to_readings_within_a_third_of_a_millimetre(stage):
    """Camera, lens, laser and step calibrated from photographs alone; then the truth, which the scan never saw, judges its readings."""
    true = read_instrument(stage / TRUE_FILE)
    found = calibrate(stage / BOARDS, Board(9, 6, 0.02), options=CalibrateOptions(steps=moved_steps(true)))
    assert not any("board" in reason and "stripe" not in reason for reason in found.left_out.values())
    assert found.plane_rms < 2e-4 and np.sqrt(np.mean(np.square(list(found.camera_rms_px.values())))) < 0.1
    assert found.instrument.cameras[0].focal_px == pytest.approx(true.cameras[0].focal_px, rel=5e-3)
    T_true_board = transform(None, (0.0, FINDER.area[1] / 2, 0.003))  # z = 0 is the board's upper side, x the stage's
    for instrument, T, limit in ((true, np.eye(4), 1.5e-4), (found.instrument, T_true_board, 3e-4)):
        scan = scan_folder(stage / STRIPES, instrument)
        off = distance_to_bodies(apply(FINDER.T_world_range @ T, scan.points_range))
        assert len(off) > 5000 and np.sqrt(np.mean(off**2)) < limit, np.sqrt(np.mean(off**2))


def test_a_known_camera_is_kept_and_a_stripe_in_the_boards_own_photograph_serves_too(stage, tmp_path):
    true = read_instrument(stage / TRUE_FILE)
    for path in (stage / BOARDS).glob("*.laser.png"):
        (tmp_path / path.name.replace(".laser", "")).write_bytes(path.read_bytes())
    found = calibrate(tmp_path, Board(9, 6, 0.02), camera=true.cameras[0])
    assert found.instrument.cameras[0].focal_px == true.cameras[0].focal_px and found.instrument.rig_step is None
    assert np.degrees(np.arccos(abs(found.instrument.planes[0, :3] @ true.planes[0, :3]))) < 0.3
    for path in list(tmp_path.glob("*.png"))[1:]:
        path.unlink()
    with pytest.raises(BadInput, match="10 × 7 squares has 9 × 6"):
        calibrate(tmp_path, Board(10, 7, 0.02), camera=true.cameras[0])


def test_a_rendered_boards_corners_are_where_they_are():
    camera = replace(SMALL[0], focal_px=620.0, T_range_camera=transform(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 0.5)))
    exposure = replace(Exposure(), room=140.0)
    for pose in board_poses(3, np.random.default_rng(2)):
        T = transform(None, (0.0, 0.0, 0.003)) @ pose  # its upper side is not the table's
        board = Chessboard(T)
        bodies, paint = painted(board, [BODIES[0]])
        room, _ = look(camera, Surfaces(bodies, np.eye(4)), paint, exposure, np.array([1.0, 0.0, 0.0, 9.0]))
        corners = find_corners(develop(room, None, exposure, np.random.default_rng(0)).mean(axis=2), Board(9, 6, 0.02))
        pattern = Board(9, 6, 0.02).corners
        true = camera.project(apply(inverse(camera.T_range_camera) @ T, pattern - pattern.mean(axis=0)))
        assert corners is not None
        missed = np.linalg.norm(corners[:, None] - true, axis=2).min(axis=1)
        assert np.sqrt(np.mean(missed**2)) < 0.1


def test_shadow_darkness_and_the_end_of_the_scale(placed):
    surfaces, paint = placed
    room, seen = look(FINDER.cameras[1], surfaces, paint, EXPOSURE)
    coarse = room_light(see(FINDER.cameras[1], surfaces, paint, 1), EXPOSURE)
    assert np.median(np.abs(room - coarse)) < 0.5
    stripe = stripe_light(seen, surfaces, FINDER.laser_planes[20], FINDER.laser, EXPOSURE)
    assert stripe.max() > 60 and (stripe > 1).mean() < 0.05
    below = np.array([*(-FINDER.laser_planes[20][:3]), -FINDER.laser_planes[20][3]])
    assert np.allclose(stripe_light(seen, surfaces, below, FINDER.laser, EXPOSURE), stripe), "a plane has two sides"
    buried = stripe_light(seen, surfaces, FINDER.laser_planes[20], np.array([0.2, 0.2, -0.5]), EXPOSURE)
    assert buried.max() == 0.0, "a lamp below the table lights nothing above it"
    hot = develop(room, 9.0 * stripe, EXPOSURE, np.random.default_rng(0))
    assert hot.dtype == np.uint8 and (hot[..., 2] == 255).sum() > 100
    with pytest.raises(BadInput, match="infrared"):
        Exposure(colour="infrared")


def test_a_folder_that_is_there_is_not_written_over(sweep):
    with pytest.raises(BadInput, match="already"):
        write_sweep_folder(sweep, FINDER, BODIES, FolderOptions(stripes=2), np.random.default_rng(0))
    with pytest.raises(BadInput, match="stripes"):
        FolderOptions(stripes=1)
