"""Editing a draft's history: add a step, change an earlier one, take one out. A step that cannot be done is refused and changes nothing.

Undo and redo need nothing here: a draft is a value, and the one before is still there.
"""

from dataclasses import replace

from handey_studio.base import BadInput
from handey_studio.modeling.anchoring import Renumber, carried
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.operations import Operation
from handey_studio.modeling.replay import outcome, replay, replayed, start
from handey_studio.modeling.state import Maker, State


def with_operation(draft: Draft, operation: Operation) -> Draft:
    """The draft with one more step. Raises BadInput with one sentence when the step cannot be done; the draft is as it was."""
    longer = replace(draft, operations=(*draft.operations, operation))
    _refuse_if_fallen(longer, len(draft.operations))
    return longer


def edited(draft: Draft, index: int, operation: Operation) -> Draft:
    """The draft with step `index` (from 0) exchanged. Raises BadInput when the new step cannot be done.

    Later steps keep to the faces, edges and corners that they were made on. Those that can no longer be done stay in the list, and their
    sentence is in `replay(draft).steps`.
    """
    _check_index(draft, index)
    changed = replace(draft, operations=(*draft.operations[:index], operation, *draft.operations[index + 1 :]))
    _refuse_if_fallen(changed, index)
    return _with_later_steps(draft, index, (*draft.operations[:index], operation), lambda maker: maker)


def removed(draft: Draft, index: int) -> Draft:
    """The draft without step `index` (from 0); later steps are treated as `edited` does. Raises BadInput when the step is not there."""
    _check_index(draft, index)
    gone = (-1, -1)

    def renumber(maker: Maker) -> Maker:
        step, face = maker
        return gone if step == index else (step - (step > index), face)

    return _with_later_steps(draft, index, draft.operations[:index], renumber)


def _with_later_steps(draft: Draft, index: int, first: tuple[Operation, ...], renumber: Renumber) -> Draft:
    """The draft with its first steps, up to `index`, exchanged, and the later ones carried along."""
    operations = list(first)
    before: State = replayed(start(draft), draft.operations[: index + 1]).state
    after: State = replayed(start(draft), first).state
    for operation in draft.operations[index + 1 :]:
        following = carried(operation, before, after, renumber)
        operations.append(following)
        before, after = outcome(before, operation)[0], outcome(after, following)[0]
    return replace(draft, operations=tuple(operations))


def _refuse_if_fallen(draft: Draft, index: int) -> None:
    reason = replay(draft).steps[index].reason
    if reason is not None:
        raise BadInput(reason)


def _check_index(draft: Draft, index: int) -> None:
    if not 0 <= index < len(draft.operations):
        raise BadInput(f"step {index + 1} is not there; the draft has {len(draft.operations)} steps.")
