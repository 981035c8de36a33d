"""One Chromium for all browser tests; a workbench on a free port for each."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from handey_studio.app.server import start
from handey_studio.app.workbench import Workbench
from tests.browser.chromium import ARGUMENTS, ensure
from tests.session.samples import library

ARTEFACTS = Path(__file__).resolve().parents[2] / ".ci" / "artefacts"
LARGE = {"width": 1400, "height": 850}
SMALL = {"width": 1040, "height": 720}  # a small canvas between the panels: software rendering takes its time for every pixel


@pytest.fixture(scope="session")
def chromium(tmp_path_factory) -> Iterator[Browser]:
    path = ensure(lambda _: None)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        yield browser
        browser.close()


@pytest.fixture
def studio(tmp_path) -> Iterator:
    """`studio(session, run=…)` starts a workbench; it is stopped after the test."""
    running: list[Workbench] = []

    def begin(session, **options) -> Workbench:
        running.append(start(session, library=options.pop("library", library(tmp_path)), port=free_port(), **options))
        return running[-1]

    yield begin
    for workbench in running:
        workbench.stop()


@pytest.fixture
def visit(chromium) -> Iterator:
    """`visit(workbench)` opens a browser window of its own on it and waits until the button `ready` is there."""
    pages: list[Page] = []

    def arrive(workbench: Workbench, ready: str = "MOVE", viewport: dict[str, int] = SMALL) -> Page:
        page = chromium.new_context(viewport=viewport, accept_downloads=True).new_page()
        page.set_default_timeout(60_000)  # software rendering on a busy machine
        pages.append(page)
        page.goto(address(workbench))
        page.get_by_role("button", name=ready, exact=True).wait_for(timeout=60_000)
        return page

    yield arrive
    for page in pages:
        page.context.close()


def address(workbench: Workbench) -> str:
    """The workbench's URL."""
    return f"http://127.0.0.1:{workbench.server.get_port()}"


def free_port() -> int:
    """A port that nobody listens on right now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
