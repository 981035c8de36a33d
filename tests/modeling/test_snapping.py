import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, inverse, rotate, transform
from handey_studio.modeling.patches.patch import Border, Patch, Patches
from handey_studio.modeling.picking.sightlines import meets_readings
from handey_studio.modeling.picking.snap import MODEL, Ray, SnapOptions
from handey_studio.modeling.picking.snapping import SUPPORT, pick, pickable
from handey_studio.modeling.scans import Scan
from handey_studio.sensing.depth_view import DepthView, Orthographic
from handey_studio.sensing.view_map import STEEP_PX, STEEP_SIGMAS
from tests.modeling.looks import looking, moved, scan_of

CARTON = moved(box((0.08, 0.06, 0.05)), transform(translation=(0.0, 0.0, 0.025)))
EYE = looking((0.25, -0.3, 0.35), (0.0, 0.0, 0.02))
SCAN = scan_of([CARTON], EYE)
FROM_ABOVE = transform(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 1.0))
ABOVE = scan_of([CARTON], FROM_ABOVE, Orthographic(0.001, 79.5, 79.5), shape=(160, 160))
PIXEL = 0.001


def towards(eye, point, pixel=PIXEL) -> Ray:
    return Ray(np.asarray(eye), np.asarray(point) - np.asarray(eye), pixel)


def top_patch() -> Patches:
    """What a segmentation would say of the carton's top, its far side hidden by something."""
    ring = np.array([[-0.04, -0.03, 0.05], [0.04, -0.03, 0.05], [0.04, 0.03, 0.05], [-0.04, 0.03, 0.05]])
    borders = (Border("crease", 1), Border("crease", 2), Border("cut"), Border("rim"))
    numbers = {"rms": 1e-4, "area": 0.0048, "readings": 1000, "bend": 0.0, "tilt": 0.001}
    patch = Patch(0, np.array([0.0, 0.0, 1.0]), 0.05, (ring,), (borders,), **numbers, object=0)
    points = apply(SCAN.view.T_world_sensor, SCAN.view.points_sensor())
    labels = np.where(points[..., 2] < 1e-4, SUPPORT, np.where(np.abs(points[..., 2] - 0.05) < 1e-4, 0, -1))
    return Patches(labels, (patch,), ((0,),))


def spanned(scan: Scan) -> trimesh.Trimesh:
    """The naive surface: every pair of triangles between neighbouring readings that are no jump apart."""
    view = scan.view
    points, z = view.points_sensor().reshape(-1, 3), view.depth.ravel()
    number = np.arange(z.size).reshape(view.depth.shape)
    a, b, c, d = number[:-1, :-1].ravel(), number[1:, :-1].ravel(), number[:-1, 1:].ravel(), number[1:, 1:].ravel()
    triangles = np.concatenate([np.c_[a, b, c], np.c_[d, b, c]])
    low, high = z[triangles].min(axis=1), z[triangles].max(axis=1)
    steep = STEEP_PX / np.asarray(view.projection.pixels_per_metre(low)) + STEEP_SIGMAS * view.noise
    return trimesh.Trimesh(np.nan_to_num(points), triangles[high - low <= steep], process=False)


@pytest.mark.parametrize("scan", [SCAN, ABOVE], ids=["pinhole", "from above"])
def test_a_line_of_sight_meets_what_the_naive_surface_says(scan):
    rng = np.random.default_rng(4)
    mesh, T = spanned(scan), inverse(scan.view.T_world_sensor)
    eyes = rng.uniform((-0.4, -0.4, 0.05), (0.4, 0.4, 0.6), (300, 3))
    aims = rng.uniform((-0.06, -0.06, 0.0), (0.06, 0.06, 0.05), (300, 3))
    origins, ways = apply(T, eyes), rotate(T, aims - eyes)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    hits, rays, _ = mesh.ray.intersects_location(origins, ways, multiple_hits=False)
    naive = np.full(300, np.inf)
    naive[rays] = ((hits - origins[rays]) * ways[rays]).sum(axis=1)
    found = [meets_readings(scan.view, origin, way) for origin, way in zip(origins, ways, strict=True)]
    ours = np.array([np.inf if hit is None else hit[0] for hit in found])
    far = 100.0  # where one met nothing
    alike = np.abs(np.minimum(ours, far) - np.minimum(naive, far)) < 1e-4
    assert np.isfinite(naive).mean() > 0.6 and alike.mean() > 0.98  # at a rim embree and half a pixel's step may differ


def test_from_the_sensors_own_place_every_reading_is_met():
    rows, columns = np.array([[3, 5], [120, 160], [90, 140], [239, 319]]).T
    points = apply(SCAN.view.T_world_sensor, SCAN.view.points_sensor())[rows, columns]
    for row, column, point in zip(rows, columns, points, strict=True):
        snap = pick(pickable((SCAN,), (np.eye(4),), (None,)), towards(EYE[:3, 3], point), SnapOptions(kinds=()))
        assert snap is not None and snap.kind == "point" and np.linalg.norm(snap.point - point) < 1e-6, (row, column)


