"""Links as convex pieces: they hold the exact mesh, with little air, and what the cache keeps is what was made."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from handey_studio.geometry import box, hull_triangles, prism
from handey_studio.geometry.cover import CoverOptions, convex_cover
from handey_studio.geometry.round_bodies import ROUND_M, ROUND_SHARE, cylinder, sphere
from handey_studio.geometry.transforms import apply, from_xyz_rpy
from handey_studio.world import arm_of, link_body, load_robot

ROBOT = load_robot("robots/ur5")


def beyond(points: np.ndarray, pieces: tuple[np.ndarray, ...]) -> float:
    """How far [m] the worst of the points lies outside the nearest piece's planes."""
    outside = [(points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1) for hull in map(ConvexHull, pieces)]
    return float(np.min(outside, axis=0).max())


def on_surface(vertices: np.ndarray, triangles: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    a, b, c = np.moveaxis(vertices[triangles[rng.integers(len(triangles), size=count)]], 1, 0)
    u, v = rng.uniform(size=(2, count, 1))
    return np.where(u + v > 1, a + (1 - u) * (b - a) + (1 - v) * (c - a), a + u * (b - a) + v * (c - a))


@pytest.mark.parametrize("body", arm_of(ROBOT).bodies, ids=lambda body: body.name)
def test_the_pieces_hold_the_exact_mesh(body):
    rng = np.random.default_rng(1)
    surface = on_surface(body.vertices, body.triangles, 3000, rng)
    assert beyond(surface, body.hulls) < 1e-6 and beyond(body.vertices, body.hulls) < 1e-6
    inner = surface[:1500] + rng.uniform(size=(1500, 1)) * (surface[1500:] - surface[:1500])
    from handey_studio.cell.check.shapes import link_shape

    inside = np.array([link_shape(body).holds(point) for point in inner[:150]])
    assert inside.sum() > 20 and beyond(inner[:150][inside], body.hulls) < 1e-6


def test_links_hold_little_air():
    forearm = next(body for body in arm_of(ROBOT).bodies if body.name == "forearm_link")
    whole = ConvexHull(forearm.vertices).volume
    assert 1 < len(forearm.hulls) <= CoverOptions().most
    assert sum(ConvexHull(hull).volume for hull in forearm.hulls) < 0.68 * whole


def test_an_l_is_cut_at_its_corner_and_a_box_is_not_cut():
    ell = prism([(0, 0), (0.6, 0), (0.6, 0.3), (0.3, 0.3), (0.3, 0.6), (0, 0.6)], 0.3)
    assert sum(ConvexHull(piece).volume for piece in convex_cover(ell.vertices, ell.triangles)) == pytest.approx(0.081, rel=0.03)
    cube = box((0.3, 0.2, 0.1))
    assert len(convex_cover(cube.vertices, cube.triangles)) == 1


def test_solids_that_cross_and_surfaces_that_do_not_close():
    bars = [box((0.4, 0.05, 0.05)), box((0.05, 0.4, 0.05))]
    vertices = np.concatenate([bar.vertices for bar in bars])
    triangles = np.concatenate([bars[0].triangles, bars[1].triangles + len(bars[0].vertices)])
    pieces = convex_cover(vertices, triangles)
    assert beyond(vertices, pieces) < 1e-9 and sum(ConvexHull(piece).volume for piece in pieces) < 2.2e-3
    (open_box,) = convex_cover(bars[0].vertices, bars[0].triangles[:-1])
    assert len(open_box) == 8
    tee = prism([(0, 0), (0.1, 0), (0.1, 0.2), (0.6, 0.2), (0.6, 0.3), (0, 0.3)], 0.1)
    pieces = convex_cover(tee.vertices, tee.triangles[:-1])
    assert beyond(on_surface(tee.vertices, tee.triangles, 2000, np.random.default_rng(2)), pieces) < 1e-9
    assert sum(ConvexHull(piece).volume for piece in pieces) < 0.0085 < ConvexHull(tee.vertices).volume


@pytest.mark.parametrize("radius", [0.002, 0.03, 0.2])
def test_polytopes_around_round_bodies_hold_them_and_are_hardly_larger(radius):
    excess = max(ROUND_M, ROUND_SHARE * radius) + 1e-9
    rim = ConvexHull(cylinder(0.3, radius)[:, :2])
    assert (-rim.equations[:, 2]).min() >= radius - 1e-12
    assert np.linalg.norm(cylinder(0.3, radius)[:, :2], axis=1).max() <= radius + excess
    ball = ConvexHull(sphere(radius))
    assert (-ball.equations[:, 3]).min() >= radius - 1e-12
    assert np.linalg.norm(sphere(radius), axis=1).max() <= radius + excess


def test_triangles_of_a_hull_look_outward():
    corners = apply(from_xyz_rpy((0.2, 0.3, 0.1), (0.1, 0.2, 0.3)), sphere(0.1))
    a, b, c = np.moveaxis(corners[hull_triangles(corners)], 1, 0)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a - corners.mean(axis=0)) > 0).all()


def test_what_is_kept_is_what_was_made(tmp_path, monkeypatch):
    from handey_studio.world.arm import Arm

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("sys.platform", "linux")
    made = Arm(ROBOT).bodies
    files = sorted((tmp_path / "handey-studio" / "links").iterdir())
    assert len(files) == len(made)
    files[0].write_bytes(b"not an archive")
    files[1].write_bytes(files[1].read_bytes()[:100])
    monkeypatch.setattr(link_body, "_keep", lambda *_: None)
    again = Arm(ROBOT).bodies
    for one, other in zip(made, again, strict=True):
        assert len(one.hulls) == len(other.hulls)
        np.testing.assert_array_equal(one.vertices, other.vertices)
        for hull, same in zip(one.hulls, other.hulls, strict=True):
            np.testing.assert_allclose(hull, same, atol=1e-12)


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, monkeypatch):
    from handey_studio.world.arm import Arm

    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr("sys.platform", "linux")
    assert len(Arm(ROBOT).bodies) == len(arm_of(ROBOT).bodies)
