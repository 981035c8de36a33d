"""What the commands share: exit statuses, kinds of arguments, checks before work begins, progress and files."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from handey_studio.base import BadInput
from handey_studio.base.files import replace_file

DONE, FAILED, BAD_INPUT, NOTHING_FOUND = 0, 1, 2, 3


class Lines:
    """Progress as lines on standard error when a person watches."""

    cancelled = False

    def report(self, fraction: float, message: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{100 * fraction:3.0f} % {message[:90]}", end="", file=sys.stderr, flush=True)


def write_json(path: Path, content: dict[str, Any]) -> None:
    try:
        replace_file(path, (json.dumps(content, allow_nan=False) + "\n").encode())
    except OSError as error:
        raise BadInput(f'"{path}" cannot be written: {error.strerror}.') from None


def check_output(path: Path | None) -> None:
    """Raises BadInput before any work is done when there is no folder to write into."""
    if path is not None and not path.parent.is_dir():
        raise BadInput(f'"{path}" cannot be written: the folder "{path.parent}" does not exist.')


def check_suffix(path: Path | None, *allowed: str) -> None:
    """Raises BadInput before any work is done for a file that would be of no known kind."""
    if path is not None and path.suffix.lower() not in allowed:
        raise BadInput(f'"{path}" has the suffix "{path.suffix}"; it must be one of {", ".join(allowed)}.')


def board_size(text: str) -> tuple[int, int]:
    columns, _, rows = text.lower().partition("x")
    if not (columns.isdigit() and rows.isdigit()):
        raise argparse.ArgumentTypeError(f'"{text}" is not COLSxROWS, the numbers of inner corners, such as 9x6')
    return int(columns), int(rows)


def three(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f'"{text}" is not X,Y,Z, three numbers') from None
    return x, y, z


def port(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f'"{text}" is not a port from 1 to 65535')
    return int(text)


def positive(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f'"{text}" is not a whole number from 1 to 1000')
    return int(text)


def whole(text: str) -> int:
    if not text.isdigit() or int(text) > 1_000_000:
        raise argparse.ArgumentTypeError(f'"{text}" is not a whole number from 0 to 1000000')
    return int(text)


def seeds(text: str) -> range:
    first, colon, end = text.partition(":")
    if not (first.isdigit() and (end.isdigit() or not colon)):
        raise argparse.ArgumentTypeError(f'"{text}" is not FIRST:END')
    return range(int(first), int(end) if colon else int(first) + 1)
