"""Where the tests' Chromium comes from, and how it is started."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


class NoChromium(RuntimeError):
    """There is no Chromium, and none could be installed."""


def find() -> tuple[str, str] | None:
    """(path, where it comes from) of a Chromium that is there, None if there is none."""
    for name in NAMES:
        path = shutil.which(name)
        if path:
            return path, f"{name} on PATH"
    own = playwrights_own()
    return (own, "Playwright's own") if own and Path(own).is_file() else None


def playwrights_own() -> str:
    """Where Playwright keeps, or would keep, its own Chromium."""
    with sync_playwright() as playwright:
        return playwright.chromium.executable_path


def ensure(say: Callable[[str], None]) -> str:
    """Path of a Chromium, installed if there is none; every step is said. Raises NoChromium."""
    found = find()
    if found:
        say(f"Chromium: {found[0]} ({found[1]}).")
        return found[0]
    say("Chromium: none on PATH, and Playwright has none of its own.")
    for what, command in _ways():
        say(f"Chromium: trying {what}: {' '.join(command)}")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        found = find()
        if found:
            say(f"Chromium: installed, {found[0]} ({found[1]}).")
            return found[0]
        say(f"Chromium: that did not help (exit status {done.returncode}): {(done.stderr or done.stdout).strip()[-300:]}")
    raise NoChromium("no Chromium was found or could be installed; put chromium on PATH and try again.")


def _ways() -> list[tuple[str, list[str]]]:
    """What may install one here: the system's package manager for root, then Playwright."""
    ways = []
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        if shutil.which("apt-get"):
            ways.append(("the system's package lists", ["apt-get", "update", "-q"]))
            ways.append(("the system's package manager", ["apt-get", "install", "-y", "-q", "chromium"]))
        elif shutil.which("dnf"):
            ways.append(("the system's package manager", ["dnf", "install", "-y", "chromium"]))
        elif shutil.which("apk"):
            ways.append(("the system's package manager", ["apk", "add", "chromium"]))
    return [*ways, ("Playwright", [sys.executable, "-m", "playwright", "install", "chromium"])]
