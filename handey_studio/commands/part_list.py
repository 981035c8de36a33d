"""`handey part list`: the parts of the library."""

import argparse
import sys

from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE

NAME = "part list"
HELP = "the parts of the library, each with its size, mass and file"


def add_arguments(listing: argparse.ArgumentParser) -> None:
    """None of its own."""


def run(given: argparse.Namespace) -> int:
    import numpy as np

    from handey_studio.world import Library

    library = Library.choose(given.library)
    drafts = library.drafts()
    for name, path in sorted(library.part_files().items()):
        try:
            part = library.part(name)
        except BadInput as error:
            print(error, file=sys.stderr)
            continue
        size = " × ".join(f"{1e3 * side:.0f}" for side in np.ptp(part.solid.vertices, axis=0))
        modelled = ", with its draft" if name in drafts else ""
        print(f"{name:14} {size} mm, {1e3 * part.mass:.0f} g, {len(part.solid.faces)} faces{modelled}: {path}")
    return DONE
