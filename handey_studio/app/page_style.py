"""How the page looks where viser leaves it to chance: greys for the light and the dark page, scroll bars, buttons in one row."""

from collections.abc import Iterable

from handey_studio.app.html import esc

GUTTER_PX = 7  # a scroll bar's own, beside the content that it scrolls

# Greys by their use, and how much white coloured words take on: (on the light page, on the dark one). In a style: `var(--muted)`.
GREYS = {
    "ink": ("#202935", "#e4e8ed"),
    "body": ("#4a5562", "#c0c8d1"),
    "muted": ("#66717e", "#9aa5b1"),
    "faint": ("#7d8894", "#8792a0"),
    "line": ("#e0e5eb", "#40464d"),
    "rim": ("#c3cad3", "#565e67"),
    "track": ("#e6eaef", "#3c4248"),
    "row": ("#f7f9fb", "#2c3034"),
    "lift": ("0%", "42%"),
}
DARK_BRAND = "#6bb2e8"  # the chosen tab: blue that can be told from the dark page


def _named(page: int) -> str:
    return ";".join(f"--{name}:{values[page]}" for name, values in GREYS.items())


PAGE = (
    f"<style>:root{{{_named(0)}}} :root[data-mantine-color-scheme=dark]{{{_named(1)}}} "
    f":root[data-mantine-color-scheme=dark] [role=tab]{{--mantine-primary-color-filled:{DARK_BRAND};--tabs-color:{DARK_BRAND}}} "
    "[data-figure]:fullscreen{box-sizing:border-box;padding:2vh 4vw;background:var(--mantine-color-body);font-size:2.2vh !important} "
    "[data-figure]:fullscreen svg{height:78vh} "
    f".mantine-ScrollArea-content{{padding-right:{GUTTER_PX}px;box-sizing:border-box}}</style>"
)


def in_a_row(elements: Iterable[str]) -> str:
    """Puts buttons (elements' ids) that stand one below the other into one row, as wide as each other."""
    known = [esc(element) for element in elements if element]
    if not known:
        return ""
    rules = ", ".join(f'div:has(> [id="{element}"])' for element in known)
    width = f"calc({100 / len(known):.3f}% - 2 * var(--mantine-spacing-xs))"  # without the margins that viser gives it
    return f"<style>{rules} {{ display: inline-block; vertical-align: top; width: {width} }}</style>"
