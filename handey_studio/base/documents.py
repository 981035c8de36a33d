"""Versioned JSON documents on disk, gzipped when they hold arrays: bounded, and never half-written.

Messages name the `noun` ("session", "draft"); every error is a BadInput with one sentence.
"""

import gzip
import io
import os
import re
import zlib
from pathlib import Path
from typing import Any

import msgspec

from handey_studio.base.errors import BadInput
from handey_studio.base.files import replace_file

GZIP_MAGIC = b"\x1f\x8b"
MOST_VALUES = 2_000_000  # numbers, words and lists; large arrays are one each. A byte or two can take a hundred bytes of memory


def packed(plain: dict[str, Any], most_bytes: int, told: str, fix: str) -> bytes:
    """The bytes of a document that `to_plain` made, the same for the same: JSON that a person can read, or gzipped if arrays are in it.

    One of more than `most_bytes`, or of more than MOST_VALUES values, is refused; the sentence begins with `told`, which names it, and ends
    with `fix`.
    """
    content = msgspec.json.encode(plain)
    for found, limit, unit in ((len(content), most_bytes, "bytes"), (_values(content), MOST_VALUES, "values")):
        if found > limit:
            raise BadInput(f"{told} holds {found} {unit}, the limit is {limit}; {fix}.")
    if b'"base64"' not in content:
        return msgspec.json.format(content, indent=1) + b"\n"
    return gzip.compress(content, compresslevel=6, mtime=0)


def unpacked(data: bytes, noun: str, most_file_bytes: int, most_bytes: int) -> Any:
    """The JSON in a document's bytes, without ever inflating more than `most_bytes` or making more than MOST_VALUES values of them."""
    content = _inflated(data, noun, most_file_bytes, most_bytes)
    if _values(content) > MOST_VALUES:
        raise BadInput(f"it holds more than {MOST_VALUES} values, the limit for a {noun}.")
    try:
        return msgspec.json.decode(content)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise BadInput(f"it is not valid JSON: {str(error).rstrip('.')}.") from None


def check_schema(plain: Any, schema: str, version: int, what: str) -> None:
    """Refuses what is not `what` (its "schema" begins otherwise than with `schema`), and what has a newer version."""
    found = plain.get("schema") if isinstance(plain, dict) else None
    match = re.fullmatch(rf"{schema}([0-9]{{1,9}})", found) if isinstance(found, str) else None
    if match is None or int(match[1]) < 1:
        raise BadInput(f'it is not {what}: its "schema" must be "{schema}{version}".')
    if int(match[1]) > version:
        raise BadInput(f"it has format {match[1]}, this version of Handey Studio reads up to {version}; update Handey Studio.")


def read_document(path: Path, noun: str, most_file_bytes: int) -> bytes:
    """The bytes of a file, at most one more than the limit."""
    try:
        with path.open("rb") as file:
            return file.read(most_file_bytes + 1)
    except FileNotFoundError:
        raise BadInput(f'{noun} "{path}" does not exist.') from None
    except OSError as error:
        raise BadInput(f'{noun} "{path}" cannot be read: {error.strerror}.') from None


def write_document(path: str | os.PathLike, suffix: str, data: bytes, noun: str) -> None:
    """Write a file with that suffix so that it is the old one or the new one whole, whatever happens meanwhile."""
    path = Path(path)
    if path.suffix != suffix:
        raise BadInput(f'{noun} file "{path}" must end in {suffix}.')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)
    except OSError as error:
        raise BadInput(f'{noun} "{path}" cannot be written: {error.strerror}.') from None


def _values(content: bytes) -> int:
    """At most how many values stand side by side in JSON: commas in words count too."""
    return 1 + content.count(b",")


def _inflated(data: bytes, noun: str, most_file_bytes: int, most_bytes: int) -> bytes:
    if len(data) > most_file_bytes:
        raise BadInput(f"it is larger than {most_file_bytes} bytes, the limit for a {noun}.")
    if not data.startswith(GZIP_MAGIC):
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            content = file.read(most_bytes + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise BadInput(f"it is damaged or cut short: {str(error).rstrip('.')}.") from None
    if len(content) > most_bytes:
        raise BadInput(f"it unpacks to more than {most_bytes} bytes, the limit for a {noun}.")
    return content
