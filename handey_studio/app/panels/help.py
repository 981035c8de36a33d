"""Help on the page: the guide's pages, and what the keys do."""

import viser

from handey_studio.app import html
from handey_studio.guide import pages

FIRST_PAGE = "workbench"
KEYS = (
    ("Space", "play or pause"),
    ("J, L", "to the step before, to the next"),
    ("Home, End", "to the start, to the end"),
    ("P, M", "Plan, MOVE"),
    ("Esc", "cancel; put the modeller's tool down"),
    ("1, 2, 3", "look at the workcell, the pile, from the top"),
    ("4, 5", "look at the grasp, at the hand"),
    ("6, 0", "look at the hypothesis from close up, at none"),
    ("N, B", "the next hypothesis, the one before"),
    ("7", "look at the configuration space"),
    ("R", "the ruler: click two spots in the scene"),
    ("Enter, Delete", "take what the modeller offers; remove its step"),
    ("Ctrl+Z, Ctrl+Shift+Z", "undo, redo"),
    ("Ctrl+S, Ctrl+O", "save, open"),
    ("Ctrl+K", "every command, to be searched"),
    ("W A S D Q E, arrows", "fly"),
    ("Mouse", "drag turns, right drag shifts, wheel zooms; click a part, a data edge or a hypothesis to read about it"),
)


def show_guide(client: viser.ClientHandle) -> None:
    """A dialog in one browser with a page of the guide, and a list to choose another from."""
    told = pages()
    titles = {title_of(text): text for text in told.values()}
    modal = client.gui.add_modal("Guide")
    with modal:
        close = client.gui.add_button("Close", color="gray")  # first: it has the focus, and needs no scrolling
        chosen = client.gui.add_dropdown("Page", tuple(titles), initial_value=title_of(told[FIRST_PAGE]))
        shown = client.gui.add_markdown(body_of(titles[chosen.value]))

    @chosen.on_update
    def _(_: viser.GuiEvent) -> None:
        shown.content = body_of(titles[chosen.value])

    close.on_click(lambda _: modal.close())


def show_keys(client: viser.ClientHandle) -> None:
    """A dialog in one browser with what the keys and the mouse do."""
    modal = client.gui.add_modal("Keys")
    with modal:
        close = client.gui.add_button("Close", color="gray")
        client.gui.add_html(html.facts(KEYS, "keys"))
    close.on_click(lambda _: modal.close())


def title_of(page: str) -> str:
    """What a page of the guide is about: its first line."""
    return page.splitlines()[0].removeprefix("# ")


def body_of(page: str) -> str:
    """The page below its title, with headings that fit a dialog."""
    return page.split("\n", 1)[1].strip().replace("\n## ", "\n#### ").removeprefix("## ")
