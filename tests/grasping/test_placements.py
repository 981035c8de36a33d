import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handey_studio.base import rejected_counts
from handey_studio.geometry import box, prism
from handey_studio.geometry.convex import hull_triangles
from handey_studio.geometry.meshes import polyhedron_from_polygons
from handey_studio.geometry.transforms import apply, rotation_about
from handey_studio.grasping import PlacementOptions, stable_placements
from handey_studio.world import Library, Part

LIBRARY = Library.choose()
ANY = PlacementOptions(0.0, 0.0)


def hull_solid(points):
    return polyhedron_from_polygons(points, hull_triangles(points).tolist())


@pytest.mark.parametrize("name", sorted(LIBRARY.part_files()))
def test_a_placement_rests_on_the_plane_with_its_centre_of_mass_above_its_face(name):
    part = LIBRARY.part(name)
    found, _ = stable_placements(part)
    assert found and list(found) == sorted(found, key=lambda p: -p.tip)
    for placement in found:
        for T in placement.Ts_plane_part:
            corners = apply(T, part.solid.vertices)
            assert abs(corners[:, 2].min()) < 1e-9 and (corners[:, 2] < 1e-6).sum() >= 3
            centre = apply(T, part.solid.volume_and_centroid[1])
            assert np.allclose(centre, (0, 0, placement.height), atol=1e-9)
        assert np.isclose(np.tan(placement.tip), placement.border / placement.height)


def test_symmetric_placements_are_one_and_keep_their_other_names():
    counts = {name: [len(p.Ts_plane_part) for p in stable_placements(LIBRARY.part(name), ANY)[0]] for name in ("brick", "l_block")}
    assert counts["brick"] == [2, 2, 2] and set(counts["l_block"]) == {1}
    cube = stable_placements(Part("cube", box((0.04, 0.04, 0.04))))[0]
    assert [len(p.Ts_plane_part) for p in cube] == [6]
    part = LIBRARY.part("brick")
    for placement in stable_placements(part)[0]:
        looks = [np.sort(apply(T, part.solid.vertices)[:, 2]) for T in placement.Ts_plane_part]
        assert np.allclose(looks[0], looks[1])


def test_what_topples_falls_with_its_number_and_its_limit():
    leaning = Part("leaning", prism([(0, 0), (0.02, 0), (0.09, 0.10), (0.07, 0.10)], 0.03))
    found, entries = stable_placements(leaning)
    fallen = [entry for entry in entries if entry.reason]
    assert rejected_counts(entries)["it topples: the centre of mass is not above the face"] >= 1
    assert len(found) + len(fallen) == len(entries)
    assert all(entry.value is not None and entry.limit is not None and entry.value < entry.limit for entry in fallen)
    tall = Part("tall", box((0.02, 0.02, 0.3)))
    assert {entry.reason for entry in stable_placements(tall)[1] if entry.reason} == {"a small knock tips it over"}


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_pushed_to_its_margin_a_part_falls_back_and_beyond_it_over(seed):
    """Oracle: tip the part about each side of its face; while it falls back, its centre of mass rises."""
    rng = np.random.default_rng(seed)
    part = Part("stone", hull_solid(rng.normal(size=(8, 3)) * 0.03))
    tipped = np.arange(0.0, np.pi / 2, 0.002)
    for placement in stable_placements(part, ANY)[0]:
        falls = []
        for a, b in zip(placement.corners, np.roll(placement.corners, -1, axis=0), strict=True):
            turns = Rotation.from_rotvec(tipped[:, None] * np.append(b - a, 0.0) / np.linalg.norm(b - a))
            falls.append(tipped[int(np.argmax(turns.apply(np.append(-a, placement.height))[:, 2]))])
        assert abs(min(falls) - placement.tip) < 0.004


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_every_stone_rests_somewhere_and_placements_do_not_depend_on_its_frame(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(9, 3)) * 0.03
    turned = points @ rotation_about(rng.normal(size=3), rng.uniform(0, 3)).T + rng.normal(size=3)
    one, other = (stable_placements(Part("stone", hull_solid(p)), ANY)[0] for p in (points, turned))
    assert one
    assert np.allclose(sorted(p.tip for p in one), sorted(p.tip for p in other), atol=1e-4)
