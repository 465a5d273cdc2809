"""The command killed or interrupted at any moment: whole files, one line, no traceback."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from commands import log_text
from mutants import models

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX"),
]

# The command with its imports done: most of the time until it ends is then its work.
WARM = """
import sys, matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot, scipy.interpolate, rich.console, piezotrack as pt
from piezotrack.cli import main
for name in pt.__all__: getattr(pt, name)
print("ready", flush=True)
sys.stdin.readline()
main()
"""
COMMANDS = {
    "identify": ["identify", "log.csv", "--runs", "1", "--seed"],
    "track": ["track", "model.json", "--reference", "sine:0.2Hz,0..50um,5s", "--unstable", "--seed"],
}


def start(arguments: list[str], folder: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", WARM, *arguments, "--out", "out"],
        cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def files(folder: Path) -> dict[str, bytes]:
    out = folder / "out"
    return {p.name: p.read_bytes() for p in out.iterdir() if not p.name.startswith(".")}


def finished(name: str, seed: int, folder: Path) -> tuple[dict[str, bytes], float]:
    """What the command writes, and how long it takes [s]."""
    process, began = start([*COMMANDS[name], str(seed)], folder), time.perf_counter()
    _, said = process.communicate("\n", timeout=120.0)
    assert process.returncode == 0, said
    return files(folder), time.perf_counter() - began


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("number", ["SIGKILL", "SIGINT"])
def test_a_signal_at_any_moment(
    name: str, number: str, request: pytest.FixtureRequest, tmp_path: Path, record_property: Any
) -> None:
    (tmp_path / "log.csv").write_text(log_text(), encoding="utf-8")
    (tmp_path / "model.json").write_text(models()[0], encoding="utf-8")
    random_wait = random.Random(request.config.getoption("--soak-seed"))
    new, took = finished(name, 2, tmp_path)
    old, _ = finished(name, 1, tmp_path)
    tries, stopped = max(3, request.config.getoption("--soak-files") // 600), 0
    for _ in range(tries):
        process = start([*COMMANDS[name], "2"], tmp_path)
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
        time.sleep(random_wait.uniform(0.0, took))
        process.send_signal(getattr(signal, number))
        _, said = process.communicate(timeout=60.0)
        stopped += process.returncode != 0
        assert "Traceback" not in said
        if number == "SIGINT":
            assert process.returncode in (0, 130), said
        for file, content in files(tmp_path).items():
            assert content in (old.get(file), new.get(file)), f"{file} is torn"
    assert files(tmp_path).keys() == old.keys() == new.keys()
    record_property("tally", (f"{number} in {name}", tries, tries - stopped, 0, stopped, 0))
