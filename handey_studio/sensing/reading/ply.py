"""PLY clouds: the vertices of the file, as text or as binary numbers of either byte order."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.sensing.reading.clouds import LETTERS, Cloud, binary_records, broken, check_points, header_lines, stacked, text_columns

SIZED = {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
TYPES = LETTERS | SIZED
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


class Element(NamedTuple):
    """One kind of record: its name, how many there are, and its properties, a list's type being None."""

    name: str
    count: int
    properties: list[tuple[str, str | None]]


def read_ply(path: Path) -> Cloud:
    """The vertices of a PLY file, a list of points. Raises BadInput with one sentence."""
    lines, start = header_lines(path, lambda line: line == "end_header")
    if lines[0] != "ply":
        raise broken(path, 'it does not begin with "ply"')
    kind, elements = _header(path, lines[1:-1])
    number = next((k for k, element in enumerate(elements) if element.name == "vertex"), -1)
    if number < 0:
        raise broken(path, "it has no vertices")
    vertex, before = elements[number], elements[:number]
    names = [name for name, _ in vertex.properties]
    if not {"x", "y", "z"} <= set(names) or len(set(names)) < len(names):
        raise broken(path, f"its vertices have the properties {', '.join(names)[:80] or 'none'}; they must have x, y and z once")
    check_points(path, vertex.count)
    if kind == "ascii":
        columns = [names.index(name) for name in "xyz"]
        if any(type_ is None for _, type_ in vertex.properties[: max(columns)]):
            raise broken(path, "a list stands before its coordinates")
        table = text_columns(path, start, sum(element.count for element in before), vertex.count, columns)
        return Cloud(stacked(*table.T))
    for element in before:
        start += element.count * _record(path, element, ORDERS[kind]).itemsize
    records = binary_records(path, start, vertex.count, _record(path, vertex, ORDERS[kind]))
    return Cloud(_points(records))


def _points(records: NDArray) -> NDArray:
    return stacked(records["x"], records["y"], records["z"])


def _header(path: Path, lines: list[str]) -> tuple[str, list[Element]]:
    """The format's name and the elements in the file's order."""
    kind, elements = "", []
    for line in lines:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in ("ascii", *ORDERS):
            kind = words[1]
        elif words[0] == "element" and len(words) == 3 and words[2].isdecimal() and len(words[2]) < 12:
            elements.append(Element(words[1], int(words[2]), []))
        elif words[0] == "property" and elements and len(words) == 3 and words[1] in TYPES:
            elements[-1].properties.append((words[2], TYPES[words[1]]))
        elif words[0] == "property" and elements and len(words) == 5 and words[1] == "list":
            elements[-1].properties.append((words[4], None))
        else:
            raise broken(path, f'its header has the line "{line[:60]}"')
    if not kind:
        raise broken(path, f"its header names no format; it must be one of ascii, {', '.join(ORDERS)}")
    return kind, elements


def _record(path: Path, element: Element, order: str) -> np.dtype:
    """The binary record of an element without lists."""
    if any(type_ is None for _, type_ in element.properties):
        raise broken(path, f'its element "{element.name[:40]}" holds lists, which must come after the vertices')
    return np.dtype(
        [(f"{k}" if name not in ("x", "y", "z") else name, f"{order}{type_}") for k, (name, type_) in enumerate(element.properties)]
    )
