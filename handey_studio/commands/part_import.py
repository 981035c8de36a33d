"""`handey part import`: a mesh or CAD file becomes a part of the library."""

import argparse
import sys
from pathlib import Path

from handey_studio.base import measured
from handey_studio.commands.arguments import DONE

NAME = "part import"
HELP = "make a mesh or CAD file (OBJ, STL, PLY, OFF, STEP) a part of your library"


def add_arguments(importing: argparse.ArgumentParser) -> None:
    importing.add_argument("file", type=Path)
    importing.add_argument("--units", choices=("m", "cm", "mm", "in"), default="", help="unit of the file's numbers (STEP tells its own)")
    importing.add_argument("--name", default="", help="the part's name (default: the file's)")
    importing.add_argument("--simplify", type=float, metavar="MM", help="make planes within so many millimetres one, exactly planar")
    importing.add_argument("--body", type=int, help="which of several separate bodies, from 1, the largest first")
    importing.add_argument("--density", type=float, default=700.0, metavar="KG_M3", help="kg/m³ (default: 700)")
    importing.add_argument("--friction", type=float, default=0.5, help="against the fingers (default: 0.5)")
    importing.add_argument("--overwrite", action="store_true", help="take the place of a part of that name")


def run(given: argparse.Namespace) -> int:
    from handey_studio.modeling.checks import solid_checks
    from handey_studio.world import Library
    from handey_studio.world.importing import ImportOptions, import_part
    from handey_studio.world.part_writing import check_part_name, write_part

    library = Library.choose(given.library)
    name = check_part_name(given.name or given.file.stem)
    simplify = None if given.simplify is None else given.simplify / 1e3
    made = import_part(given.file, ImportOptions(given.units, simplify, given.body, name, given.density, given.friction))
    part = write_part(library, made.part, overwrite=given.overwrite)
    off = f", at most {measured(made.deviation, 'm')} off the file's surface" if made.deviation else ""
    print(f"{name}: {len(part.solid.faces)} faces of {made.triangles} polygons{off}: {library.part_files()[name]}")
    for check in solid_checks(part.solid, part.density):
        if not check.ok:
            print(f"{check.sentence} {check.fix}", file=sys.stderr)
    return DONE
