"""One file that holds everything a user did: the Session value, the `.handey` file, and the plan played over time."""

from handey_studio.session.checks import check_name, check_session
from handey_studio.session.files import find_session, own_file, read_session, session_from_bytes, session_to_bytes, write_session
from handey_studio.session.performed import PerformedReplay, Told, attempts_of, replay_of, seconds_of
from handey_studio.session.replay import Moment, Replay, Stretch
from handey_studio.session.session import LAYERS, CommandState, Session, ViewState, new_session

__all__ = [
    "LAYERS",
    "CommandState",
    "Moment",
    "PerformedReplay",
    "Replay",
    "Session",
    "Stretch",
    "Told",
    "ViewState",
    "attempts_of",
    "check_name",
    "check_session",
    "find_session",
    "new_session",
    "own_file",
    "read_session",
    "replay_of",
    "seconds_of",
    "session_from_bytes",
    "session_to_bytes",
    "write_session",
]
