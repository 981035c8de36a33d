"""Programs as CSV: one row a sample, numbers written so that they read back as the same."""

import csv
import io

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.task.export.program import Program, ProgramStep, check_names, kind_of
from handey_studio.task.plan import StepKind

LEAD = ("step", "kind", "time_s", "step_time_s")
ANGLE, OPENING = "_rad", "hand_opening_m"


def csv_text(program: Program) -> str:
    """A header and a row a sample: step (from 1), kind, time from the program's and from the step's start, joints, opening."""
    out, begun = io.StringIO(), 0.0
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow([f"# robot {program.robot}"])
    rows.writerow([*LEAD, *(name + ANGLE for name in program.joint_names), OPENING])
    for number, step in enumerate(program.steps, start=1):
        for time, q, opening in zip(step.time_s.tolist(), step.q_rad.tolist(), step.opening_m.tolist(), strict=True):
            rows.writerow([number, step.kind, repr(begun + time), repr(time), *map(repr, q), repr(opening)])
        begun += float(step.time_s[-1])
    return out.getvalue()


def read_csv(text: str) -> Program:
    """The program that `csv_text` wrote. Raises BadInput with the line that is wrong."""
    try:
        lines = list(csv.reader(io.StringIO(text)))
    except csv.Error as error:
        raise BadInput(f"it is no table: {error}.") from None
    if len(lines) < 3 or len(lines[0]) != 1 or not lines[0][0].startswith("# robot ") or tuple(lines[1][:4]) != LEAD:
        raise BadInput(f"it is no table of a program: it begins with a line of the robot and the columns {', '.join(LEAD)}.")
    names = tuple(column.removesuffix(ANGLE) for column in lines[1][4:-1])
    robot = lines[0][0].removeprefix("# robot ")
    check_names(robot, names)
    rows: dict[int, list[list[float]]] = {}
    kinds: dict[int, StepKind] = {}
    for line, row in enumerate(lines[2:], start=3):
        try:
            number, kind, values = int(row[0]), kind_of(row[1]), [float(word) for word in row[3:]]
        except BadInput:
            raise
        except (ValueError, IndexError):
            raise BadInput(f"line {line} of the table holds something that is no number.") from None
        if len(values) != len(names) + 2:
            raise BadInput(f"line {line} of the table has {len(row)} columns; it takes {len(names) + 5}.")
        rows.setdefault(number, []).append(values)
        kinds[number] = kind
    return Program(robot, names, tuple(_step(kinds[number], np.array(rows[number])) for number in sorted(rows)))


def _step(kind: StepKind, values: NDArray) -> ProgramStep:
    return ProgramStep(kind, values[:, 0], values[:, 1:-1], values[:, -1])
