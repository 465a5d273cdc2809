"""How fast the page answers in a browser: a table for docs/app.md.

Run it as `python benches/page_latency.py`; it needs the groups of `pip install --group test .[app]`
and Debian's chromium. From the input of a person until the page is drawn again, of 60 moves.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

import piezotrack as pt

MOVES = 60
SAMPLES = 1_000_000


def opened(page: Any, url: str, log: Path) -> float:
    """Open a log, and return the time until it is drawn [s]."""
    page.goto(url)
    page.wait_for_selector("text=Take the measured example")
    begun = time.perf_counter()
    page.set_input_files("input[type=file]", log)
    page.wait_for_selector("text=What this record can determine", timeout=120_000)
    return time.perf_counter() - begun


def answers(page: Any) -> list[float]:
    """Return the times of the answers since the last call [ms]."""
    return page.evaluate(
        """() => {
          const found = performance.getEntriesByName("answer").map((one) => one.duration);
          performance.clearMeasures();
          return found;
        }"""
    )


def brushed(page: Any) -> list[float]:
    """Drag the right edge of the window on the drive."""
    box = page.locator("figure.chart canvas").nth(1).bounding_box()
    right, middle = box["x"] + box["width"] - 13, box["y"] + 60
    answers(page)
    page.mouse.move(right, middle)
    page.mouse.down()
    for k in range(MOVES):
        page.mouse.move(right - 4 * k, middle)
        page.wait_for_timeout(30)
    page.mouse.up()
    page.wait_for_timeout(500)
    return answers(page)


def slid(page: Any, label: str) -> list[float]:
    """Move a slider by keys."""
    slider = page.get_by_role("slider", name=re.compile(label)).first
    slider.focus()
    page.wait_for_timeout(500)
    answers(page)
    for k in range(MOVES):
        page.keyboard.press("ArrowRight" if k % 20 < 10 else "ArrowLeft")
        page.wait_for_timeout(60)
    page.wait_for_timeout(1000)
    return answers(page)


def row(name: str, times: list[float]) -> str:
    median, high = np.percentile(times, [50.0, 95.0])
    return f"| {name} | {len(times)} | {median:.0f} ms | {high:.0f} ms |"


def computed(page: Any) -> None:
    """Wait for what runs in the background."""
    page.wait_for_timeout(500)
    page.wait_for_selector("#stop", state="hidden", timeout=300_000)


def main() -> None:
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print("| input | answers | median | 95th percentile |\n| --- | --- | --- | --- |")
    chromium = shutil.which("chromium")
    command = [sys.executable, "-m", "piezotrack", "app", "--no-browser"]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server,
        tempfile.TemporaryDirectory() as folder,
        sync_playwright() as driver,
    ):
        assert server.stdout is not None
        url = server.stdout.readline().split()[-1]
        root = hasattr(os, "geteuid") and os.geteuid() == 0
        arguments = ["--no-sandbox"] if root else []
        browser = driver.chromium.launch(executable_path=chromium, args=arguments)
        small = pt.datasets.dbo_training().save(Path(folder) / "stage.csv")
        page = browser.new_page()
        opened(page, url, small)
        print(row("window on the drive, 8000 samples", brushed(page)))
        page.keyboard.press("2")
        computed(page)
        print(row("share that is fitted", slid(page, "Fitted share")))
        page.click("#stop") if page.is_visible("#stop") else None
        page.keyboard.press("2")
        computed(page)
        page.keyboard.press("3")
        page.wait_for_selector("text=Desired and simulated motion")
        print(row("frequency of the motion", slid(page, "Frequency")))
        page.keyboard.press("4")
        page.wait_for_selector("text=Nyquist", timeout=120_000)
        computed(page)
        print(row("gain of the loop, kp", slid(page, "^kp")))
        t = np.arange(SAMPLES) / 10e3
        u = 30.0 - 30.0 * np.cos(2.0 * np.pi * t)
        noise = np.random.default_rng(1).normal(0.0, 2e-9, SAMPLES)
        large = pt.Dataset(u=u, y=5e-7 * u + noise, dt=1e-4).save(Path(folder) / "large.npz")
        other = browser.new_page()
        first = opened(other, url, large)
        print(row("window on the drive, a million samples", brushed(other)))
        print(f"a million samples are drawn {first:.1f} s after they are dropped")
        browser.close()
        server.terminate()


if __name__ == "__main__":
    main()
