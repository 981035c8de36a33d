"""`handey guide`: the guide's pages."""

import argparse

from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE
from handey_studio.guide import pages

NAME = "guide"
HELP = "the guide: its pages, or one of them"


def add_arguments(guide: argparse.ArgumentParser) -> None:
    guide.add_argument("page", nargs="?", help="a page's name, or its beginning")


def run(given: argparse.Namespace) -> int:
    print(contents() if given.page is None else page(given.page), end="")
    return DONE


def contents() -> str:
    """A line a page: its name and its title."""
    return "".join(f"{name:18}{text.splitlines()[0].removeprefix('# ')}\n" for name, text in pages().items())


def page(name: str) -> str:
    """The page's text. BadInput: no page, or several, begin so."""
    known = pages()
    meant = [one for one in known if one.startswith(name)]
    if len(meant) != 1:
        raise BadInput(f"{len(meant) or 'no'} pages of the guide begin with {name!r}; choose from {', '.join(known)}.")
    return known[meant[0]]
