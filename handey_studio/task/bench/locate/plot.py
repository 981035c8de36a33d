"""A figure of a `bench locate` table: recall against visible fraction, precision and seconds, a colour a method."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from handey_studio.base import BadInput
from handey_studio.task.bench.locate.summary import BINS

SUFFIXES = (".png", ".svg", ".pdf")
COLOURS = ("#1b5e9e", "#d1741f", "#a8482e", "#5b7f3b", "#7a5195", "#4d4d4d")
MISSING = "a plot needs matplotlib: pip install 'handey-studio[bench]'."


def check_plot(path: Path | None) -> None:
    """Raises BadInput before any work is done when no plot can be made there."""
    if path is None:
        return
    if path.suffix.lower() not in SUFFIXES:
        raise BadInput(f'plot "{path}" has the suffix "{path.suffix}"; it must be one of {", ".join(SUFFIXES)}.')
    if find_spec("matplotlib") is None:
        raise BadInput(MISSING)


def plot(summary: dict[str, Any], path: Path) -> None:
    """Draw a summary into a PNG, SVG or PDF file. Raises BadInput when matplotlib is missing or the file cannot be written."""
    check_plot(path)
    import_module("matplotlib").use("Agg")
    pyplot: Any = import_module("matplotlib.pyplot")
    figure, (recall, precision, seconds) = pyplot.subplots(1, 3, figsize=(13, 4.4), width_ratios=(2.2, 1, 1), layout="constrained")
    colours: dict[str, str] = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(summary)}
    _recall(recall, summary, colours)
    _bars(precision, {name: 100 * (numbers["precision"] or 0.0) for name, numbers in summary.items()}, colours, "{:.1f} %")
    precision.set(title="precision of reported poses", xlim=(0, 118), xlabel="%")
    _bars(seconds, {name: 1e3 * numbers["seconds"]["median"] for name, numbers in summary.items()}, colours, "{:.0f} ms")
    longest = max(numbers["seconds"]["median"] for numbers in summary.values())
    seconds.set(title="median time a part", xscale="log", xlim=(10, 1e4 * longest), xlabel="ms")
    seconds.set_yticklabels([])
    try:
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise BadInput(f'"{path}" cannot be written: {error.strerror}.') from None
    finally:
        pyplot.close(figure)


def _recall(axes: Any, summary: dict[str, Any], colours: dict[str, str]) -> None:
    """First answers of everyone; of methods that report several poses also all instances. How many questions a bin holds stands below."""
    for name, numbers in summary.items():
        _line(axes, numbers["bins"], "first", colours[name], "-o", f"{name}, first answer")
        if numbers["most_poses"] > 1:
            _line(axes, numbers["bins"], "instances", colours[name], "--s", f"{name}, all instances")
    for cell in next(iter(summary.values()))["bins"]:
        text = f"{cell['instances']['count']}\n{cell['first']['count']}"
        axes.annotate(text, (100 * (cell["from"] + 0.5 / BINS), -15), ha="center", fontsize=7, color="#666666", annotation_clip=False)
    axes.axvline(25, color="#bbbbbb", lw=0.8)
    axes.axvline(50, color="#bbbbbb", lw=0.8)
    axes.set(title="recall by visible fraction (below: instances, questions)", xlim=(0, 100), ylim=(-18, 103))
    axes.set(xlabel="visible fraction of the instance, of the best visible one for first answers [%]", ylabel="%", yticks=range(0, 101, 20))
    axes.grid(axis="y", color="#eeeeee")
    axes.legend(loc="center right", fontsize=8, frameon=False)


def _line(axes: Any, bins: list[dict[str, Any]], kind: str, colour: str, style: str, label: str) -> None:
    at = [100 * (cell["from"] + 0.5 / BINS) for cell in bins]
    shares = [np.nan if cell[kind]["share"] is None else 100 * cell[kind]["share"] for cell in bins]
    axes.plot(at, shares, style, color=colour, ms=4, lw=1.5, label=label, markerfacecolor=colour if style == "-o" else "white")


def _bars(axes: Any, values: dict[str, float], colours: dict[str, str], text: str) -> None:
    bars = axes.barh(list(values), list(values.values()), color=[colours[name] for name in values], height=0.6)
    axes.bar_label(bars, [text.format(value) for value in values.values()], padding=3, fontsize=8)
    axes.invert_yaxis()
    axes.spines[["top", "right"]].set_visible(False)
