"""`handey guide`: the guide's pages."""

import argparse
from pathlib import Path

import handey_studio
from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE

NAME = "guide"
HELP = "the guide: its pages, or one of them"
PAGES = Path(handey_studio.__file__).parent / "guide"


def add_arguments(guide: argparse.ArgumentParser) -> None:
    guide.add_argument("page", nargs="?", help="a page's name, or its beginning")


def run(given: argparse.Namespace) -> int:
    print(contents() if given.page is None else page(given.page), end="")
    return DONE


def contents() -> str:
    """A line a page: its name and its title."""
    titles = {name: path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ") for name, path in _pages().items()}
    return "".join(f"{name:18}{title}\n" for name, title in titles.items())


def page(name: str) -> str:
    """The page's text. BadInput: no page, or several, begin so."""
    pages = _pages()
    meant = [known for known in pages if known.startswith(name)]
    if len(meant) != 1:
        raise BadInput(f"{len(meant) or 'no'} pages of the guide begin with {name!r}; choose from {', '.join(pages)}.")
    return pages[meant[0]].read_text(encoding="utf-8")


def _pages() -> dict[str, Path]:
    return {path.stem: path for path in sorted(PAGES.glob("*.md"))}
