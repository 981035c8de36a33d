"""MOVEs that can be done by construction: the part can be told apart from above, and the scene is the same for the same seed."""

import numpy as np
import pytest

from handey_studio.cell.scenes.alike import seen_alike
from handey_studio.cell.scenes.solvable import solvable_move
from handey_studio.geometry import prism
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.grasping import stable_placements
from handey_studio.world import Part

L = [(0, 0), (0.06, 0), (0.06, 0.03), (0.03, 0.03), (0.03, 0.07), (0, 0.07)]


def test_an_l_on_its_legs_end_looks_alike_from_above_and_nothing_else_of_it_does():
    part = Part("l", prism(L, 0.04))
    names = {placement.name: alike for placement, alike in zip(stable_placements(part)[0], seen_alike(part), strict=True)}
    assert names.pop("−y up") and not any(names.values())


def test_a_notch_that_light_reaches_tells_it_apart():
    widened = [(0, 0), (0.06, 0), (0.06, 0.03), (0.03, 0.03), (0.035, 0.07), (0, 0.07)]
    part = Part("leaning", prism([(x - 0.05 * y, y) for x, y in widened], 0.04))
    assert not any(seen_alike(part))


@pytest.mark.parametrize("name", ["brick", "t_block"])
def test_what_is_symmetric_is_not_taken_for_another(name, library):
    assert not any(seen_alike(library.part(name)))


def test_the_part_starts_as_can_be_told_from_above(library):
    """Seed 78 draws the L on its leg's end first."""
    pile = solvable_move(78, "l_block", library)
    part = library.part("l_block")
    T = next(body.T_world_body for body in pile.workcell.setup.bodies if body.name == "l_block")
    placements = stable_placements(part)[0]
    ups = [inverse(placed.T_plane_part)[:3, 2] for placed in placements]
    k = int(np.argmax([up @ T[2, :3] for up in ups]))
    assert not seen_alike(part)[k]
    again = solvable_move(78, "l_block", library)
    assert all(
        (a.T_world_body == b.T_world_body).all() for a, b in zip(pile.workcell.setup.bodies, again.workcell.setup.bodies, strict=True)
    )
    assert apply(T, part.solid.vertices)[:, 2].min() == pytest.approx(0.0, abs=1e-3)
