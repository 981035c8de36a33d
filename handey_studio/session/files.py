"""The `.handey` file: a session on disk. JSON, gzipped when it holds arrays; bounded, versioned, written atomically."""

import os
from dataclasses import MISSING, field, fields, make_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, get_type_hints

from handey_studio.base import BadInput
from handey_studio.base.coding import from_plain, to_plain
from handey_studio.base.documents import check_schema, packed, read_document, unpacked, write_document
from handey_studio.base.errors import unknown_name
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


def session_to_bytes(session: Session) -> bytes:
    """What the file holds. The same session gives the same bytes."""
    check_session(session)
    plain = to_plain(replace(session, draft=None))
    if session.draft is not None:
        plain |= {"draft": draft_to_plain(session.draft)}
    return packed({"schema": f"{SCHEMA}{VERSION}"} | plain, MAX_CONTENT_BYTES, f'session "{session.name}"', "start a new one")


def session_from_bytes(data: bytes, source: str) -> Session:
    """The session in a file's bytes; `source` names it in messages. Raises BadInput with one sentence."""
    try:
        plain = unpacked(data, "session", MAX_FILE_BYTES, MAX_CONTENT_BYTES)
        check_schema(plain, SCHEMA, VERSION, "a Handey Studio session")
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
    return session_from_bytes(read_document(Path(path), "session", MAX_FILE_BYTES), str(path))


def write_session(path: str | os.PathLike, session: Session) -> None:
    """Write a session so that the file is the old one or the new one whole, whatever happens meanwhile."""
    write_document(path, SUFFIX, session_to_bytes(session), "session")


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
