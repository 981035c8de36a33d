"""Clouds in any orientation become views: made from known scenes, turned, shuffled, and found again."""

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, from_xyz_rpy
from handey_studio.sensing.depth_view import Orthographic, Pinhole
from handey_studio.sensing.reading.files import DepthReading, read_depth
from handey_studio.sensing.reading.gridding import nearest_surface, without_pinholes
from tests.sensing.cloud_files import write_pcd, write_ply
from tests.sensing.scenes import cast, looking_at, pile

PINHOLE = Pinhole(300.0, 302.0, 159.5, 118.0)
TURNS = [from_xyz_rpy((0.3, -1.0, 0.4), (0.7, 2.0, -1.1)), from_xyz_rpy((-0.5, 0.2, -2.0), (-2.5, 0.4, 3.0))]


def scene(seed=0, noise=0.0005):
    """A noisy image (240, 320) [m] with dropouts, the place of its sensor, and its points (240, 320, 3) in the sensor's frame."""
    rng = np.random.default_rng(seed)
    T_world_sensor = looking_at((0.15, -0.4, 0.6), (0.0, 0.0, 0.0))
    depth = cast(pile(rng, 8, side=(0.03, 0.06)), T_world_sensor, PINHOLE, (240, 320))
    depth = depth + rng.normal(0.0, noise, depth.shape)
    depth[rng.random(depth.shape) < 0.02] = np.nan
    v, u = np.mgrid[:240, :320].astype(float)
    return depth, T_world_sensor, PINHOLE.unproject(np.stack([u, v], axis=-1), depth)


def listed(points, seed=0):
    """As a shuffled list without the missing ones."""
    flat = points[np.isfinite(points[..., 2])]
    return flat[np.random.default_rng(seed).permutation(len(flat))]


def distances(reading: DepthReading, points) -> np.ndarray:
    """How far [m] each of the view's readings, in the file's frame, is from the nearest of the file's points."""
    from scipy.spatial import KDTree

    seen = reading.view.points_sensor()
    seen = apply(reading.T_file_sensor, seen[np.isfinite(seen).all(axis=-1)])
    return np.asarray(KDTree(points).query(seen)[0])


@pytest.mark.parametrize("kind", ["ply", "pcd", "npy"])
def test_a_list_of_points_from_a_pinhole_is_its_image_again(tmp_path, kind):
    depth, _, points = scene()
    flat = listed(points).astype(np.float32)
    path = tmp_path / f"a.{kind}"
    if kind == "npy":
        np.save(path, flat)
    elif kind == "ply":
        write_ply(path, flat, "binary_little_endian")
    else:
        write_pcd(path, flat, "binary_compressed")
    reading = read_depth(path)
    view = reading.view
    assert isinstance(view.projection, Pinhole)
    assert view.projection.fx == pytest.approx(300.0, rel=1e-3) and view.projection.fy == pytest.approx(302.0, rel=1e-3)
    assert view.depth.shape == depth.shape and np.allclose(reading.T_file_sensor, np.eye(4))
    known = np.isfinite(depth)
    assert np.abs(view.depth - depth)[known].max() < 1e-5
    assert np.isfinite(view.depth[~known]).mean() > 0.5  # single missing pixels are filled


@pytest.mark.parametrize("turn", range(2))
def test_a_turned_list_is_seen_from_above_its_support(tmp_path, turn):
    _, T_world_sensor, points = scene(1)
    T = TURNS[turn]
    flat = apply(T, listed(points))
    reading = read_depth(write_ply(tmp_path / "a.ply", flat, "ascii"))
    assert isinstance(reading.view.projection, Orthographic)
    up = T[:3, :3] @ T_world_sensor[2, :3]  # world z in the file's frame
    assert reading.T_file_sensor[:3, 2] @ up < -np.cos(np.deg2rad(1.0))
    assert np.quantile(distances(reading, flat), 0.98) < 1.5 * reading.view.projection.pixel
    assert 0.0005 < reading.view.projection.pixel < 0.006


@pytest.mark.parametrize("turn", range(2))
def test_a_pcd_viewpoint_tells_where_the_sensor_stood(tmp_path, turn):
    from scipy.spatial.transform import Rotation

    depth, _, points = scene(2)
    T = TURNS[turn]
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
    viewpoint = " ".join(f"{value:.9f}" for value in (*T[:3, 3], w, x, y, z))
    flat = apply(T, listed(points))
    reading = read_depth(write_pcd(tmp_path / "a.pcd", flat, "binary", viewpoint, 8))
    assert isinstance(reading.view.projection, Pinhole)
    assert np.allclose(reading.T_file_sensor, T, atol=1e-6)
    known = np.isfinite(depth)
    assert np.abs(reading.view.depth - depth)[known].max() < 1e-5


