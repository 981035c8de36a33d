"""What rests on a part that was found is as probable as what rests on the table; what floats, or would fall, is not."""

import numpy as np
import pytest

from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.localization import LocateOptions, localize
from handey_studio.localization.accept import accept
from handey_studio.localization.candidates import candidates_of
from handey_studio.localization.score import FEET
from handey_studio.localization.search import look
from handey_studio.localization.standing import held_up
from handey_studio.world import Part
from tests.localization.rendering import map_from_above

LOWER, UPPER = Part("lower", box((0.12, 0.08, 0.04))), Part("upper", box((0.07, 0.05, 0.03)))
BELOW, WIDE = from_xyz_rpy((0.47, 0.02, 0.02), (0.0, 0.0, 0.3)), LocateOptions(min_score=0.01)


def view_of(*upper):
    return map_from_above([(LOWER.solid, BELOW), *((UPPER.solid, T) for T in upper)], np.random.default_rng(2)).view()


def rests(T) -> bool:
    """Whether the likeliest reading of the upper part near T is held up by the lower one."""
    search = look(view_of(T), WIDE)
    made = [*candidates_of(search, LOWER)[:1], *candidates_of(search, UPPER)]
    near = [n for n, one in enumerate(made) if n and np.linalg.norm((search.view.T_world_sensor @ [*one.t, 1.0])[:3] - T[:3, 3]) < 0.004]
    best = max(near, key=lambda n: made[n].score.odds)
    assert not made[best].score.features[FEET].all(), "it does not rest on the table"
    return best in held_up(search, made, [0], 0.0)


@pytest.mark.parametrize("yaw", [0.0, 0.8])
def test_a_part_on_a_part_is_found_and_sure(yaw):
    there = from_xyz_rpy((0.48, 0.04, 0.055), (0.0, 0.0, yaw))
    poses = localize(view_of(there), [LOWER, UPPER]).poses
    assert {pose.part for pose in poses} == {"lower", "upper"} and min(pose.score for pose in poses) > 0.9
    assert np.linalg.norm(next(p for p in poses if p.part == "upper").T_world_part[:3, 3] - there[:3, 3]) < 0.001


def test_what_lies_on_a_part_rests():
    assert rests(from_xyz_rpy((0.48, 0.04, 0.055), (0.0, 0.0, 0.8)))


@pytest.mark.parametrize("where", [(0.48, 0.04, 0.075), (0.515, 0.085, 0.055)])
def test_what_floats_or_would_fall_does_not(where):
    assert not rests(from_xyz_rpy(where, (0.0, 0.0, 0.8)))


def test_what_rests_lets_its_rivals_rest_too():
    """Seen from above a box on a box could be a thinner one that floats: which of the two it is, the pile does not tell."""
    box_on_it, thinner = Part("box", box((0.07, 0.05, 0.03))), Part("thinner", box((0.07, 0.05, 0.026)))
    search = look(view_of(from_xyz_rpy((0.48, 0.04, 0.055), (0.0, 0.0, 0.8))), LocateOptions())
    made = [*candidates_of(search, LOWER)[:1], candidates_of(search, box_on_it)[0], candidates_of(search, thinner)[0]]
    ratio = np.exp(made[2].score.odds - made[1].score.odds)
    found = {pose.part: pose for pose in accept(search, made)[0]}
    told = {name: pose.score for name, pose in found.items()} | {r.part: r.probability for pose in found.values() for r in pose.rivals}
    assert told["thinner"] / told["box"] == pytest.approx(ratio, rel=0.05)
