"""Small pieces of HTML. Whatever a user or a file wrote is escaped here, before it reaches a browser."""

from collections.abc import Iterable
from html import escape

from handey_studio.app import palette
from handey_studio.app.palette import css

TONES = {"info": palette.BLUE, "good": palette.TEAL, "bad": palette.VERMILLION, "warn": palette.ORANGE, "quiet": palette.GREY}


def esc(text: object) -> str:
    """Text as HTML text."""
    return escape(str(text), quote=True)


def card(title: str, text: str, tone: str = "info", testid: str = "") -> str:
    """A sentence with a coloured bar at its side."""
    colour = css(TONES[tone])
    return (
        f'<div data-testid="{esc(testid)}" style="border-left:4px solid {colour};background:{colour}12;border-radius:4px;padding:8px 12px;'
        f'margin:2px 12px 4px;line-height:1.4"><div style="font-weight:650;font-size:13px">{esc(title)}</div>'
        f'<div style="font-size:12.5px;opacity:.85">{esc(text)}</div></div>'
    )


def facts(rows: Iterable[tuple[str, str]], testid: str = "") -> str:
    """Names and values, one a line."""
    lines = "".join(
        f'<tr><td style="color:var(--muted);padding:1.5px 10px 1.5px 0;white-space:nowrap;vertical-align:top">{esc(name)}</td>'
        f'<td style="padding:1.5px 0;font-variant-numeric:tabular-nums">{esc(value)}</td></tr>'
        for name, value in rows
    )
    return f'<div data-testid="{esc(testid)}" style="margin:2px 14px;font-size:12.5px;line-height:1.35"><table>{lines}</table></div>'


def empty(text: str, testid: str = "") -> str:
    """What an empty pane says: how to fill it."""
    return (
        f'<div data-testid="{esc(testid)}" style="margin:10px 14px;padding:14px;border:1px dashed var(--rim);border-radius:6px;'
        f'color:var(--muted);font-size:12.5px;line-height:1.45;text-align:center">{esc(text)}</div>'
    )


def stage_chips(stages: Iterable[tuple[str, str]]) -> str:
    """Stages in a row: a tick for what is done, bold for what runs now."""
    marks = {"done": "✓", "now": "●", "later": "○"}
    weights = {"done": "500;opacity:.75", "now": "700", "later": "400;opacity:.5"}
    row = "".join(f'<span style="font-weight:{weights[when]}">{marks[when]} {esc(name)}</span>' for name, when in stages)
    return f'<div data-testid="stages" style="display:flex;gap:16px;margin:2px 16px 6px;font-size:12.5px">{row}</div>'


def swatch(colour: palette.RGB, label: str) -> str:
    """A coloured chip and what it means."""
    return (
        f'<span style="display:inline-flex;align-items:center;gap:6px;margin-right:12px"><span style="width:11px;height:11px;'
        f'border-radius:3px;background:{css(colour)}"></span>{esc(label)}</span>'
    )


def pressed(button: str, chosen: bool) -> str:
    """Attributes of a row that presses a button (an element's id) when it is clicked."""
    return f'role="button" tabindex="0" aria-pressed="{str(chosen).lower()}" onclick="{esc(pressing(button))}"'


def row_look(chosen: bool) -> str:
    """Style of a row in a list: its edge and ground tell whether it is looked at."""
    blue = css(palette.BLUE)
    return f"border-left:3px solid {blue};background:{blue}1c" if chosen else "border-left:3px solid var(--line)"


