"""Every method's answers for the parts of every scene, judged; the table as JSON values."""

import os
import platform
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import Any

from handey_studio.base import Progress, Silent
from handey_studio.task.bench.locate.answers import Answer, Method, warm_up
from handey_studio.task.bench.locate.judgement import Judge
from handey_studio.task.bench.locate.labelled_scenes import LabelledScene
from handey_studio.task.bench.locate.summary import Row, summarise, table
from handey_studio.world.part import Part


def bench_locate(
    scenes: Iterable[LabelledScene],
    methods: Sequence[Method],
    tell: Callable[[str], None],
    progress: Progress | None = None,
    count: int | None = None,
) -> dict[str, Any]:
    """Ask every method for every part of every scene, tell a line a scene and the table at the end. `count` is how many scenes come.

    A question that is not counted comes first, so that no compiling is measured. Cancelled, it sums up what was asked so far.
    """
    progress = progress or Silent()
    rows: list[Row] = []
    for number, scene in enumerate(scenes):
        if progress.cancelled:
            break
        progress.report(number / (count or number + 1), f"scene {scene.name}: {len(scene.parts)} parts")
        if number == 0:
            warm_up(methods, scene)
        asked = [row for method in methods for row in _rows(scene, method)]
        tell(_line(scene, asked))
        rows += asked
    summary = summarise(rows)
    for line in table(summary) if rows else ["no scene was measured"]:
        tell(line)
    machine = {"cpus": os.cpu_count(), "python": platform.python_version()}
    return {"schema": "handey/bench/locate/1", "machine": machine, "summary": summary, "rows": rows}


def _rows(scene: LabelledScene, method: Method) -> list[Row]:
    """A method's answers for a scene's parts, and what the scene's judge says of each."""
    method.see(scene)
    return [_row(scene, part, method.name, answer) for part, answer in zip(scene.parts, method.locate(scene.parts), strict=True)]


def _row(scene: LabelledScene, part: Part, method: str, answer: Answer) -> Row:
    row = {"scene": scene.name, "part": part.name, "method": method, "seconds": answer.seconds, "reason": answer.reason}
    return row | judged(scene.judge, part.name, answer)


def judged(judge: Judge, part: str, answer: Answer) -> dict[str, Any]:
    """The reported poses with their verdicts, and the true instances with whether they were found."""
    verdicts = judge.verdicts(part, [pose.T_sensor_part for pose in answer.poses])
    found = {verdict.matches for verdict in verdicts}
    strictly = {verdict.matches for verdict in verdicts if verdict.strict}
    return {
        "poses": [
            {"T_sensor_part": pose.T_sensor_part.tolist(), "score": pose.score} | asdict(verdict)
            for pose, verdict in zip(answer.poses, verdicts, strict=True)
        ],
        "instances": [
            asdict(instance) | {"found": number in found, "found_strict": number in strictly}
            for number, instance in enumerate(judge.instances(part))
        ],
    }


def _line(scene: LabelledScene, rows: Sequence[Row]) -> str:
    """A scene in a line: of each method the first answers that are right, false finds and seconds a part."""
    words = []
    for name in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == name]
        right = sum(bool(row["poses"]) and row["poses"][0]["right"] for row in mine if row["instances"])
        false = sum(not pose["right"] for row in mine for pose in row["poses"])
        present = sum(bool(row["instances"]) for row in mine)
        seconds = sum(row["seconds"] for row in mine) / max(len(mine), 1)
        words.append(f"{name} {right} of {present} right, {false} false, {seconds:.2f} s")
    return f"{scene.name}: {'; '.join(words)}"
