"""Pairs of edges: the true pose is among the hypotheses, checked against a brute-force matcher."""

from itertools import combinations, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handey_studio.geometry import box, prism
from handey_studio.geometry.transforms import apply, rotate, transform
from handey_studio.localization.distinct import displacement
from handey_studio.localization.hypotheses import hypothesize
from handey_studio.localization.pairs import MIN_ALPHA, data_lines, data_pairs, data_parallels, model_edges, model_pairs
from handey_studio.localization.result import pose_matrix
from handey_studio.localization.segments import DataEdge
from handey_studio.localization.tolerances import MatchTolerances
from handey_studio.world.part import Part

L = Part("l", prism([[0, 0], [0.06, 0], [0.06, 0.0295], [0.0295, 0.0295], [0.0295, 0.06], [0, 0.06]], 0.04))
BRICK = Part("brick", box([0.08, 0.05, 0.03]))
SKEW = next((i, j) for i, j in permutations(range(12), 2) if abs(model_edges(BRICK).direction[i] @ model_edges(BRICK).direction[j]) < 0.5)
TIGHT = MatchTolerances(np.deg2rad(2.0), 0.001, 0.001, np.cos(np.deg2rad(10.0)), 0.0005)


def edge_of(part, number, T, span=(0.0, 1.0), turned=False):
    """A data edge that shows part of a model edge at a pose, with both its surfaces."""
    edge = [e for e in part.solid.edges if abs(e.dihedral) > 0.2][number]
    a, b = part.solid.vertices[edge.start], part.solid.vertices[edge.end]
    ends = apply(T, np.array([a + s * (b - a) for s in (span[::-1] if turned else span)]))
    along = rotate(T, (b - a) / np.linalg.norm(b - a))
    normals = rotate(T, part.solid.normals[[edge.left, edge.right]])
    inward = np.stack([np.cross(normals[0], along), -np.cross(normals[1], along)])
    return DataEdge("convex" if edge.dihedral > 0 else "concave", ends, ends, normals, inward, 50, 0.0)


def matches(part, edges, most=5000):
    lines = data_lines(tuple(edges))
    return hypothesize(model_edges(part), model_pairs(part), lines, data_pairs(lines, np.inf), TIGHT, most)


@pytest.mark.parametrize("part", [BRICK, L], ids=lambda part: part.name)
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_two_visible_pieces_of_edges_give_the_true_pose(part, data):
    T = transform(Rotation.random(rng=np.random.default_rng(data.draw(st.integers(0, 9999)))).as_matrix(), (0.1, -0.2, 0.9))
    edges = model_edges(part)
    skew = [(i, j) for i, j in permutations(range(len(edges.half)), 2) if abs(edges.direction[i] @ edges.direction[j]) < np.cos(MIN_ALPHA)]
    i, j = data.draw(st.sampled_from(skew))
    span = data.draw(st.sampled_from([(0.0, 1.0), (0.2, 0.9), (0.5, 1.0)]))
    seen = [edge_of(part, i, T, span, data.draw(st.booleans())), edge_of(part, j, T, (0.0, 0.7), data.draw(st.booleans()))]
    found = matches(part, seen)
    nearest = min(displacement(T, pose_matrix(R, t), part) for R, t in zip(found.R, found.t, strict=True))
    assert nearest < 1e-6


def test_at_most_four_transforms_an_assignment_and_each_is_rigid():
    rng = np.random.default_rng(0)
    T = transform(Rotation.random(rng=rng).as_matrix(), (0, 0, 1))
    found = matches(L, [edge_of(L, k, T) for k in range(0, 18, 3)])
    _, counts = np.unique(np.c_[found.data, found.model], axis=0, return_counts=True)
    assert counts.max() <= 4
    assert np.allclose(found.R @ np.swapaxes(found.R, 1, 2), np.eye(3), atol=1e-9)
    assert np.allclose(np.linalg.det(found.R), 1.0)


