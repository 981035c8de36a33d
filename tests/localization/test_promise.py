"""What is worth refining: the true pose comes before all that the view contradicts, and a glance lets nothing fall that is half hidden."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, inverse
from handey_studio.localization import LocateOptions
from handey_studio.localization.glance import GLANCE, spreading, unopposed
from handey_studio.localization.promise import FITTED, promise_features
from handey_studio.localization.samples import part_samples
from handey_studio.localization.search import look
from handey_studio.localization.verify import verify
from handey_studio.world import Part
from tests.localization.rendering import map_from_above

BRICK, SLAB = Part("brick", box((0.08, 0.05, 0.04))), Part("slab", box((0.16, 0.12, 0.03)))
STANDING = from_xyz_rpy((0.45, 0.05, 0.02), (0.0, 0.0, 0.4))


@pytest.fixture(scope="module")
def search():
    view = map_from_above([(BRICK.solid, STANDING), (SLAB.solid, from_xyz_rpy((0.52, -0.12, 0.015)))], np.random.default_rng(1)).view()
    return look(view, LocateOptions())


@pytest.mark.parametrize("stage", ["rough", "refined"])
def test_the_true_pose_promises_most(search, stage):
    """Against one that floats, one that is sunk, one turned, one shifted, one laid flat inside a bigger face, and one on the bare table."""
    off = [(0, 0, 0.02, 0), (0, 0, -0.02, 0), (0, 0, 0, 0.6), (0.02, 0, 0, 0)]
    wrong = [STANDING @ from_xyz_rpy(shift, (0, 0, turn)) for *shift, turn in off]
    wrong += [from_xyz_rpy((0.52, -0.12, 0.01)), from_xyz_rpy((0.36, 0.12, 0.02))]
    T = inverse(search.view.T_world_sensor) @ np.array([STANDING, *wrong])
    R, t = np.ascontiguousarray(T[:, :3, :3]), np.ascontiguousarray(T[:, :3, 3])
    limits = search.rough if stage == "rough" else search.limits
    features = promise_features(search, BRICK, R, t, verify(R, t, part_samples(BRICK), search.evidence, limits))
    promise = features @ getattr(FITTED, stage)
    assert np.isfinite(features).all() and promise[0] > promise[1:].max() + 2.0


def test_a_glance_rules_out_what_is_seen_through_and_not_what_is_hidden():
    """A brick of which a slab above leaves a strip in view, at every place in the list, beside one that hangs in the air."""
    over = from_xyz_rpy((0.45, -0.005, 0.06), (0.0, 0.0, 0.4))
    view = map_from_above([(BRICK.solid, STANDING), (SLAB.solid, over)], np.random.default_rng(3)).view()
    search, samples = look(view, LocateOptions()), part_samples(BRICK)
    T = inverse(view.T_world_sensor) @ np.array([STANDING] * 40 + [from_xyz_rpy((0.60, -0.14, 0.1))] * 40)
    kept = unopposed(T[:, :3, :3], T[:, :3, 3], samples, search.evidence, search.rough)
    assert kept.tolist() == list(range(40))


@given(st.integers(1, 3000))
@settings(max_examples=100, deadline=None)
def test_a_glance_comes_to_every_point_and_to_far_ones_first(count):
    step = spreading(count)
    places = (np.arange(count) * step) % count
    assert len(set(places.tolist())) == count
    if count > 4 * GLANCE:
        assert np.diff(np.sort(places[:GLANCE])).max() < 0.4 * count


def test_a_glance_lets_a_part_stand_whose_faces_are_all_margin():
    """No point of a narrow bar is as far from its rims as sensors lose readings there; it is ruled out only where nothing lies on it."""
    bar, lying, hanging = Part("bar", box((0.08, 0.008, 0.008))), from_xyz_rpy((0.45, 0.05, 0.004)), from_xyz_rpy((0.60, -0.14, 0.1))
    view = map_from_above([(bar.solid, lying)], np.random.default_rng(4)).view()
    search, samples = look(view, LocateOptions()), part_samples(bar)
    T = inverse(view.T_world_sensor) @ np.array([lying] * 20 + [hanging] * 20)
    kept = unopposed(T[:, :3, :3], T[:, :3, 3], samples, search.evidence, search.rough._replace(edge=0.006))
    assert samples.face_rim.max() < 0.006 and kept.tolist() == list(range(20))
