"""PCD clouds of the Point Cloud Library: text, binary, or binary compressed, organised if HEIGHT > 1."""

from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.geometry.transforms import transform
from handey_studio.sensing.reading.clouds import (
    MAX_CLOUD_BYTES,
    Cloud,
    binary_records,
    broken,
    check_points,
    header_lines,
    stacked,
    text_columns,
)

TYPES = ("f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8")
KINDS = ("ascii", "binary", "binary_compressed")
MAX_COUNT = 4096  # numbers of one field


def read_pcd(path: Path) -> Cloud:
    """The points of a PCD file with the viewpoint it names. Raises BadInput with one sentence."""
    lines, start = header_lines(path, lambda line: line.upper().split(maxsplit=1)[:1] == ["DATA"])
    header = {words[0].upper(): words[1:] for words in (line.split() for line in lines) if words and not words[0].startswith("#")}
    names, record, counts = _fields(path, header)
    width, height = (_whole(path, header, key, 0) for key in ("WIDTH", "HEIGHT"))
    check_points(path, width, height)
    kind = " ".join(header.get("DATA", [])).lower()
    if kind not in KINDS:
        raise broken(path, f'its data are "{kind[:40]}"; they must be one of {", ".join(KINDS)}')
    rows, viewpoint = width * height, _viewpoint(path, header)
    if kind == "ascii":
        columns = [sum(counts[: names.index(name)]) for name in "xyz"]
        points = stacked(*text_columns(path, start, 0, rows, columns).T)
    elif kind == "binary":
        records = binary_records(path, start, rows, record)
        points = stacked(records["x"], records["y"], records["z"])
    else:
        points = _compressed(path, start, rows, record)
    return Cloud(points.reshape(height, width, 3) if height > 1 else points, viewpoint)


def _fields(path: Path, header: dict[str, list[str]]) -> tuple[list[str], np.dtype, list[int]]:
    """The fields' names, the record that they make, and how many numbers each has."""
    names = header.get("FIELDS", header.get("COLUMNS", []))
    sizes, kinds = header.get("SIZE", []), [kind.lower() for kind in header.get("TYPE", [])]
    counts = header.get("COUNT", ["1"] * len(names))
    if not (0 < len(names) == len(sizes) == len(kinds) == len(counts)) or any(names.count(name) != 1 for name in "xyz"):
        raise broken(path, "its FIELDS, SIZE, TYPE and COUNT do not describe points with x, y and z")
    types = [kind + size for kind, size in zip(kinds, sizes, strict=True)]
    numbers = [int(count) if count.isdecimal() and len(count) < 6 else 0 for count in counts]
    unknown = [type_ for type_ in types if type_ not in TYPES]
    if unknown or not all(1 <= number <= MAX_COUNT for number in numbers):
        raise broken(path, f"its fields have the type {(unknown or types)[0][:20]} or COUNT {' '.join(counts)[:40]}, which no PCD file has")
    if any(numbers[names.index(name)] != 1 for name in "xyz"):
        raise broken(path, "its x, y and z have a COUNT other than 1")
    labels = [name if name in ("x", "y", "z") else f"{k}" for k, name in enumerate(names)]
    fields = [
        (label, f"<{type_}", (number,)) if number > 1 else (label, f"<{type_}")
        for label, type_, number in zip(labels, types, numbers, strict=True)
    ]
    return names, np.dtype(fields), numbers


def _whole(path: Path, header: dict[str, list[str]], key: str, low: int) -> int:
    words = header.get(key, [])
    if len(words) != 1 or not words[0].isdecimal() or len(words[0]) > 9 or int(words[0]) < low:
        raise broken(path, f'its {key} is "{" ".join(words)[:40]}"; it must be a whole number')
    return int(words[0])


def _viewpoint(path: Path, header: dict[str, list[str]]) -> NDArray | None:
    """T_cloud_sensor (4, 4) of the VIEWPOINT line: a translation and a quaternion w x y z; None without one."""
    words = header.get("VIEWPOINT")
    if words is None:
        return None
    try:
        x, y, z, qw, qx, qy, qz = (float(word) for word in words)
    except ValueError:
        raise broken(path, f'its VIEWPOINT is "{" ".join(words)[:60]}"; it must be seven numbers') from None
    norm = float(np.linalg.norm([qw, qx, qy, qz]))
    if not np.isfinite([x, y, z, norm]).all() or abs(norm - 1.0) > 0.01:
        raise broken(path, f'its VIEWPOINT is "{" ".join(words)[:60]}"; it must be a place and a unit quaternion')
    return transform(Rotation.from_quat([qx, qy, qz, qw]).as_matrix(), (x, y, z))


def _compressed(path: Path, start: int, rows: int, record: np.dtype) -> NDArray:
    """Points (n, 3) of LZF-compressed data, which hold each field of all points together."""
    with path.open("rb") as file:
        file.seek(start)
        sizes = np.frombuffer(file.read(8).ljust(8, b"\0"), "<u4").astype(int)
        if sizes[1] != rows * record.itemsize or sizes[1] > MAX_CLOUD_BYTES or sizes[0] > MAX_CLOUD_BYTES:
            raise broken(
                path,
                f"its compressed data say {sizes[1]} bytes, {rows} points take {rows * record.itemsize}, the limit is {MAX_CLOUD_BYTES}",
            )
        packed = np.frombuffer(file.read(int(sizes[0])), np.uint8)
    data = np.empty(int(sizes[1]), np.uint8)
    if len(packed) < sizes[0] or unpack_lzf(packed, data) != len(data):
        raise broken(path, "its compressed data are damaged")
    columns, offset = {}, 0
    layout: Any = record.fields
    for name in record.names or ():
        size = layout[name][0].itemsize * rows
        if name in ("x", "y", "z"):
            columns[name] = data[offset : offset + size].view(layout[name][0])
        offset += size
    return stacked(columns["x"], columns["y"], columns["z"])


@njit(cache=True)
def unpack_lzf(packed: NDArray, data: NDArray) -> int:
    """Unpack LZF bytes into `data`; how many came out, −1 if the bytes are damaged.

    A control byte below 32 announces that many literal bytes and one; another one a copy of bytes that came out before: its upper
    three bits hold the length less two (7: one more byte to add), its lower five and the next byte how far back they lie.
    """
    i, out = 0, 0
    while i < len(packed):
        control = int(packed[i])
        i += 1
        if control < 32:
            if i + control + 1 > len(packed) or out + control + 1 > len(data):
                return -1
            for _ in range(control + 1):
                data[out] = packed[i]
                i, out = i + 1, out + 1
            continue
        length = control >> 5
        if i + (2 if length == 7 else 1) > len(packed):
            return -1
        if length == 7:
            length += int(packed[i])
            i += 1
        source = out - ((control & 31) << 8) - int(packed[i]) - 1
        i += 1
        if source < 0 or out + length + 2 > len(data):
            return -1
        for _ in range(length + 2):
            data[out] = data[source]
            source, out = source + 1, out + 1
    return out