def test_brute_force_finds_the_same_poses():
    """The oracle tries every assignment and every sign, and keeps transforms that lay both data edges into their model edges."""
    T = transform(Rotation.random(rng=np.random.default_rng(5)).as_matrix(), (0, 0, 1))
    seen = [edge_of(BRICK, SKEW[0], T, (0.1, 0.8)), edge_of(BRICK, SKEW[1], T, (0.3, 1.0))]
    seen = [DataEdge(e.kind, e.ends_sensor, e.ends_world, np.zeros((0, 3)), np.zeros((0, 3)), 50, 0.0) for e in seen]
    fast = [pose_matrix(R, t) for R, t in zip(*matches(BRICK, seen)[:2], strict=True)]
    slow = brute_force(BRICK, seen)
    assert slow and all(min(displacement(a, b, BRICK) for b in fast) < 1e-6 for a in slow)
    assert all(min(displacement(a, b, BRICK) for b in slow) < 0.004 for a in fast)


def brute_force(part, seen):
    edges, lines = model_edges(part), data_lines(tuple(seen))
    poses = []
    for (a, b), signs in product(permutations(range(len(edges.half)), 2), product((1, -1), repeat=2)):
        data = np.stack([s * lines.direction[k] for k, s in enumerate(signs)])
        model = edges.direction[[a, b]]
        if abs(model[0] @ model[1] - data[0] @ data[1]) > 1e-3 or abs(model[0] @ model[1]) > 0.9:
            continue
        R = Rotation.align_vectors(data, model)[0].as_matrix()
        # the translation that lays both lines on one another: perpendicular parts of two shifts must agree
        projectors = [np.eye(3) - np.outer(d, d) for d in data]
        shifts = [lines.middle[k] - R @ edges.middle[m] for k, m in enumerate((a, b))]
        A, g = np.concatenate(projectors), np.concatenate([P @ s for P, s in zip(projectors, shifts, strict=True)])
        t, *_ = np.linalg.lstsq(A, g, rcond=None)
        if np.abs(A @ t - g).max() > 1e-6:
            continue
        over = [abs((s - t) @ data[k]) + lines.half[k] - edges.half[m] for k, (s, m) in enumerate(zip(shifts, (a, b), strict=True))]
        if max(over) < 1e-6:
            poses.append(pose_matrix(R, t))
    return poses


def test_pairs_are_those_that_one_part_could_hold():
    """Every end within reach of the other's ends, by brute force; both surfaces of an edge on the side where they are."""
    rng = np.random.default_rng(2)
    seen = tuple(
        edge_of(L, int(k), transform(Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.1, 0.1, 3))) for k in rng.integers(0, 18, 30)
    )
    lines = data_lines(seen)
    pairs, parallels = data_pairs(lines, 0.12), data_parallels(lines, 0.12, MIN_ALPHA)
    found = {tuple(sorted(map(int, two))) for kind in (pairs, parallels) for two in zip(kind.first, kind.second, strict=True)}
    apart = {
        (i, j): max(np.linalg.norm(a - b) for a in seen[i].ends_sensor for b in seen[j].ends_sensor) for i, j in combinations(range(30), 2)
    }
    assert found == {two for two, distance in apart.items() if distance <= 0.12} and 5 < len(found) < len(apart)
    for i, edge in enumerate(seen):
        for k, (normal, inward) in enumerate(zip(edge.normals_sensor, edge.inward_sensor, strict=True)):
            assert lines.side[i, k] == np.sign(inward @ np.cross(normal, edge.direction)) and np.array_equal(lines.flank[i, k], normal)


def test_data_longer_than_any_model_edge_give_nothing():
    T = transform(translation=(0, 0, 1))
    found = matches(BRICK, [edge_of(BRICK, SKEW[0], T, (-1.0, 2.5)), edge_of(BRICK, SKEW[1], T, (-2.0, 3.0))])
    assert len(found.t) == 0 and found.tried > 0 and found.fell.sum() > 0


def test_symmetric_pairs_are_kept_once():
    everything = [
        (i, j) for i, j in permutations(range(12), 2) if abs(model_edges(BRICK).direction[i] @ model_edges(BRICK).direction[j]) < 0.5
    ]
    assert len(BRICK.symmetries) == 4
    assert len(model_pairs(BRICK).first) == len(everything) // 4
