"""What was touched, and how hard: fed by hand, and by a held block that is driven into a wall."""

import numpy as np

from handey_studio.cell.physics.touches import Touches, normal_forces

TABLE, ROBOT, LEFT, RIGHT, PART, OTHER = range(6)


def felt(*steps: list[tuple[int, int, float]]) -> dict:
    touches = Touches(np.isin(np.arange(6), (ROBOT, LEFT, RIGHT)), (LEFT, RIGHT))
    touches.stands(np.array([(PART, TABLE), (OTHER, TABLE)]))
    for step in steps:
        owners = np.array([pair[:2] for pair in step], dtype=int).reshape(-1, 2)
        touches.feel(owners, np.array([pair[2] for pair in step]), np.arange(len(step)))
    return touches.most


def test_the_greatest_force_of_each_pair_is_kept_and_the_robot_comes_first():
    assert felt([(PART, LEFT, 3.0)], [(LEFT, PART, 5.0)], [(PART, LEFT, 1.0)]) == {(LEFT, PART): 5.0}
    assert felt([(OTHER, ROBOT, 2.0), (PART, TABLE, 7.0)]) == {(ROBOT, OTHER): 2.0}


def test_only_what_both_fingers_press_on_counts_as_held_and_what_it_stood_on_does_not_count():
    grip = [(LEFT, PART, 40.0), (RIGHT, PART, 40.0)]
    assert felt([(LEFT, PART, 40.0), (OTHER, PART, 2.0)]) == {(LEFT, PART): 40.0}
    assert felt([*grip, (TABLE, PART, 8.0), (OTHER, PART, 2.0)]) == {(LEFT, PART): 40.0, (RIGHT, PART): 40.0, (PART, OTHER): 2.0}


def test_a_contact_without_constraint_has_no_force():
    assert normal_forces(np.array([3.0, 0.0, 0.0, 0.0, 5.0]), np.array([4, -1, 0])).tolist() == [5.0, 0.0, 3.0]
    assert normal_forces(np.empty(0), np.array([-1])).tolist() == [0.0]
