"""The page in a real browser: from a dropped log to an exported controller."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CHROMIUM = shutil.which("chromium")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed"),
]


@pytest.fixture
def address() -> Iterator[tuple[str, subprocess.Popen[str]]]:
    command = [sys.executable, "-m", "piezotrack", "app", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        found = re.search(r"http\S+", server.stdout.readline())
        assert found is not None
        yield found.group(), server
        server.kill()


@pytest.fixture
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    # Chromium does not run as root in a sandbox of its own.
    arguments = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with sync_playwright() as driver:
        made = driver.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield made
        made.close()


def opened(browser: Any, url: str) -> tuple[Any, list[str]]:
    page = browser.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(url)
    page.wait_for_selector("text=Take the measured example")
    return page, faults


def test_from_a_dropped_log_to_a_controller(
    browser: Any, address: tuple[str, Any], tmp_path: Path
) -> None:
    url, _ = address
    page, faults = opened(browser, url)
    log = pt.datasets.dbo_training()[3.0:13.0].save(tmp_path / "stage.csv")
    page.set_input_files("input[type=file]", log)
    page.wait_for_selector("figure.chart")
    assert "stage.csv" in page.inner_text("main")

    begun = time.monotonic()
    page.keyboard.press("2")
    page.wait_for_selector("#stop", state="visible")
    page.wait_for_selector("#stop", state="hidden", timeout=120_000)
    assert len(page.query_selector_all(".card .value")) > 10
    page.keyboard.press("3")
    page.wait_for_selector("text=Desired and simulated motion")
    page.keyboard.press("4")
    page.wait_for_selector("text=Nyquist")
    page.wait_for_selector("#stop", state="hidden", timeout=120_000)
    page.keyboard.press("5")
    with page.expect_download() as taken:
        page.get_by_role("button", name="Controller", exact=True).click()
    kept = tmp_path / "controller.json"
    taken.value.save_as(kept)
    assert pt.load_controller(kept).dt == pytest.approx(0.005)
    assert time.monotonic() - begun < 150.0

    page.reload()
    page.wait_for_selector("text=All steps in Python")
    assert [one.get_attribute("aria-label") for one in page.query_selector_all("nav .lamp")] == [
        "green"
    ] * 5
    assert faults == []


def test_two_windows_do_not_share_and_a_killed_server_is_said(
    browser: Any, address: tuple[str, Any], tmp_path: Path
) -> None:
    url, server = address
    first, _ = opened(browser, url)
    second, _ = opened(browser, url)
    broken = tmp_path / "broken.csv"
    broken.write_bytes(bytes(range(256)) * 20)
    first.set_input_files("input[type=file]", broken)
    first.wait_for_selector(".message .lamp.red")
    assert "Take the measured example" in second.inner_text("main")
    server.kill()
    first.wait_for_selector("text=The program has ended", timeout=15_000)
