"""The same functions from the shell. `handey COMMAND --help` tells each command's options."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from handey_studio.base import BadInput
from handey_studio.commands import COMMANDS
from handey_studio.commands.arguments import BAD_INPUT


class _Parser(argparse.ArgumentParser):
    """Bad arguments in one sentence, without the usage lines."""

    def error(self, message: str) -> NoReturn:
        raise BadInput(f"{self.prog}: {message}; see {self.prog} --help.")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; the exit status: 0 done, 1 a MOVE failed, 2 bad input, 3 nothing found."""
    try:
        given = _parser().parse_args(_words(sys.argv[1:] if arguments is None else arguments))
        return given.run(given)
    except BadInput as error:
        print(error, file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("stopped.", file=sys.stderr)
        return 130


def _words(arguments: Sequence[str]) -> list[str]:
    """The arguments, a command of two words as one: a folder that is called calibrate is ./calibrate."""
    two = " ".join(arguments[:2])
    return [two, *arguments[2:]] if any(two == command.NAME for command in COMMANDS) else list(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="handey", description="Locate parts in a pile, choose grasps, plan and place, and understand every decision.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    for command in COMMANDS:
        added = commands.add_parser(command.NAME, help=command.HELP, description=command.HELP)
        added.set_defaults(run=command.run)
        added.add_argument("--library", type=Path, help="folder with your own robots/, parts/ and sessions/")
        command.add_arguments(added)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
