"""The page's own style, and how it words numbers."""

import re
from pathlib import Path

from handey_studio import app
from handey_studio.app import palette
from handey_studio.app.page_style import GREYS
from handey_studio.app.wording import destination_words


def luminance(colour: str) -> float:
    """Relative luminance of `#rrggbb`, 0 to 1."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


def test_every_grey_that_a_pane_names_is_set():
    named = set()
    for file in Path(app.__path__[0]).rglob("*.py"):
        named |= set(re.findall(r"var\(--([a-z]+)\)", file.read_text()))
    assert named <= set(GREYS) and len(named) >= 8


def test_words_can_be_read_on_both_pages():
    for name, least in (("ink", 10.0), ("body", 7.0), ("muted", 4.5), ("faint", 3.5)):
        light, dark = GREYS[name]
        assert contrast(light, "#ffffff") >= least and contrast(dark, "#242424") >= least, name
    for colour in palette.STEP_COLOURS.values():
        words = palette.words_on(colour).replace("#fff", "#ffffff")
        assert contrast(words, palette.css(colour)) >= 3.5


def test_destinations_are_told_in_millimetres_and_degrees():
    assert destination_words("0.35,-0.08,0") == "350, -80, 0 mm"
    assert destination_words("0.23,0.19,-0.0,90,0,-0.0") == "230, 190, 0 mm, turned 90°, 0°, 0°"
    assert destination_words("in:0.3,0.25,0.6,0.45") == "x 300 to 600, y 250 to 450 mm"
    assert destination_words("on:l_block:block") == "on:l_block:block"
