"""A figure of a `bench motion` table: how many problems were solved within a time, how long the paths are, and how many collide."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from handey_studio.base import BadInput
from handey_studio.task.bench.locate.plot import COLOURS, check_plot
from handey_studio.task.bench.motion.summary import Row


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw rows, but those whose ends are not free, into a PNG, SVG or PDF file. Raises BadInput without matplotlib or a place to write."""
    check_plot(path)
    import_module("matplotlib").use("Agg")
    pyplot: Any = import_module("matplotlib.pyplot")
    figure, (times, lengths, collisions) = pyplot.subplots(1, 3, figsize=(13, 4.2), width_ratios=(1.6, 1.6, 1), layout="constrained")
    methods = list(dict.fromkeys(row["method"] for row in rows))
    for number, method in enumerate(methods):
        mine, colour = [row for row in rows if row["method"] == method and row["ends_free"]], COLOURS[number % len(COLOURS)]
        found = [row for row in mine if row["found"]]
        shares = 100 * (np.arange(len(found)) + 1) / max(len(mine), 1)
        times.step(
            sorted(row["seconds"] for row in found), shares, where="post", color=colour, label=f"{method}: {len(found)} of {len(mine)}"
        )
        lengths.step(sorted(row["length_rad"] for row in found), shares, where="post", color=colour)
        bars = collisions.barh([method], [sum(bool(row["collisions"]) for row in found)], color=colour, height=0.6)
        collisions.bar_label(bars, padding=3, fontsize=8)
    times.set(title="solved within", xlabel="s", ylabel="% of problems", xscale="log", ylim=(0, 103))
    lengths.set(title="paths no longer than", xlabel="rad in joint space", ylim=(0, 103))
    collisions.set(title="paths that collide", xlabel="looked at every 0.002 rad")
    collisions.invert_yaxis()
    times.legend(fontsize=8, frameon=False, loc="lower right")
    for axes in (times, lengths, collisions):
        axes.spines[["top", "right"]].set_visible(False)
    try:
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise BadInput(f'"{path}" cannot be written: {error.strerror}.') from None
    finally:
        pyplot.close(figure)
