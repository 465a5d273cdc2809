"""Take the pictures of docs/app.md from the page itself, by chromium."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

FOLDER = Path(__file__).parent / "app"
# Window [px], and heights at which the pictures end.
WIDTH, HEIGHTS = 1180, {"log": 1000, "model": 1000, "motion": 1000, "loop": 1000, "use": 900}


def computed(page: Page) -> None:
    """Wait for what runs in the background."""
    page.wait_for_timeout(1500)
    page.wait_for_selector("#stop", state="hidden", timeout=300_000)


def main() -> None:
    """Open the example, and go through the steps."""
    command = [sys.executable, "-m", "piezotrack", "app", "--no-browser"]
    arguments = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server,
        sync_playwright() as driver,
    ):
        assert server.stdout is not None
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=arguments)
        page = browser.new_page(viewport={"width": WIDTH, "height": max(HEIGHTS.values())})
        page.goto(server.stdout.readline().split()[-1])
        page.click("text=Take the measured example")
        page.wait_for_selector("text=What this record can determine")
        for key, (name, height) in enumerate(HEIGHTS.items(), 1):
            page.set_viewport_size({"width": WIDTH, "height": height})
            page.keyboard.press(str(key))
            if name in ("model", "loop"):
                computed(page)
            page.wait_for_timeout(1500)
            page.screenshot(path=FOLDER / f"{name}.png")
        browser.close()
        server.terminate()


if __name__ == "__main__":
    main()
