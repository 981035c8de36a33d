"""The list of a session's commands, edited: what is done stays done when others come, go or change places."""

from dataclasses import replace

from handey_studio.base import BadInput
from handey_studio.session.checks import MAX_COMMANDS
from handey_studio.session.sequence import WAITING, states_of
from handey_studio.session.session import Session
from handey_studio.task.plan import MoveCommand


def with_commands(session: Session, commands: tuple[MoveCommand, ...]) -> Session:
    """The session with another list. A command that was in it before keeps its state, a new one waits.

    Raises BadInput for a list that is too long.
    """
    if len(commands) > MAX_COMMANDS:
        raise BadInput(f"the list would have {len(commands)} commands; {MAX_COMMANDS} is the most.")
    left = list(zip(session.commands, states_of(session), strict=True))
    states = []
    for command in commands:
        known = next((one for one in left if one[0] == command), None)
        states.append(WAITING if known is None else known[1])
        left = [one for one in left if one is not known]
    return replace(session, commands=commands, states=tuple(states) if session.states else ())
