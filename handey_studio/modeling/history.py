"""Editing a draft's history: add a step, change an earlier one, take one out. A step that cannot be done is refused and changes nothing.

Undo and redo need nothing here: a draft is a value, and the one before is still there.
"""

from dataclasses import replace

from handey_studio.base import BadInput
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.operations import Operation
from handey_studio.modeling.replay import replay


def with_operation(draft: Draft, operation: Operation) -> Draft:
    """The draft with one more step. Raises BadInput with one sentence when the step cannot be done; the draft is as it was."""
    longer = replace(draft, operations=(*draft.operations, operation))
    _refuse_if_fallen(longer, len(draft.operations))
    return longer


def edited(draft: Draft, index: int, operation: Operation) -> Draft:
    """The draft with step `index` (from 0) exchanged. Raises BadInput when the new step cannot be done; later steps that no longer can
    stay in the list, and their sentence is in `replay(draft).steps`."""
    _check_index(draft, index)
    changed = replace(draft, operations=(*draft.operations[:index], operation, *draft.operations[index + 1 :]))
    _refuse_if_fallen(changed, index)
    return changed


def removed(draft: Draft, index: int) -> Draft:
    """The draft without step `index` (from 0); later steps that can no longer be done stay in the list. Raises BadInput."""
    _check_index(draft, index)
    return replace(draft, operations=(*draft.operations[:index], *draft.operations[index + 1 :]))


def _refuse_if_fallen(draft: Draft, index: int) -> None:
    reason = replay(draft).steps[index].reason
    if reason is not None:
        raise BadInput(reason)


def _check_index(draft: Draft, index: int) -> None:
    if not 0 <= index < len(draft.operations):
        raise BadInput(f"step {index + 1} is not there; the draft has {len(draft.operations)} steps.")
