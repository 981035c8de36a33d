"""What a user's hands and eyes do: type into a field, press a button, wait for a sentence."""

import time
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Locator, Page

PAUSE_S = 0.15  # the browser sends at most one change every 50 ms


def wait_until(true: Callable[[], object], seconds: float = 30.0) -> None:
    """Poll until it holds; a test that waits in vain fails."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "this never came true"
        time.sleep(0.05)


def press(page: Page, name: str) -> None:
    """Press the button of that name."""
    page.get_by_role("button", name=name, exact=True).click()
    time.sleep(PAUSE_S)


def fields(page: Page, label: str) -> Locator:
    """The input fields beside a label."""
    row = page.locator("label", has_text=label).locator('xpath=ancestor::*[contains(@class,"mantine-Flex-root")][1]')
    return row.locator("input")


def type_into(page: Page, label: str, text: str, number: int = 0) -> None:
    """Replace what a field holds and press Enter."""
    field = fields(page, label).nth(number)
    field.fill(text)
    field.press("Enter")
    time.sleep(PAUSE_S)


def choose(page: Page, label: str, option: str) -> None:
    """Choose from a drop-down list."""
    fields(page, label).first.click()
    page.get_by_role("option", name=option, exact=True).click()
    time.sleep(PAUSE_S)


def says(page: Page, words: str) -> None:
    """Wait until a notice says so."""
    page.get_by_role("alert").filter(has_text=words).first.wait_for(timeout=20_000)


def pane(page: Page, name: str) -> Locator:
    """A piece of the page by its test id."""
    return page.get_by_test_id(name)


def upload(page: Page, button: str, *files: Path) -> None:
    """Press an upload button and choose a file, for each of the files."""
    for file in files:
        with page.expect_file_chooser() as opened:
            page.get_by_role("button", name=button, exact=True).click()
        opened.value.set_files(file)
        time.sleep(3 * PAUSE_S)
