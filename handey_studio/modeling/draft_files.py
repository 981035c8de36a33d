"""The `.draft` file: a part's scans and history on disk. JSON, gzipped when it holds scans; bounded, versioned, written atomically."""

import os
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

from handey_studio.base import BadInput
from handey_studio.base.coding import from_plain, to_plain
from handey_studio.base.documents import check_schema, packed, read_document, unpacked, write_document
from handey_studio.base.errors import unknown_name
from handey_studio.geometry.transforms import is_rigid
from handey_studio.modeling.draft import MAX_OPERATIONS, MAX_SCANS, Draft
from handey_studio.modeling.operations import KINDS, Operation
from handey_studio.modeling.references import number
from handey_studio.modeling.scans import Scan
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole

SCHEMA = "handey/draft/"
VERSION = 1
SUFFIX = ".draft"
MAX_FILE_BYTES = 128_000_000
MAX_CONTENT_BYTES = 512_000_000
MAX_PIXELS = 16_000_000
PROJECTIONS: dict[str, type[Pinhole] | type[Orthographic]] = {"pinhole": Pinhole, "orthographic": Orthographic}


def draft_to_bytes(draft: Draft) -> bytes:
    """What the file holds. The same draft gives the same bytes."""
    plain = {"schema": f"{SCHEMA}{VERSION}"} | draft_to_plain(draft)
    return packed(plain, MAX_CONTENT_BYTES, f'draft "{draft.name}"', "take out a scan")


def draft_from_bytes(data: bytes, source: str) -> Draft:
    """The draft in a file's bytes; `source` names it in messages. Steps that cannot be done are no error: `replay` tells of them.

    Raises BadInput with one sentence.
    """
    try:
        plain = unpacked(data, "draft", MAX_FILE_BYTES, MAX_CONTENT_BYTES)
        check_schema(plain, SCHEMA, VERSION, "a draft of Handey Studio")
        return draft_from_plain(plain)
    except BadInput as error:
        raise BadInput(f'draft "{source}" cannot be opened: {error}') from None
    except RecursionError:
        raise BadInput(f'draft "{source}" cannot be opened: it is nested too deep to be a draft.') from None


def read_draft(path: str | os.PathLike) -> Draft:
    """The draft in a file. Raises BadInput with one sentence for anything that is wrong with it."""
    return draft_from_bytes(read_document(Path(path), "draft", MAX_FILE_BYTES), str(path))


def write_draft(path: str | os.PathLike, draft: Draft) -> None:
    """Write a draft so that the file is the old one or the new one whole, whatever happens meanwhile. Raises BadInput."""
    write_document(path, SUFFIX, draft_to_bytes(draft), "draft")


def draft_to_plain(draft: Draft) -> dict[str, Any]:
    """A draft as dicts, lists and numbers that JSON can hold, so that a session can keep it too."""
    operations = [{"kind": operation.kind} | to_plain(operation) for operation in draft.operations]
    return {"name": draft.name, "scans": [_plain_scan(scan) for scan in draft.scans], "operations": operations}


def draft_from_plain(plain: Any) -> Draft:
    """The draft from what `draft_to_plain` made. Raises BadInput with one sentence."""
    name = _of_kind(plain, "name", str)
    scans, operations = _of_kind(plain, "scans", list), _of_kind(plain, "operations", list)
    if len(scans) > MAX_SCANS or len(operations) > MAX_OPERATIONS:
        raise BadInput(f"it has {len(scans)} scans and {len(operations)} steps, the limits are {MAX_SCANS} and {MAX_OPERATIONS}.")
    steps = tuple(operation_from_plain(step, index) for index, step in enumerate(operations))
    return Draft(name, tuple(_scan(scan) for scan in scans), steps)


def operation_from_plain(plain: Any, index: int) -> Operation:
    """One step by its kind. Raises BadInput that names the step, from 1."""
    kind = _of_kind(plain, "kind", str)
    if kind not in KINDS:
        raise unknown_name("kind of step", kind[:60], KINDS)
    given = {key: value for key, value in plain.items() if key != "kind"}
    known = {f.name for f in fields(KINDS[kind])}
    if not given.keys() <= known:
        raise BadInput(f'step {index + 1}, "{kind}", has {sorted(given.keys() - known)[0]!r}; it may have: {", ".join(sorted(known))}.')
    try:
        return from_plain(given, KINDS[kind])
    except BadInput as error:
        sentence = re.sub(r"\. - at `[^`]*`\.$", ".", str(error))  # our own sentences need no path beside them
        raise BadInput(f'step {index + 1}, "{kind}": {sentence}') from None


def _plain_scan(scan: Scan) -> dict[str, Any]:
    view = scan.view
    shown = next(name for name, kind in PROJECTIONS.items() if isinstance(view.projection, kind))
    rest = to_plain({"noise": view.noise, "outline_error": view.outline_error, "rim_px": view.rim_px})
    arrays = to_plain({"depth": view.depth, "T_world_sensor": view.T_world_sensor})
    return {"name": scan.name, "source": scan.source, "projection": {"kind": shown} | to_plain(view.projection)} | rest | arrays


def _scan(plain: Any) -> Scan:
    name = _of_kind(plain, "name", str)
    try:
        return Scan(name, _view(plain), _of_kind(plain, "source", str))
    except BadInput as error:
        raise BadInput(f'scan "{name[:60]}": {error}') from None


def _view(plain: dict[str, Any]) -> DepthView:
    projection = _of_kind(plain, "projection", dict)
    kind = _of_kind(projection, "kind", str)
    if kind not in PROJECTIONS:
        raise unknown_name("projection", kind[:60], PROJECTIONS)
    shown = from_plain({key: value for key, value in projection.items() if key != "kind"}, PROJECTIONS[kind])
    for field in fields(shown):
        number(getattr(shown, field.name), f"the projection's {field.name}", -1e6, 1e6)
    given = {key: _of_kind(plain, key, object) for key in ("depth", "T_world_sensor", "noise", "outline_error")}
    arrays = from_plain(given, dict[str, Any])
    depth, T = arrays["depth"], arrays["T_world_sensor"]
    if getattr(depth, "ndim", 0) != 2 or not 1 <= depth.size <= MAX_PIXELS:
        raise BadInput(f"its depth has the shape {getattr(depth, 'shape', '?')}; it must be rows and columns of up to {MAX_PIXELS} pixels.")
    if not is_rigid(T, tolerance=1e-5):
        raise BadInput("its T_world_sensor is not a rigid transform: a proper rotation, metres, last row 0 0 0 1.")
    noise, outline = (_up_to_one(arrays[key], f"its {key} [m]") for key in ("noise", "outline_error"))
    rim = _up_to_one(plain.get("rim_px", 0.5), "its rim_px")
    return DepthView(depth, shown, T, noise, outline, rim)


def _up_to_one(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadInput(f"{what} is {str(value)[:40]!r}; it must be a number.")
    return number(value, what, 0.0, 1.0)


def _of_kind(plain: Any, key: str, kind: type) -> Any:
    if not isinstance(plain, dict) or not isinstance(plain.get(key), kind) or plain.get(key) is None:
        raise BadInput(f'"{key}" is missing or not a {kind.__name__}.')
    return plain[key]
