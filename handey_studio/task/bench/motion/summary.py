"""What many answers say together: how many were solved, how fast, how long the paths are, and how many collide."""

from collections.abc import Sequence
from typing import Any

import numpy as np

Row = dict[str, Any]


def summarise(rows: Sequence[Row]) -> dict[str, Any]:
    """Numbers of each method over all families and of each one, in the order in which they come: {method: {"all" or family: numbers}}.

    Problems that begin or end in collision are counted apart, in `no_free_ends`. Times and lengths are those of found paths;
    `length_together_rad` is over the problems that every method solved.
    """
    methods, families = _names(rows, "method"), _names(rows, "family")
    everyone = _solved_by_all(rows, methods)
    table: dict[str, Any] = {}
    for method in methods:
        mine = [row for row in rows if row["method"] == method]
        table[method] = {"all": _numbers(mine, everyone)}
        table[method] |= {family: _numbers([row for row in mine if row["family"] == family], everyone) for family in families}
    return table


def _names(rows: Sequence[Row], key: str) -> list[str]:
    return list(dict.fromkeys(row[key] for row in rows))


def _problem(row: Row) -> tuple[str, str, int]:
    return row["family"], row["name"], row["seed"]


def _solved_by_all(rows: Sequence[Row], methods: Sequence[str]) -> set[tuple[str, str, int]]:
    solved = [{_problem(row) for row in rows if row["method"] == method and row["found"]} for method in methods]
    return set.intersection(*solved) if solved else set()


def _numbers(rows: Sequence[Row], everyone: set[tuple[str, str, int]]) -> dict[str, Any]:
    found = [row for row in rows if row["found"]]
    return {
        "asked": sum(row["ends_free"] for row in rows),
        "no_free_ends": sum(not row["ends_free"] for row in rows),
        "solved": len(found),
        "colliding": sum(bool(row["collisions"]) for row in found),
        "seconds": _spread([row["seconds"] for row in found]),
        "length_rad": _spread([row["length_rad"] for row in found]),
        "length_together_rad": _spread([row["length_rad"] for row in found if _problem(row) in everyone]),
        "clearance_m": _spread([row["clearance_m"] for row in found]),
    }


def _spread(values: Sequence[float]) -> dict[str, float] | None:
    """Least, median and 95th percentile; None of nothing."""
    if not values:
        return None
    return {"least": float(np.min(values)), "median": float(np.median(values)), "p95": float(np.percentile(values, 95))}


def table(summary: dict[str, Any]) -> list[str]:
    """Lines for a terminal: a row a method and family."""
    if not summary:
        return ["no problem was measured"]
    width = max(len(name) for name in (*summary, *next(iter(summary.values())))) + 2
    head = f"{'':{2 * width}}{'solved':>12}{'colliding':>11}{'s median':>10}{'s p95':>8}"
    head += f"{'rad median':>12}{'on common':>11}{'clearance mm':>14}"
    lines = [head]
    families = next(iter(summary.values()))
    for family in families if len(families) > 2 else ("all",):
        lines += [f"{name:{width}}{family:{width}}" + _cells(numbers[family]) for name, numbers in summary.items()]
    left_out = families["all"]["no_free_ends"]
    return [*lines, f"{left_out} more begin or end in collision"] if left_out else lines


def _cells(numbers: dict[str, Any]) -> str:
    solved = f"{numbers['solved']} of {numbers['asked']}"
    seconds, lengths, common, clearances = (numbers[key] for key in ("seconds", "length_rad", "length_together_rad", "clearance_m"))
    return (
        f"{solved:>12}{numbers['colliding']:>11}{_number(seconds, 'median'):>10}{_number(seconds, 'p95'):>8}"
        f"{_number(lengths, 'median'):>12}{_number(common, 'median'):>11}{_number(clearances, 'median', 1e3, 1):>14}"
    )


def _number(spread: dict[str, float] | None, key: str, factor: float = 1.0, digits: int = 2) -> str:
    return "–" if spread is None else f"{factor * spread[key]:.{digits}f}"
