"""How the page looks where viser leaves it to chance: scroll bars beside what they scroll, buttons that belong together in one row."""

from collections.abc import Iterable

from handey_studio.app.html import esc

GUTTER_PX = 7  # a scroll bar's own, beside the content that it scrolls

PAGE = f"<style>.mantine-ScrollArea-content {{ padding-right: {GUTTER_PX}px; box-sizing: border-box }}</style>"


def in_a_row(elements: Iterable[str]) -> str:
    """Puts buttons (elements' ids) that stand one below the other into one row, as wide as each other."""
    known = [esc(element) for element in elements if element]
    if not known:
        return ""
    rules = ", ".join(f'div:has(> [id="{element}"])' for element in known)
    width = f"calc({100 / len(known):.3f}% - 2 * var(--mantine-spacing-xs))"  # without the margins that viser gives it
    return f"<style>{rules} {{ display: inline-block; vertical-align: top; width: {width} }}</style>"