def count_row(label: str, count: int, most: int, colour: palette.RGB, button: str = "", chosen: bool = False) -> str:
    """A label, a bar as long as its count's share of the most, and the count; a click presses a button (an element's id)."""
    width = max(3.0, 100.0 * count / max(most, 1))
    bar = f'<div style="width:{width:.0f}%;background:{css(colour)};height:8px;border-radius:3px"></div>'
    return (
        f'<div {pressed(button, chosen) if button else ""} style="display:flex;align-items:center;gap:8px;margin:2px 0;'
        f'{f"cursor:pointer;padding:1px 0 1px 8px;{row_look(chosen)}" if button else ""}">'
        f'<div style="flex:0 0 62%;line-height:1.25">{esc(label)}</div>'
        f'<div style="flex:1;background:var(--track);border-radius:3px">{bar}</div>'
        f'<div style="flex:0 0 48px;text-align:right;font-variant-numeric:tabular-nums">{count}</div></div>'
    )


def scale(title: str, stops: str, ticks: Iterable[str]) -> str:
    """A bar of colours (CSS gradient stops) with numbers below it."""
    numbers = "".join(f"<span>{esc(tick)}</span>" for tick in ticks)
    return (
        f'<div style="margin:4px 14px 8px;font-size:12px">{esc(title)}<div style="height:10px;border-radius:3px;margin-top:3px;'
        f'background:linear-gradient(90deg,{stops})"></div><div style="display:flex;justify-content:space-between">{numbers}</div></div>'
    )


def hidden(elements: Iterable[str]) -> str:
    """Takes buttons (elements' ids) off the page that only rows of a list press."""
    rules = ", ".join(f'div:has(> [id="{esc(element)}"])' for element in elements if element)
    return f"<style>{rules} {{ display: none }}</style>" if rules else ""


def unseen(elements: Iterable[str]) -> str:
    """Takes fields (elements' ids) off the page, with their labels, that only clicks into pictures fill."""
    rules = ", ".join(f'div:has(> .mantine-Flex-root [id="{esc(element)}"])' for element in elements if element)
    return f"<style>{rules} {{ display: none }}</style>" if rules else ""


def picking(element: str, number: str) -> str:
    """Script of a picture that puts a number (an expression) into a number field (an element's id) as if it were typed."""
    typed = "Object.getOwnPropertyDescriptor(HTMLInputElement.prototype,'value').set.call"
    told = "i.dispatchEvent(new Event('input',{bubbles:true}))"
    return f"const i=document.getElementById('{element}');{typed}(i,String({number}));{told}"


def picking_share(element: str, whole: float) -> str:
    """Script of a picture that puts where across it was clicked, as a share of `whole`, into a number field (an element's id)."""
    share = "(event.clientX-this.getBoundingClientRect().left)/this.getBoundingClientRect().width"
    return picking(element, f"({share}*{whole:.6g}).toFixed(3)")


def heading(text: str, source: str = "") -> str:
    """The heading of a section, with what it comes from at the right."""
    row = "display:flex;justify-content:space-between;align-items:baseline;margin:8px 14px 2px;font-size:12.5px"
    told = f'<span style="color:var(--muted);font-size:11.5px">{esc(source)}</span>'
    return f'<div style="{row}"><b style="font-weight:650">{esc(text)}</b>{told}</div>'


def pressing(element: str) -> str:
    """Script of a row that presses a button (an element's id)."""
    return f"document.getElementById('{element}').click()"


def figure(svg: str, chips: Iterable[tuple[palette.RGB, str]], words: str) -> str:
    """A picture, what its colours mean, and a sentence about it; a double click shows it as large as the screen, and small again."""
    row = "".join(swatch(colour, label) for colour, label in chips)
    legend = f'<div style="margin-top:4px">{row}</div><div>{esc(words)}</div>'
    enlarge = "document.fullscreenElement ? document.exitFullscreen() : this.requestFullscreen()"
    return (
        f'<div data-figure title="Double click: the whole screen" ondblclick="{enlarge}" '
        f'style="margin:6px 14px;font-size:12px;line-height:1.7">{svg}{legend}</div>'
    )


def sentence(text: str) -> str:
    """Words that begin a sentence of their own."""
    return text[:1].upper() + text[1:]


def millimetres(metres: float, digits: int = 0) -> str:
    return f"{1e3 * metres:.{digits}f} mm"