@pytest.mark.parametrize("turn", range(2))
def test_an_organised_cloud_in_any_frame_tells_its_pinhole_and_its_place(tmp_path, turn):
    depth, _, points = scene(3)
    np.save(tmp_path / "a.npy", apply(TURNS[turn], points))
    reading = read_depth(tmp_path / "a.npy")
    assert isinstance(reading.view.projection, Pinhole)
    assert np.allclose(reading.T_file_sensor, TURNS[turn], atol=1e-4)
    known = np.isfinite(depth)
    assert np.abs(reading.view.depth - depth)[known].max() < 1e-4
    assert reading.view.projection.fx == pytest.approx(300.0, rel=1e-3)


def test_an_elevation_grid_as_a_list_keeps_its_grid(tmp_path):
    rng = np.random.default_rng(4)
    above = Orthographic(0.002, 99.5, 99.5)
    depth = cast(pile(rng, 8, 0.15, (0.02, 0.05)), looking_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), above, (200, 200))
    v, u = np.mgrid[:200, :200].astype(float)
    points = apply(
        looking_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), above.unproject(np.stack([u, v], axis=-1), depth + rng.normal(0, 0.0003, depth.shape))
    )
    reading = read_depth(write_pcd(tmp_path / "a.pcd", listed(points), "ascii"))
    projection = reading.view.projection
    assert isinstance(projection, Orthographic) and projection.pixel == pytest.approx(0.002, rel=1e-3)
    assert reading.view.depth.shape == (200, 200)
    assert np.allclose(reading.T_file_sensor[:3, 2], [0, 0, -1])
    assert distances(reading, points.reshape(-1, 3)).max() < 0.0001


def test_a_camera_takes_a_list_into_its_image(tmp_path):
    depth, _, points = scene(5)
    camera = tmp_path / "c.json"
    camera.write_text('{"fx": 300.0, "fy": 302.0, "cx": 159.5, "cy": 118.0, "depth_scale": 1.0, "width": 320, "height": 240}')
    view = read_depth(write_ply(tmp_path / "a.ply", listed(points), "binary_big_endian", "double"), camera).view
    known = np.isfinite(depth)
    assert view.projection == PINHOLE and np.abs(view.depth - depth)[known].max() < 1e-6


def test_units_are_asked_for_and_suspected(tmp_path):
    depth, _, points = scene(6)
    path = write_ply(tmp_path / "a.ply", 1000.0 * listed(points), "binary_little_endian")
    with pytest.raises(BadInput, match="--cloud-unit mm") as told:
        read_depth(path)
    assert "\n" not in str(told.value)
    assert read_depth(path, cloud_unit="mm").view.depth.shape == depth.shape
    with pytest.raises(BadInput, match="across when read in mm"):
        read_depth(write_ply(tmp_path / "b.ply", listed(points), "ascii"), cloud_unit="mm")
    with pytest.raises(BadInput, match="choose one of: m, cm, mm"):
        read_depth(path, cloud_unit="inch")


@pytest.mark.parametrize("shape", [(3000, 3), (60, 50, 3)])
def test_a_cloud_of_nothing_in_particular_is_refused(tmp_path, shape):
    np.save(tmp_path / "a.npy", np.random.default_rng(0).uniform(-0.5, 0.5, shape))
    with pytest.raises(BadInput, match="does not look like seen from its origin"):
        read_depth(tmp_path / "a.npy")
    np.save(tmp_path / "line.npy", np.linspace(0.1, 0.5, 300)[:, None] * [[1.0, 1.0, 1.0]])
    with pytest.raises(BadInput):
        read_depth(tmp_path / "line.npy")


def test_the_nearest_surface_wins_as_the_mean_of_its_readings():
    uv = np.array([[0, 0], [0.2, 0], [0, 0.1], [1, 0], [5, 5]])
    depth, behind = nearest_surface(uv, np.array([1.0, 1.001, 2.0, 3.0, 1.0]), (2, 2), 0.01)
    assert depth[0, 0] == pytest.approx(1.0005) and depth[0, 1] == 3.0 and np.isnan(depth[1]).all()
    assert behind == 0.5


def test_only_single_cells_between_readings_of_one_surface_are_filled():
    depth = np.full((12, 12), 1.0)
    depth[2, 2] = np.nan
    depth[5:8, 5:8] = np.nan
    depth[9:, :] = 2.0
    depth[9, 3] = np.nan
    filled = without_pinholes(depth, 0.1)
    assert filled[2, 2] == 1.0 and np.isnan(filled[6, 6]) and np.isnan(filled[9, 3])
