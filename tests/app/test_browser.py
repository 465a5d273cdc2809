"""The page in a real browser: from a dropped log to an exported controller."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from commands import ran
from piezotrack.app.state import State

if TYPE_CHECKING:
    from collections.abc import Iterator

CHROMIUM = shutil.which("chromium")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed"),
]


@pytest.fixture
def address(request: pytest.FixtureRequest) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    more = getattr(request, "param", [])
    command = [sys.executable, "-m", "piezotrack", "app", "--no-browser", *more]
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
    browser: Any, address: tuple[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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

    # The commands of the page write the same file.
    lines = page.locator("details:has-text('and as commands') pre").inner_text().splitlines()
    monkeypatch.chdir(tmp_path)
    for line in lines:
        ran(*shlex.split(line)[1:])
    assert Path("tuned/controller.json").read_bytes() == kept.read_bytes()

    page.reload()
    page.wait_for_selector("text=All steps in Python")
    assert [one.get_attribute("aria-label") for one in page.query_selector_all("nav .lamp")] == [
        "green"
    ] * 5
    assert faults == []


def test_a_comma_is_a_decimal_point_and_words_are_no_number(
    browser: Any, address: tuple[str, Any], tmp_path: Path
) -> None:
    page, faults = opened(browser, address[0])
    page.click("text=Take the measured example")
    page.wait_for_selector("text=What this record can determine")
    interval = page.get_by_label("Interval, where there are no times, s")
    for words in ("5 ms", "1,000.5"):
        interval.fill(words)
        interval.press("Enter")
        page.wait_for_selector(f"text={words} is no number")
    interval.fill("-1")
    interval.press("Enter")
    page.wait_for_selector("text=expected a number above 0; the value before is used")
    interval.fill("0,005")
    interval.press("Enter")
    page.wait_for_selector(".fault", state="detached")
    code = page.locator("details:has-text('The same in Python') pre")
    page.wait_for_function("() => document.body.textContent.includes('dt=0.005')")
    assert "dt=0.005" in (code.text_content() or "")
    # A saved state is chosen as a log is.
    page.keyboard.press("Tab")
    page.keyboard.press("5")
    page.wait_for_selector("text=Fit a model first")
    state = tmp_path / "page.piezotrack.json"
    # The address follows a fifth of a second later.
    page.wait_for_timeout(1000)
    link = page.evaluate("() => location.hash")
    assert "state=" in link
    state.write_text(json.dumps(State.of_link(link.partition("state=")[2]).document()), "utf-8")
    second, _ = opened(browser, address[0])
    second.set_input_files("input[type=file]", state)
    second.wait_for_selector("main >> text=training.csv is not open: drop it here again")
    second.get_by_role("button", name="Go to Log").click()
    second.wait_for_selector("text=Drop a log here")
    assert second.query_selector("input[type=file]")
    assert faults == []


def test_an_emptied_field_beside_a_slider_is_said(
    browser: Any, address: tuple[str, Any], tmp_path: Path
) -> None:
    page, faults = opened(browser, address[0])
    log = pt.datasets.dbo_training()[3.0:13.0].save(tmp_path / "stage.csv")
    page.set_input_files("input[type=file]", log)
    page.get_by_role("button", name="Next: Model").click()
    share = page.get_by_label("Fitted share of the window as a number")
    for words, sentence in (("", "expected a number"), ("60", "expected 0.2 to 0.9")):
        share.fill(words)
        share.press("Enter")
        page.wait_for_selector(f"text={sentence}; the value before is used")
    assert faults == []


def test_the_step_that_is_shown_is_in_the_rail_of_a_phone(
    browser: Any, address: tuple[str, Any]
) -> None:
    page, faults = opened(browser, address[0])
    page.set_viewport_size({"width": 390, "height": 844})
    for step in "51":
        page.keyboard.press(step)
        page.wait_for_selector(f"[aria-current=step] >> text={step} ")
        box = page.locator("[aria-current=step]").bounding_box()
        assert box["x"] > -1.0
        assert box["x"] + box["width"] < 391.0
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


def test_stop_ends_the_fits_and_keeps_what_is_done(browser: Any, address: tuple[str, Any]) -> None:
    page, faults = opened(browser, address[0])
    page.click("text=Take the measured example")
    page.keyboard.press("2")
    page.wait_for_selector(".card .value:has-text('m')", timeout=60_000)
    page.keyboard.press("s")
    page.wait_for_selector("#stop", state="hidden", timeout=60_000)
    values = [one.inner_text() for one in page.query_selector_all(".card .value")]
    assert "stopped" in values
    assert any(re.fullmatch(r"[\d.]+ [un]m", one) for one in values)
    page.get_by_role("button", name="Fit again").click()
    page.wait_for_selector("#stop", state="visible")
    assert faults == []


def test_a_million_samples_are_dragged_over(
    browser: Any, address: tuple[str, Any], tmp_path: Path
) -> None:
    page, faults = opened(browser, address[0])
    t = np.arange(1_000_000) / 10e3
    u = 30.0 - 30.0 * np.cos(2.0 * np.pi * t)
    log = pt.Dataset(u=u, y=5e-7 * u, dt=1e-4).save(tmp_path / "large.npz")
    page.set_input_files("input[type=file]", log)
    page.wait_for_selector("text=What this record can determine", timeout=60_000)
    box = page.locator("figure.chart canvas").nth(1).bounding_box()
    middle = box["y"] + 60
    page.mouse.move(box["x"] + box["width"] - 13, middle)
    page.mouse.down()
    for share in (0.9, 0.8, 0.7, 0.6, 0.5):
        page.mouse.move(box["x"] + share * box["width"], middle)
    page.mouse.up()
    page.wait_for_function(
        """() => /used from 0 to (4[0-9]|5[0-4])/.test(document.body.innerText)""", timeout=20_000
    )
    assert faults == []


def test_each_step_reads_as_text(browser: Any, address: tuple[str, Any]) -> None:
    page, faults = opened(browser, address[0])
    page.click("text=Take the measured example")
    page.wait_for_selector("figure.chart")
    seen = {1: page.locator("main").aria_snapshot()}
    page.keyboard.press("2")
    page.wait_for_selector("text=Loop on the test", timeout=60_000)
    seen[2] = page.locator("main").aria_snapshot()
    page.keyboard.press("s")
    for key, words in (("3", "Desired and simulated"), ("4", "Nyquist"), ("5", "All steps in")):
        page.keyboard.press(key)
        page.wait_for_selector(f"text={words}", timeout=60_000)
        seen[int(key)] = page.locator("main").aria_snapshot()
    # Each chart is an image with its sentence in numbers, each slider has a unit or its two ends.
    wanted = {
        1: ('combobox "Drive"', 'img "Loop. The hysteresis loop: '),
        2: ('combobox "Drift of the sensor"', 'img "Error over time. Measured less model'),
        3: ('slider "Frequency, Hz"', 'img "Voltage. The voltage of the inverse, '),
        4: ("slider", 'img "Nyquist. The open loop'),
        5: ('button "Export"', 'combobox "Form"'),
    }
    for step, parts in wanted.items():
        for part in parts:
            assert part in seen[step], (part, seen[step][:3000])
    sliders = page.evaluate(
        """() => [...document.querySelectorAll("input[type=range]")].map(
          (one) => one.getAttribute("aria-valuetext"))"""
    )
    assert all(sliders)
    assert faults == []


@pytest.mark.parametrize("address", [["--device", "virtual:"]], indirect=True)
def test_a_device_is_recorded_and_has_a_stop(browser: Any, address: tuple[str, Any]) -> None:
    page, faults = opened(browser, address[0])
    stop = page.get_by_role("button", name="STOP the device")
    assert stop.is_visible()
    assert page.get_by_role("button", name="Record", exact=True).is_disabled()
    page.get_by_role("button", name="Slow first stroke").click()
    page.wait_for_selector("text=The slow stroke:", timeout=60_000)
    page.get_by_role("button", name="Record", exact=True).click()
    page.wait_for_selector("h2:has-text('measured.csv')", timeout=60_000)
    page.keyboard.press("Escape")
    page.keyboard.press("5")
    page.wait_for_selector("text=Fit a model first")
    assert stop.is_visible()
    assert faults == []
