"""`python -m tests.browser.picture`: carries out Figure 1's MOVE in the workbench and keeps the guide's picture of it."""

import io
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from handey_studio import guide
from handey_studio.app.looking_at import ShowLayer
from handey_studio.app.playback import Seek
from handey_studio.app.server import start
from handey_studio.app.state import State
from handey_studio.app.workbench import Workbench
from handey_studio.world import Library
from tests.browser.chromium import ARGUMENTS, ensure
from tests.browser.conftest import address, free_port
from tests.browser.hands import pane, press, wait_until

KEPT = Path(guide.__file__).parent / "pictures" / "figure1.png"
WINDOW = {"width": 1440, "height": 900}
MINUTES = 10  # for a first MOVE on a machine, and software rendering


def main() -> None:
    path = ensure(print)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        workbench = start("figure1", library=Library(Path(folder)), port=free_port())
        browser = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        try:
            page = browser.new_page(viewport=WINDOW)
            page.set_default_timeout(MINUTES * 60_000)
            keep(taken(page, workbench))
        finally:
            browser.close()
            workbench.stop()
    sys.stdout.write(f"{KEPT}: {KEPT.stat().st_size / 1000:.0f} kB.\n")


def taken(page: Page, workbench: Workbench) -> bytes:
    """The page (PNG) after the MOVE, looking back at the part in the air, its grasp beside it."""
    page.goto(address(workbench))
    page.get_by_role("button", name="MOVE", exact=True).wait_for()
    press(page, "MOVE")
    wait_until(lambda: workbench.state.job is None and workbench.state.session.result is not None, MINUTES * 60)
    page.get_by_role("tab", name="Grasp").click()
    workbench.send(Seek(in_the_air(workbench.state)))
    workbench.send(ShowLayer("wrist box", False))
    pane(page, "next-step").get_by_text("Done").first.wait_for()
    page.evaluate("document.querySelectorAll('.mantine-Notification-closeButton').forEach(button => button.click())")
    time.sleep(10.0)  # notices fade, the scene is drawn
    return page.screenshot()


def in_the_air(state: State) -> float:
    """A time [s] in the middle of the transfer."""
    stretches = state.replay.stretches if state.replay is not None else ()
    return next((0.5 * (s.start + s.end) for s in stretches if s.what == "transfer"), 0.0)


def keep(png: bytes) -> None:
    """Every colour loses its last bit, which nobody sees and which takes an eighth of the file."""
    KEPT.parent.mkdir(exist_ok=True)
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
    Image.fromarray(pixels & np.uint8(0xFE)).save(KEPT, optimize=True)


if __name__ == "__main__":
    main()
