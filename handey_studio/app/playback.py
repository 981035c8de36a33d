"""Commands of the timeline: one time drives everything that is shown."""

from dataclasses import dataclass, replace

import numpy as np

from handey_studio.app.state import State, with_view


@dataclass(frozen=True)
class Seek:
    """Look at this time [s] of the plan."""

    time_s: float
    keep_playing: bool = False

    def apply(self, state: State) -> State:
        replay = state.replay
        time_s = float(np.clip(self.time_s, 0.0, replay.duration)) if replay else 0.0
        return replace(with_view(state, time_s=time_s), playing=state.playing and self.keep_playing)


@dataclass(frozen=True)
class SeekStep:
    """To the start of the step before (-1) or after (+1); ±99 goes to the ends."""

    by: int

    def apply(self, state: State) -> State:
        replay = state.replay
        if replay is None:
            return state
        now = state.session.view.time_s
        later = [t for t in replay.starts if t > now + 1e-6] or [replay.duration]
        earlier = [t for t in replay.starts if t < now - 1e-6] or [0.0]
        ends = {99: replay.duration, -99: 0.0}
        return Seek(ends.get(self.by, later[0] if self.by > 0 else earlier[-1])).apply(state)


@dataclass(frozen=True)
class TogglePlay:
    """Play from here, or from the start when the end was reached; or pause."""

    def apply(self, state: State) -> State:
        replay = state.replay
        if replay is None:
            return replace(state, playing=False)
        if not state.playing and state.session.view.time_s >= replay.duration - 1e-6 and _next_attempt(state) == 0:
            state = with_view(state, time_s=0.0, attempt=0)
        return replace(state, playing=not state.playing)


@dataclass(frozen=True)
class Tick:
    """This much wall-clock time [s] went by while playing."""

    seconds: float

    def apply(self, state: State) -> State:
        replay = state.replay
        if not state.playing or replay is None:
            return replace(state, playing=False)
        time_s = state.session.view.time_s + self.seconds * state.speed
        if time_s < replay.duration:
            return with_view(state, time_s=time_s)
        following = _next_attempt(state)
        if following or state.loop:
            return with_view(state, time_s=0.0, attempt=following)
        return replace(with_view(state, time_s=replay.duration), playing=False)


@dataclass(frozen=True)
class LookAtAttempt:
    """Look at another attempt of the same MOVE, at this time [s] of it."""

    number: int
    time_s: float = 0.0

    def apply(self, state: State) -> State:
        if not 0 <= self.number < len(state.attempts):
            return state
        return Seek(self.time_s).apply(with_view(state, attempt=self.number))


@dataclass(frozen=True)
class SetPlayback:
    speed: float | None = None
    loop: bool | None = None

    def apply(self, state: State) -> State:
        return replace(state, speed=self.speed or state.speed, loop=state.loop if self.loop is None else self.loop)


def _next_attempt(state: State) -> int:
    """The attempt that is played after the one that is looked at; 0, the first, after the last."""
    return (state.attempt_number + 1) % max(len(state.attempts), 1)
