"""What counts as past recovery, by the truth; seeds shared out among processes; and what a table of faults comes to."""

from dataclasses import replace

import numpy as np

from handey_studio.cell.physics.physical import PhysicalCell
from handey_studio.cell.workcell import SimulatedSetup, TrueBody
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.task.bench.act import summarise_faults
from handey_studio.task.bench.judge import past_recovery
from handey_studio.task.bench.shared_out import shared_out
from tests.task.troubled import COMMAND, LIBRARY, station, workcell

LIES = from_xyz_rpy((0.46, -0.08, 0.015), (0.0, 0.0, 0.4))


def judged(T_world_brick, *others: TrueBody) -> str:
    setup = SimulatedSetup((TrueBody("brick", T_world_brick, part="brick"), *others), physics=True)
    return past_recovery(station(), PhysicalCell(replace(workcell(), setup=setup), LIBRARY), COMMAND, 0)


def test_a_part_in_the_open_can_be_moved_still():
    assert judged(LIES) == ""


def test_a_part_that_nobody_sees_is_past_recovery():
    assert "beyond the range finder's view" in judged(from_xyz_rpy((0.2, 0.3, 0.015)))
    lid = TrueBody("lid", from_xyz_rpy((0.46, -0.08, 0.035)), size=np.array([0.12, 0.12, 0.01]))
    assert "of the part show" in judged(LIES, lid)


def test_seeds_come_back_in_their_order_from_one_process_or_two():
    assert list(shared_out(abs, range(-3, 3), 1)) == [3, 2, 1, 0, 1, 2] == list(shared_out(abs, range(-3, 3), 2))


def test_faults_are_counted_by_kind_and_in_all():
    def row(fault: str, noticed: bool, status: str, right: bool, recoverable: bool = True) -> dict:
        wrong = status == "done" and not right
        return {"fault": fault, "noticed": noticed, "status": status, "right": right, "recoverable": recoverable, "wrong_done": wrong}

    rows = [row("slip", True, "done", True), row("slip", False, "done", True), row("slip", True, "failed", False, False)]
    rows += [row("bias", False, "done", False), row("bias", True, "failed", False)]
    counts = summarise_faults(rows)
    assert list(counts) == ["slip", "bias", "all"]
    assert counts["slip"] == {"moves": 3, "mattered": 2, "noticed": 2, "recoverable": 1, "recovered": 1, "wrong_done": 0}
    assert counts["all"] == {"moves": 5, "mattered": 4, "noticed": 3, "recoverable": 3, "recovered": 1, "wrong_done": 1}
