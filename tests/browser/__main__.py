"""`python -m tests.browser`: find or install a Chromium for the browser tests, start it once, and say what was done."""

import sys

from playwright.sync_api import Error, sync_playwright

from tests.browser.chromium import ARGUMENTS, NoChromium, ensure


def main() -> int:
    try:
        path = ensure(print)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
            print(f"Chromium: version {browser.version} starts; the browser tests can run.")
            browser.close()
    except (NoChromium, Error) as error:
        print(f"Chromium: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
