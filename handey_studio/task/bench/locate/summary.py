"""What many answers say together: recall by visible fraction, precision, pose errors, seconds."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

Row = dict[str, Any]
BINS = 10  # of visible fraction
COUNTED = 0.25  # instances with less of them visible count in no recall target, but finding them is not false
PLAIN = 0.5


def summarise(rows: Sequence[Row]) -> dict[str, Any]:
    """Numbers of each method, by name, in the order in which they come; None where there is nothing to count."""
    return {name: _of_method([row for row in rows if row["method"] == name]) for name in dict.fromkeys(row["method"] for row in rows)}


def _of_method(rows: Sequence[Row]) -> dict[str, Any]:
    poses = [pose for row in rows for pose in row["poses"]]
    right = [pose for pose in poses if pose["right"]]
    absent = [row for row in rows if not row["instances"]]
    present = [row for row in rows if row["instances"]]
    return {
        "questions": len(rows),
        "present": len(present),
        "first_right": sum(_first_right(row) for row in present),
        "absent": len(absent),
        "absent_found": sum(bool(row["poses"]) for row in absent),
        "recall_plain": _recall(rows, PLAIN, np.inf),
        "recall_half_hidden": _recall(rows, COUNTED, PLAIN),
        "recall_plain_strict": _recall(rows, PLAIN, np.inf, "found_strict"),
        "first_plain": _first_recall(rows, PLAIN, np.inf),
        "first_half_hidden": _first_recall(rows, COUNTED, PLAIN),
        "bins": [_bin(rows, k / BINS, (k + 1) / BINS) for k in range(BINS)],
        "poses": len(poses),
        "most_poses": max((len(row["poses"]) for row in rows), default=0),
        "precision": _share(pose["right"] for pose in poses),
        "false_share": _share(not pose["right"] for pose in poses),
        "off_mm": _spread(pose["off_mm"] for pose in right),
        "off_deg": _spread(pose["off_deg"] for pose in right),
        "seconds": _spread(row["seconds"] for row in rows),
    }


def _bin(rows: Sequence[Row], low: float, high: float) -> dict[str, Any]:
    """Recall of instances, and of first answers by the best visible instance of the part that was asked for."""
    high = np.inf if high == 1.0 else high
    found, first = _recall(rows, low, high), _first_recall(rows, low, high)
    return {"from": low, "instances": found, "first": first}


def _recall(rows: Sequence[Row], low: float, high: float, found: str = "found") -> dict[str, Any]:
    hits = [instance[found] for row in rows for instance in row["instances"] if _within(instance["visible_fraction"], low, high)]
    return {"count": len(hits), "found": sum(hits), "share": _share(hits)}


def _first_recall(rows: Sequence[Row], low: float, high: float) -> dict[str, Any]:
    hits = [_first_right(row) for row in rows if row["instances"] and _within(_best_visible(row), low, high)]
    return {"count": len(hits), "found": sum(hits), "share": _share(hits)}


def _best_visible(row: Row) -> float | None:
    known = [instance["visible_fraction"] for instance in row["instances"] if instance["visible_fraction"] is not None]
    return max(known, default=None)


def _first_right(row: Row) -> bool:
    return bool(row["poses"]) and row["poses"][0]["right"]


def _within(value: float | None, low: float, high: float) -> bool:
    return value is not None and low <= value < high


def _share(hits: Iterable[bool]) -> float | None:
    hits = list(hits)
    return sum(hits) / len(hits) if hits else None


def _spread(values: Iterable[float | None]) -> dict[str, float] | None:
    known = [value for value in values if value is not None]
    return {"median": float(np.median(known)), "p95": float(np.percentile(known, 95))} if known else None


def table(summary: dict[str, Any]) -> list[str]:
    """Lines for a terminal: a column a method."""
    names = list(summary)
    width = max(14, *(len(name) + 2 for name in names))
    lines = [f"{'':34}" + "".join(f"{name:>{width}}" for name in names)]
    for text, value in _LINES:
        lines.append(f"{text:34}" + "".join(f"{value(summary[name]):>{width}}" for name in names))
    if any(summary[name]["bins"][k]["instances"]["count"] for name in names for k in range(BINS)):
        lines.append("recall by visible fraction: all instances, and the first answer by the part's best visible instance")
        lines += [_bin_line(summary, k, width) for k in reversed(range(BINS))]
    return lines


def _bin_line(summary: dict[str, Any], k: int, width: int) -> str:
    bins = [numbers["bins"][k] for numbers in summary.values()]
    label = f"  {10 * k}–{10 * k + 10} % ({bins[0]['instances']['count']}, {bins[0]['first']['count']})"
    return f"{label:34}" + "".join(
        f"{_percent(cell['instances']['share']) + ', ' + _percent(cell['first']['share']):>{width}}" for cell in bins
    )


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f} %" if share < 1 else "100 %"


def _counted(cell: dict[str, Any]) -> str:
    return f"{_percent(cell['share'])} of {cell['count']}"


def _pair(spread: dict[str, float] | None, factor: float = 1.0, digits: int = 2) -> str:
    return "–" if spread is None else f"{factor * spread['median']:.{digits}f} / {factor * spread['p95']:.{digits}f}"


_LINES = (
    ("first answer right", lambda s: f"{s['first_right']} of {s['present']}"),
    ("absent parts 'found'", lambda s: f"{s['absent_found']} of {s['absent']}"),
    ("recall, ≥ 50 % visible", lambda s: _counted(s["recall_plain"])),
    ("recall, 25–50 % visible", lambda s: _counted(s["recall_half_hidden"])),
    ("  ≥ 50 % within 3 mm and 2°", lambda s: _counted(s["recall_plain_strict"])),
    ("first answer, ≥ 50 % visible", lambda s: _counted(s["first_plain"])),
    ("first answer, 25–50 % visible", lambda s: _counted(s["first_half_hidden"])),
    ("precision", lambda s: f"{_percent(s['precision'])} of {s['poses']}"),
    ("false finds", lambda s: _percent(s["false_share"])),
    ("off [mm], median / 95 %", lambda s: _pair(s["off_mm"])),
    ("off [°], median / 95 %", lambda s: _pair(s["off_deg"])),
    ("time a part [ms], median / 95 %", lambda s: _pair(s["seconds"], 1e3, 0)),
)
