"""Tolerances of pairs from their edges' own sigmas: as wide as the errors that such edges make, strict for long edges and lax for short."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handey_studio.geometry.lines import relative_pose
from handey_studio.geometry.transforms import transform
from handey_studio.localization.distinct import displacement
from handey_studio.localization.hypotheses import hypothesize
from handey_studio.localization.pairs import data_lines, data_pairs, data_parallels, model_edges, model_pairs
from handey_studio.localization.result import pose_matrix
from handey_studio.localization.single_hypotheses import hypothesize_single
from handey_studio.localization.tolerances import SIGMAS, MatchTolerances, allowed, allowed_apart, pair_sigmas, sure, tolerances
from handey_studio.sensing.depth_view import DepthView, Pinhole
from tests.localization.test_hypotheses import BRICK, SKEW, L, edge_of

LIMITS = MatchTolerances(np.deg2rad(10.0), 0.004, 0.005, float(np.cos(np.deg2rad(25.0))), 0.0005)


def noisy(edge, rng, offset, angle, flat=False):
    """An edge whose line is off its true one by these standard deviations; `flat`: in one direction of two only."""
    across = np.linalg.svd(edge.direction[None])[2][1:]
    shares = np.array([1.0, 0.0]) if flat else np.sqrt([0.5, 0.5])
    shift, turn = (rng.normal(0.0, sigma * shares) @ across for sigma in (offset, angle))
    half = (edge.ends_sensor[1] - edge.ends_sensor[0]) / 2
    middle = edge.ends_sensor.mean(axis=0) + shift
    along = edge.direction + turn
    half = np.linalg.norm(half) * along / np.linalg.norm(along)
    return replace(edge, ends_sensor=np.stack([middle - half, middle + half]), offset_sigma=offset, angle_sigma=angle)


@pytest.mark.parametrize("flat", [False, True], ids=["all ways", "one way"])
def test_errors_of_pairs_are_what_the_sigmas_say(flat):
    """Monte Carlo: many noisy readings of skew pairs of lines, near and far from their feet, square and slanted."""
    rng = np.random.default_rng(1)
    worst = np.zeros(4)
    for _ in range(12):
        a, b = (
            edge_of(L, int(rng.integers(18)), transform(Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.03, 0.03, 3))) for _ in "ab"
        )
        offsets, angles = rng.uniform(0.0001, 0.001, 2), rng.uniform(0.001, 0.01, 2)
        pair = data_pairs(
            data_lines(
                (replace(a, offset_sigma=offsets[0], angle_sigma=angles[0]), replace(b, offset_sigma=offsets[1], angle_sigma=angles[1]))
            ),
            1.0,
        )
        if not len(pair.d):
            continue
        lines = data_lines((noisy(a, rng, offsets[0], angles[0], flat), noisy(b, rng, offsets[1], angles[1], flat)))
        told = np.array([float(sigma[0]) for sigma in pair_sigmas(lines, pair)])
        drawn = [[noisy(edge, rng, o, n, flat) for edge, o, n in zip((a, b), offsets, angles, strict=True)] for _ in range(400)]
        middles, along = (
            np.array([[value(edge) for edge in two] for two in drawn])
            for value in (lambda e: e.ends_sensor.mean(axis=0), lambda e: e.direction)
        )
        found = relative_pose(middles[:, 0], along[:, 0], middles[:, 1], along[:, 1])
        spread = np.array([np.std(values) for values in (found.alpha, found.d, found.foot1, found.foot2)])
        assert (spread < 1.2 * told).all(), (spread, told)
        worst = np.maximum(worst, spread / told)
    assert (worst > 0.6).all(), "and not far wider than the errors"


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 9999), span=st.sampled_from([(0.0, 1.0), (0.2, 0.9), (0.4, 1.0)]))
def test_noisy_edges_still_give_the_true_pose(seed, span):
    rng = np.random.default_rng(seed)
    T = transform(Rotation.random(rng=rng).as_matrix(), (0.1, -0.2, 0.9))
    seen = [noisy(edge_of(BRICK, k, T, span), rng, 0.0003, 0.005) for k in SKEW]
    lines = data_lines(tuple(seen))
    found = hypothesize(model_edges(BRICK), model_pairs(BRICK), lines, data_pairs(lines, np.inf), LIMITS, 5000)
    off = min((displacement(T, pose_matrix(R, t), BRICK) for R, t in zip(found.R, found.t, strict=True)), default=np.inf)
    assert off < 0.006


def test_long_clean_edges_are_strict_and_short_ones_lax_within_the_limits():
    T = transform(translation=(0, 0, 1))

    def tolerated(offset, angle):
        lines = data_lines(tuple(replace(edge_of(BRICK, k, T), offset_sigma=offset, angle_sigma=angle) for k in SKEW))
        return [float(values[0]) for values in allowed(lines, data_pairs(lines, 1.0), LIMITS)]

    clean, worse, wild = tolerated(0.0001, 0.001), tolerated(0.0008, 0.01), tolerated(1.0, 1.0)
    assert all(a < b <= c for a, b, c in zip(clean, worse, wild, strict=True))
    assert clean[0] < np.deg2rad(1.5) and clean[1] < 0.0012
    assert np.allclose(wild, [LIMITS.angle, LIMITS.offset, LIMITS.reach, LIMITS.reach])


def test_an_angle_must_be_sure_for_the_size_of_the_part():
    edges, T = model_edges(BRICK), transform(translation=(0, 0, 1))
    lines = data_lines(tuple(replace(edge_of(BRICK, k, T), angle_sigma=angle) for k, angle in zip(SKEW, (0.001, 0.11), strict=True)))
    small = edges._replace(middle=edges.middle / 2, half=edges.half / 2)
    one, other = np.array([0, 0, 1]), np.array([0, 1, 1])
    assert sure(edges, lines, one, other, LIMITS).tolist() == [True, False, False]
    assert sure(small, lines, one, other, LIMITS).tolist() == [True, True, False]
    pairs = data_pairs(lines, 1.0)
    assert hypothesize(edges, model_pairs(BRICK), lines, pairs, LIMITS, 5000).tried == 0
    assert set(hypothesize_single(edges, lines, LIMITS, 5000).data[:, 0]) == {0}


def test_parallel_edges_that_lie_far_ahead_of_one_another_are_less_sure_of_their_distance():
    parallel = [k for k in range(12) if abs(model_edges(BRICK).direction[k] @ model_edges(BRICK).direction[0]) > 0.99][:2]
    T = transform(translation=(0, 0, 1))

    def tolerated(span):
        seen = (edge_of(BRICK, parallel[0], T, (0.0, 0.2)), edge_of(BRICK, parallel[1], T, span))
        lines = data_lines(tuple(replace(edge, offset_sigma=0.0002, angle_sigma=0.02) for edge in seen))
        return float(allowed_apart(lines, data_parallels(lines, 1.0, 0.1), LIMITS)[0])

    assert tolerated((0.0, 0.2)) < tolerated((0.8, 1.0)) <= LIMITS.offset
    assert tolerated((0.0, 0.2)) == pytest.approx(SIGMAS * np.hypot(np.hypot(0.0002, 0.0002), 0.0005))


def test_limits_grow_with_what_the_view_leaves_unsure():
    fine, coarse = (
        tolerances(DepthView(np.ones((2, 2)), Pinhole(1.0, 1.0, 0, 0), np.eye(4), n, o)) for n, o in ((0.0005, 0.001), (0.001, 0.003))
    )
    assert coarse.reach > fine.reach and coarse.offset > fine.offset and coarse.unsure > fine.unsure