def test_no_skirt_hangs_across_a_jump():
    scene = pickable((ABOVE,), (np.eye(4),), (None,))
    sideways = towards((0.5, 0.0, 0.025), (0.0, 0.0, 0.025))
    assert pick(scene, sideways) is None  # from above no wall was seen


@given(st.integers(0, 7), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_a_click_near_a_visible_corner_snaps_to_it(corner, dx, dy, seed):
    rng = np.random.default_rng(seed)
    eye = rng.uniform((-0.3, -0.3, 0.2), (0.3, 0.3, 0.5))
    view = looking(eye, CARTON.vertices[corner])
    ray = Ray(eye, view[:3, :3] @ (dx * PIXEL, dy * PIXEL, 1.0), PIXEL)
    snap = pick(pickable((), (), (), CARTON), ray)
    hidden = all((CARTON.normals[f] @ (eye - CARTON.vertices[corner])) < 0 for f, face in enumerate(CARTON.faces) if corner in face.outer)
    if hidden:
        assert snap is None or snap.kind != "vertex" or snap.number != corner
    else:
        assert snap is not None and snap.kind == "vertex" and snap.owner == MODEL and snap.number == corner
        assert np.allclose(snap.point, CARTON.vertices[corner]) and snap.distance_px == pytest.approx(np.hypot(dx, dy), abs=0.02)
        assert snap.of == f"corner {corner} of the model"


def test_a_click_along_an_edge_snaps_to_the_edge_and_tells_its_direction():
    ray = towards((0.3, -0.3, 0.3), (0.01, -0.03, 0.051))
    snap = pick(pickable((), (), (), CARTON), ray)
    assert snap is not None and snap.kind == "edge" and snap.of.startswith("edge ")
    assert (
        np.allclose(np.abs(snap.direction), (1, 0, 0)) and np.allclose(snap.point[1:], (-0.03, 0.05)) and abs(snap.point[0] - 0.01) < 2e-3
    )


def test_patches_draw_the_click_and_what_is_cut_off_does_not():
    scene = pickable((SCAN,), (np.eye(4),), (top_patch(),))
    eye = EYE[:3, 3]
    corner = pick(scene, towards(eye, (0.0395, -0.0295, 0.05)))
    assert (
        corner is not None
        and (corner.kind, corner.owner, corner.number) == ("vertex", 0, 0)
        and np.allclose(corner.point, (0.04, -0.03, 0.05))
    )
    rim = pick(scene, towards(eye, (-0.0395, 0.0, 0.05)))
    assert rim is not None and rim.kind == "edge" and rim.of == 'rim of patch 0 in scan "scan"'
    cut = pick(scene, towards(eye, (0.0, 0.0295, 0.05)))
    assert cut is not None and cut.kind == "plane" and cut.of == 'patch 0 in scan "scan"' and np.allclose(cut.normal, (0, 0, 1))
    table = pick(scene, towards(eye, (0.1, -0.05, 0.0)))
    assert table is not None and table.kind == "plane" and table.number == SUPPORT and np.isclose(table.point[2], 0.0)
    wall = pick(scene, towards(eye, (0.0, -0.03, 0.02)))
    assert wall is not None and wall.kind == "point" and np.isclose(wall.point[1], -0.03, atol=1e-4)


def test_another_scan_lies_where_its_pose_puts_it():
    T = transform(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), (0.2, 0.1, 0.0))
    scene = pickable((SCAN,), (T,), (top_patch(),))
    snap = pick(scene, towards(apply(T, EYE[:3, 3]), apply(T, (0.0, 0.0, 0.05))))
    assert snap is not None and snap.kind == "plane" and np.allclose(snap.point, apply(T, (0.0, 0.0, 0.05)), atol=1e-9)


def test_the_nearer_of_scan_and_model_is_hit():
    eye, aim = EYE[:3, 3], np.array([0.0, 0.0, 0.05])
    inside = moved(box((0.02, 0.02, 0.02)), transform(translation=(0.0, 0.0, 0.02)))
    over = moved(box((0.02, 0.02, 0.04)), transform(translation=(0.0, 0.0, 0.05)))
    same = moved(CARTON, transform(translation=(0.0, 0.0, -0.001)))  # a millimetre behind its readings: the model is meant
    for solid, owner in ((inside, 0), (over, MODEL), (same, MODEL)):
        snap = pick(pickable((SCAN,), (np.eye(4),), (top_patch(),), solid), towards(eye, aim), SnapOptions(kinds=("plane",)))
        assert snap is not None and snap.owner == owner
    only_scan = pick(
        pickable((SCAN,), (np.eye(4),), (top_patch(),), over), towards(eye, aim), SnapOptions(to_model=False, kinds=("plane",))
    )
    assert only_scan is not None and only_scan.owner == 0


def test_where_nothing_is_nothing_is_picked():
    assert pick(pickable((), (), ()), towards((0, 0, 1), (0, 0, 0))) is None
    blind = Scan("blind", DepthView(np.full((20, 20), np.nan), SCAN.view.projection, EYE))
    assert pick(pickable((blind,), (np.eye(4),), (None,)), towards(EYE[:3, 3], (0, 0, 0))) is None
    assert pick(pickable((SCAN,), (np.eye(4),), (None,)), towards((0, 0, 1), (0, 0, 2))) is None
