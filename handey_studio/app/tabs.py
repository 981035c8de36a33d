"""Which tabs come to the front by themselves."""

from handey_studio.app.state import State


def front_tabs(state: State) -> tuple[str, str]:
    """The tabs of the left and the right panel that go with what is done now."""
    return ("Model", "Part") if state.model.open else ("Move", "Result")


def tabs_with_news(old: State, new: State) -> tuple[str, ...]:
    """The tabs to bring to the front after a step: those of the model or the MOVE that one turns to, the result of what was carried out."""
    if old.model.open != new.model.open:
        return front_tabs(new)
    result = new.session.result
    carried_out = old.job is not None and new.job is None and result is not None and result is not old.session.result
    return ("Result",) if carried_out and result is not None and result.performances else ()
