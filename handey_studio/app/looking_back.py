"""What the scene of the MOVE shows while an earlier attempt is looked at: what was seen then, not what was seen since."""

from dataclasses import replace
from functools import lru_cache

from handey_studio.app.state import State
from handey_studio.localization import LocateResult
from handey_studio.task.plan import Attempt
from handey_studio.task.sense import Scene


def looking_back(state: State) -> State:
    """The state itself, or while an attempt before the last is looked at one whose scene is the scan that this was planned on."""
    result, number = state.session.result, state.attempt_number
    attempt = result.attempts[number] if result is not None and 0 <= number < len(result.attempts) else None
    if attempt is None or attempt.scan is None or state.session.scene is None:
        return state
    view = replace(state.session.view, hypothesis=-1, edge=-1)
    return replace(state, session=replace(state.session, scene=_seen_then(attempt), view=view))


@lru_cache(maxsize=4)
def _seen_then(attempt: Attempt) -> Scene | None:
    """The scan of an attempt as a scene: of the localizer's work only the instances were kept."""
    nothing = LocateResult((), (), (), (), reason="What the localizer weighed was kept of the newest scan only.")
    return None if attempt.scan is None else Scene(attempt.scan, nothing, attempt.located)
