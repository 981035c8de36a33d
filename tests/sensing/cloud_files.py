"""Writes PLY and PCD files in every form that the readers take."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write_ply(path: Path, points: NDArray, kind: str, type_: str = "float", extra: bool = True) -> Path:
    """`kind` ascii, binary_little_endian or binary_big_endian; `extra` adds a colour before the coordinates and faces after them."""
    n = len(points)
    head = [f"ply\nformat {kind} 1.0\ncomment written by a test", f"element vertex {n}"]
    head += ["property uchar red"] if extra else []
    head += [f"property {type_} {name}" for name in "xyz"]
    head += ["element face 1\nproperty list uchar int vertex_indices"] if extra else []
    content = ("\n".join([*head, "end_header"]) + "\n").encode()
    if kind == "ascii":
        rows = [" ".join([*(["7"] if extra else []), *(repr(float(value)) for value in point)]) for point in points]
        content += ("\n".join([*rows, *(["3 0 1 2"] if extra else [])]) + "\n").encode()
    else:
        order = "<" if "little" in kind else ">"
        letter = {"float": "f4", "double": "f8"}[type_]
        record = np.dtype([*([("red", "u1")] if extra else []), *((name, order + letter) for name in "xyz")])
        table = np.zeros(n, record)
        for k, name in enumerate("xyz"):
            table[name] = points[:, k]
        content += table.tobytes() + (np.uint8(3).tobytes() + np.arange(3, dtype=order + "i4").tobytes() if extra else b"")
    path.write_bytes(content)
    return path


def write_pcd(path: Path, points: NDArray, kind: str, viewpoint: str = "0 0 0 1 0 0 0", size: int = 4) -> Path:
    """`kind` ascii, binary or binary_compressed; (H, W, 3) points are organised. A colour stands between x and y."""
    height, width = points.shape[:2] if points.ndim == 3 else (1, len(points))
    flat = points.reshape(-1, 3)
    head = f"# .PCD v0.7\nVERSION 0.7\nFIELDS x rgb y z\nSIZE {size} 4 {size} {size}\nTYPE F U F F\nCOUNT 1 2 1 1\n"
    head += f"WIDTH {width}\nHEIGHT {height}\nVIEWPOINT {viewpoint}\nPOINTS {len(flat)}\nDATA {kind}\n"
    columns = [
        flat[:, 0].astype(f"<f{size}"),
        np.full((len(flat), 2), 7, "<u4"),
        flat[:, 1].astype(f"<f{size}"),
        flat[:, 2].astype(f"<f{size}"),
    ]
    if kind == "ascii":
        content = "".join(f"{x!r} 7 7 {y!r} {z!r}\n" for x, y, z in flat.tolist()).encode()
    elif kind == "binary":
        table = np.zeros(len(flat), [("x", columns[0].dtype), ("rgb", "<u4", (2,)), ("y", columns[2].dtype), ("z", columns[3].dtype)])
        for name, column in zip(("x", "rgb", "y", "z"), columns, strict=True):
            table[name] = column
        content = table.tobytes()
    else:
        data = b"".join(column.tobytes() for column in columns)
        packed = pack_lzf(data)
        content = np.array([len(packed), len(data)], "<u4").tobytes() + packed
    path.write_bytes(head.encode() + content)
    return path


def pack_lzf(data: bytes) -> bytes:
    """LZF with literals, short and long copies, found greedily."""
    out, literal, seen, i = bytearray(), bytearray(), {}, 0

    def flush() -> None:
        for start in range(0, len(literal), 32):
            piece = literal[start : start + 32]
            out.extend(bytes([len(piece) - 1]) + piece)
        literal.clear()

    while i < len(data):
        key = data[i : i + 3]
        at = seen.get(key, -1)
        seen[key] = i
        if len(key) < 3 or at < 0 or i - at > 8192:
            literal.append(data[i])
            i += 1
            continue
        length = 3
        while length < 264 and i + length < len(data) and data[at + length] == data[i + length]:
            length += 1
        flush()
        back = i - at - 1
        if length - 2 < 7:
            out.extend([(length - 2) << 5 | back >> 8, back & 255])
        else:
            out.extend([7 << 5 | back >> 8, length - 9, back & 255])
        i += length
    flush()
    return bytes(out)
