"""Random piles are at rest, in view, graspable, and the same for the same seed; their destination is a place to stand."""

from itertools import combinations

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.scenes.fitness import graspable, visible_share
from handey_studio.cell.scenes.piles import PileOptions, destination, random_pile
from handey_studio.cell.truth import true_bodies
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, pose_difference, transform
from handey_studio.sensing.stripes.range_finder import RangeFinder
from tests.cell.overlaps import body_overlap


@pytest.mark.parametrize(("seed", "part"), [(0, "l_block"), (1, "stairs"), (2, "wedge"), (3, "t_block")])
def test_a_pile_is_at_rest_in_view_and_can_be_moved(seed, part, library, robot):
    pile = random_pile(seed, part, library)
    bodies = true_bodies(pile.workcell, library)
    free = [body for body in bodies if not body.fixed]
    assert 4 <= len(free) - 1 <= 8 and sum(body.name == part for body in free) == 1
    assert all(0.02 <= side <= 0.06 for body in free if body.name != part for side in np.ptp(body.solid.vertices, axis=0))
    assert all(body_overlap(a, b) < 5e-4 for a, b in combinations(bodies, 2))
    assert settle(bodies).resting
    inside = apply(inverse(pile.workcell.finder.T_world_range), np.concatenate([body.corners_world for body in free]))
    assert (inside[:, :2] > 0).all() and (inside[:, :2] < pile.workcell.finder.area).all()
    target = next(body for body in free if body.name == part)
    assert visible_share(pile.workcell.finder, bodies, target) >= 0.75
    assert graspable(robot.hand, target, bodies)


@pytest.mark.parametrize(("seed", "part"), [(4, "bracket"), (5, "brick")])
def test_the_destination_is_the_same_side_down_on_free_table_in_reach(seed, part, library, robot):
    pile = random_pile(seed, part, library)
    bodies = true_bodies(pile.workcell, library)
    target = next(body for body in bodies if body.name == part)
    numbers = [float(word) for word in pile.to.split(",")]
    typed = from_xyz_rpy(numbers[:3], np.deg2rad(numbers[3:]))
    assert pose_difference(typed, pile.T_world_goal)[0] < 1e-6 and np.abs(typed - pile.T_world_goal).max() < 1e-5
    there = target.at(pile.T_world_goal)
    assert there.corners_world[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(pile.T_world_goal[2, :3], target.T_world_body[2, :3], atol=1e-9)
    outside = apply(inverse(pile.workcell.finder.T_world_range), there.corners_world)[:, 1]
    assert (outside < 0).all() or (outside > pile.workcell.finder.area[1]).all()
    assert np.linalg.norm(there.corners_world[:, :2], axis=1).max() < 0.75
    stood = settle([*(body for body in bodies if body.fixed), there]).bodies[-1]
    assert pose_difference(stood.T_world_body, pile.T_world_goal)[0] < 1e-3


def test_a_seed_gives_the_same_pile_and_another_seed_another(library):
    first, second, other = (random_pile(seed, "brick", library) for seed in (11, 11, 12))
    assert first == second and first.to == second.to
    assert first.workcell.setup.bodies != other.workcell.setup.bodies


def test_when_no_pile_fits_a_sentence_says_so(library):
    with pytest.raises(BadInput, match="3 attempts"):
        random_pile(0, "brick", library, options=PileOptions(attempts=3, visible=1.1))


def test_a_buried_part_is_neither_in_view_nor_graspable(robot):
    target = SolidBody("part", box((0.04, 0.04, 0.03)), transform(None, (0.48, 0, 0.015)))
    lid = SolidBody("lid", box((0.1, 0.1, 0.02)), transform(None, (0.48, 0, 0.04)))
    walls = [SolidBody(f"wall{x}", box((0.04, 0.04, 0.03)), transform(None, (0.48 + x, 0, 0.015))) for x in (-0.0402, 0.0402)]
    walls += [SolidBody(f"side{y}", box((0.04, 0.04, 0.03)), transform(None, (0.48, y, 0.015))) for y in (-0.0402, 0.0402)]
    assert visible_share(RangeFinder(), [target], target) == 1.0 and graspable(robot.hand, target, [target])
    assert visible_share(RangeFinder(), [target, lid], target) < 0.05 and not graspable(robot.hand, target, [target, lid])
    assert visible_share(RangeFinder(), [target, *walls], target) > 0.5 and not graspable(robot.hand, target, [target, *walls])


def test_a_destination_reads_back(library):
    T = from_xyz_rpy((0.4, -0.3, 0.02), np.deg2rad((90.0, 0.0, -170.0)))
    assert destination(T) == "0.400000,-0.300000,0.020000,90.0000,0.0000,-170.0000"
