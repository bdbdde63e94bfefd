"""Take a picture of a page in a headless browser, as reports are looked at and tested.

    python scripts/browser.py PAGE.html OUT.png [--width 1400] [--height 0] [--dark]

It needs Chromium and its driver; on Debian and Ubuntu: ``apt-get install --no-install-recommends chromium
chromium-driver``.
"""

from __future__ import annotations

import argparse
import base64
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--force-device-scale-factor=1",
)


def missing() -> str | None:
    """Return why no page can be opened here, or None."""
    if _browser() is None:
        return "there is no Chromium; on Debian: apt-get install chromium chromium-driver"
    if shutil.which("chromedriver") is None:
        return "there is no chromedriver; on Debian: apt-get install chromium-driver"
    return None


@contextmanager
def browser(*, dark: bool = False) -> Iterator[Chrome]:
    """Run a browser without a window, that reaches nothing by itself and forgets all, and yield it.

    Parameters
    ----------
    dark
        Whether pages are told that the user likes it dark.
    """
    # the library would look for a driver to download, and send statistics
    os.environ.update(SE_OFFLINE="true", SE_AVOID_STATS="true")
    from selenium.webdriver import Chrome, ChromeOptions
    from selenium.webdriver.chrome.service import Service

    options = ChromeOptions()
    options.binary_location = _browser() or ""
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        for flag in (*_FLAGS, f"--user-data-dir={profile}"):
            options.add_argument(flag)
        driver = Chrome(options=options, service=Service(shutil.which("chromedriver")))
        try:
            scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
            driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
            yield driver
        finally:
            driver.quit()


def show(driver: Chrome, page: Path, width: int, height: int = 900) -> None:
    """Open a page in a window of this size, as wide as it is on a phone or a desk."""
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    driver.get(page.resolve().as_uri())


def picture(driver: Chrome, height: int | None = None) -> bytes:
    """Return what is shown as PNG: the page down to a height, or all of it."""
    width = driver.execute_script("return innerWidth")
    whole = driver.execute_script("return document.documentElement.scrollHeight")
    clip = {"x": 0, "y": 0, "width": width, "height": height or whole, "scale": 1}
    found = driver.execute_cdp_cmd("Page.captureScreenshot", {"clip": clip, "captureBeyondViewport": True})
    return base64.b64decode(found["data"])


def main() -> int:
    """Take the picture that the command line asks for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("page", type=Path, metavar="PAGE.html")
    parser.add_argument("picture", type=Path, metavar="OUT.png")
    parser.add_argument("--width", type=int, default=1400, help="of the window (default: %(default)s)")
    parser.add_argument("--height", type=int, default=0, help="of the picture (default: all of the page)")
    parser.add_argument("--dark", action="store_true", help="for a user who likes it dark")
    arguments = parser.parse_args()
    if (why := missing()) is not None:
        parser.error(why)
    if not arguments.page.is_file():
        parser.error(f"{arguments.page}: there is no such file")
    with browser(dark=arguments.dark) as driver:
        show(driver, arguments.page, arguments.width)
        arguments.picture.write_bytes(picture(driver, arguments.height))
        complaints = [entry["message"] for entry in driver.get_log("browser")]
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    return 1 if complaints else 0


def _browser() -> str | None:
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)


if __name__ == "__main__":
    sys.exit(main())
