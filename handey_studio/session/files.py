"""The `.handey` file: a session on disk. JSON, gzipped when it holds arrays; bounded, versioned, written atomically."""

import gzip
import io
import os
import re
import zlib
from dataclasses import MISSING, field, fields, make_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, get_type_hints

import msgspec

from handey_studio.base import BadInput
from handey_studio.base.coding import from_plain, to_plain
from handey_studio.base.errors import unknown_name
from handey_studio.base.files import replace_file
from handey_studio.modeling.draft_files import draft_from_plain, draft_to_plain
from handey_studio.session.checks import check_name, check_session
from handey_studio.session.session import Session
from handey_studio.session.upgrade import upgraded
from handey_studio.world import Library

SCHEMA = "handey/session/"
VERSION = 3
SUFFIX = ".handey"
MAX_FILE_BYTES = 64_000_000
MAX_CONTENT_BYTES = 256_000_000
GZIP_MAGIC = b"\x1f\x8b"


def session_to_bytes(session: Session) -> bytes:
    """What the file holds. The same session gives the same bytes."""
    check_session(session)
    plain = to_plain(replace(session, draft=None))
    if session.draft is not None:
        plain |= {"draft": draft_to_plain(session.draft)}
    content = msgspec.json.encode({"schema": f"{SCHEMA}{VERSION}"} | plain)
    if len(content) > MAX_CONTENT_BYTES:
        raise BadInput(f'session "{session.name}" holds {len(content)} bytes, the limit is {MAX_CONTENT_BYTES}; start a new one.')
    if b'"base64"' not in content:
        return msgspec.json.format(content, indent=1) + b"\n"
    return gzip.compress(content, compresslevel=6, mtime=0)


def session_from_bytes(data: bytes, source: str) -> Session:
    """The session in a file's bytes; `source` names it in messages. Raises BadInput with one sentence."""
    try:
        plain = _decoded(_inflated(data))
        check_version(plain)
        draft = None if plain.get("draft") is None else draft_from_plain(plain["draft"])
        rest = from_plain(upgraded({key: value for key, value in plain.items() if key not in ("schema", "draft")}), _without_draft())
        session = Session(**{f.name: getattr(rest, f.name) for f in fields(rest)}, draft=draft)
        check_session(session)
    except BadInput as error:
        raise BadInput(f'session "{source}" cannot be opened: {error}') from None
    except RecursionError:
        raise BadInput(f'session "{source}" cannot be opened: it is nested too deep to be a session.') from None
    return session


def read_session(path: str | os.PathLike) -> Session:
    """The session in a file. Raises BadInput with one sentence for anything that is wrong with it."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except FileNotFoundError:
        raise BadInput(f'session "{path}" does not exist.') from None
    except OSError as error:
        raise BadInput(f'session "{path}" cannot be read: {error.strerror}.') from None
    return session_from_bytes(data, str(path))


def write_session(path: str | os.PathLike, session: Session) -> None:
    """Write a session so that the file is the old one or the new one whole, whatever happens meanwhile."""
    path = Path(path)
    if path.suffix != SUFFIX:
        raise BadInput(f'session file "{path}" must end in {SUFFIX}.')
    data = session_to_bytes(session)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)
    except OSError as error:
        raise BadInput(f'session "{path}" cannot be written: {error.strerror}.') from None


def find_session(library: Library, name: str | os.PathLike) -> Path:
    """The file of a session: a path to one, or its name in the library."""
    path = Path(name)
    known = library.sessions()
    if path.suffix == SUFFIX or path.is_file():
        return path
    if path.name in known and (path.name == str(name) or path.parent.name == "sessions"):
        return known[path.name]
    raise unknown_name("session", str(name), known)


def own_file(library: Library, name: str) -> Path:
    """Where the library keeps a user's own session of that name."""
    return library.folder / "sessions" / f"{check_name(name)}{SUFFIX}"


@lru_cache(maxsize=1)
def _without_draft() -> Any:
    """A session's fields but the draft, whose steps and scans are of several kinds and have a plain form of their own."""
    kinds = get_type_hints(Session)
    return make_dataclass("Session", [(f.name, kinds[f.name], _same_default(f)) for f in fields(Session) if f.name != "draft"])


def _same_default(known: Any) -> Any:
    made = known.default_factory is not MISSING
    return field(default_factory=known.default_factory) if made else field(default=known.default)


def check_version(plain: Any) -> None:
    """Refuses what is not a session, and one from a newer version."""
    schema = plain.get("schema") if isinstance(plain, dict) else None
    match = re.fullmatch(rf"{SCHEMA}([0-9]{{1,9}})", schema) if isinstance(schema, str) else None
    if match is None or int(match[1]) < 1:
        raise BadInput(f'it is not a Handey Studio session: its "schema" must be "{SCHEMA}{VERSION}".')
    if int(match[1]) > VERSION:
        raise BadInput(f"it has format {match[1]}, this version of Handey Studio reads up to {VERSION}; update Handey Studio.")


def _inflated(data: bytes) -> bytes:
    """The JSON inside, without ever inflating more than the limit."""
    if len(data) > MAX_FILE_BYTES:
        raise BadInput(f"it is larger than {MAX_FILE_BYTES} bytes, the limit for a session.")
    if not data.startswith(GZIP_MAGIC):
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            content = file.read(MAX_CONTENT_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise BadInput(f"it is damaged or cut short: {str(error).rstrip('.')}.") from None
    if len(content) > MAX_CONTENT_BYTES:
        raise BadInput(f"it unpacks to more than {MAX_CONTENT_BYTES} bytes, the limit for a session.")
    return content


def _decoded(content: bytes) -> Any:
    try:
        return msgspec.json.decode(content)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise BadInput(f"it is not valid JSON: {str(error).rstrip('.')}.") from None
