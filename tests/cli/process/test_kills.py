"""Commands that are killed while they write: whole files, and never a mixture unnoticed."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

import piezotrack as pt
from commands import HEADING, log_text, write_model
from piezotrack._support.files.sets import MARKER
from piezotrack._support.files.temporary import is_temporary
from piezotrack._support.files.writing import write_document

pytestmark = pytest.mark.skipif(
    os.name == "nt", reason="Windows cannot tell whether a process runs"
)

# Its sensors are noisy: another seed gives another result.
OF_THE_PAPER = ("--stage", "xu-li-2010")
WORK = {
    "track": ["track", "dahl.json", "sine:0.5Hz,0..50um,4s", *OF_THE_PAPER],
    "contour": ["contour", "dahl.json", "circle:1Hz,5um", *OF_THE_PAPER],
    "identify": [
        *("identify", "log.csv", "--model", "dahl"),
        *("--runs", "1", "--test", "log.csv"),
    ],
    "compare": [
        "compare",
        "log.csv",
        "--runs",
        "1",
        "--model",
        "dahl",
        "--model",
        "bouc-wen",
        "--window",
        ":3",
    ],
    "tune": [
        *("tune", "dahl.json", "sine:0.5Hz,10..60um,4s", "--noise", "60nm"),
        *("--dt", "0.02", "--limits", "0:75", "--parts", "pid"),
    ],
    "learn": [
        *("learn", "dahl.json", "sine:0.5Hz,10..60um,4s", "--noise", "60nm"),
        *("--dt", "0.02", "--limits", "0:75", "--trials", "3"),
    ],
    "compare-controllers": [
        *("compare-controllers", "dahl.json", "--controllers", "PID", "--frequencies", "0.5,1,2"),
        *("--dt", "0.02", "--limits", "0:75", "--noise", "60nm"),
        *("--runs", "1", "--draws", "1"),
    ],
    # Each seed is a controller of its own.
    "export": ["export", "SEED.json", "--name", "axis"],
}
# Results are renamed slowly: on any machine, kills meet the renaming.
SLOWLY = (
    "import pathlib, time; replace = pathlib.Path.replace; "
    "pathlib.Path.replace = lambda path, target: (time.sleep(0.05), replace(path, target))[1]"
)


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_model()
    Path("log.csv").write_text(log_text(), encoding="utf-8")
    for seed in (1, 2):
        feedback = pt.Pid.from_um(kp=0.05 * seed, ti=0.02)
        pt.Controller(dt=0.02, limits=(0.0, 75.0 * seed), feedback=feedback).save(f"{seed}.json")


def start(work: list[str], out: str, seed: int) -> subprocess.Popen[bytes]:
    words = f"{HEADING}; {SLOWLY}; main()"
    drawn = () if work[0] == "export" else ("--seed", str(seed))
    asked = [word.replace("SEED", str(seed)) for word in work]
    return subprocess.Popen(
        [sys.executable, "-c", words, *asked, "--overwrite", "--out", out, *drawn],
        stdout=subprocess.DEVNULL,
    )


def content(folder: str) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


def is_writing(out: str) -> bool:
    files = os.listdir(out) if Path(out).is_dir() else []
    return any(is_temporary(name) or name == MARKER for name in files)


def wait_for_writing(process: subprocess.Popen[bytes], out: str) -> None:
    """Wait until a command begins to write, or has ended."""
    while process.poll() is None and not is_writing(out):
        time.sleep(0.002)


def whole(work: list[str], seed: int) -> tuple[dict[str, bytes], float]:
    """Return the content that a command writes, and for how long it writes [s]."""
    out = f"whole{seed}"
    with start(work, out, seed) as process:
        wait_for_writing(process, out)
        begun = ended = time.monotonic()
        while process.poll() is None:
            if is_writing(out):
                ended = time.monotonic()
            time.sleep(0.002)
    assert process.returncode == 0
    return content(out), ended - begun


def kill_often(work: list[str], tries: int) -> None:
    old, took = whole(work, 1)
    new, _ = whole(work, 2)
    assert old.keys() == new.keys()
    differing = [name for name in old if old[name] != new[name]]
    assert len(differing) > 2
    moments = random.Random(5)
    hit = 0
    for number in range(tries):
        out = f"out{number}"
        Path(out).mkdir()
        for name, data in old.items():
            Path(out, name).write_bytes(data)
        with start(work, out, 2) as process:
            wait_for_writing(process, out)
            time.sleep(moments.uniform(0.0, 1.0) * took)
            process.kill()
        writing = is_writing(out)
        hit += writing
        # It came after the writing: the machine is faster by now than when it was timed.
        took *= 1.0 if writing else 0.7
        files = content(out)
        assert all(files[name] in (old[name], new[name]) for name in old), "torn"
        mixed = len({files[name] == new[name] for name in differing}) == 2
        assert MARKER in files or not mixed, "mixed"
        assert all(is_temporary(name) for name in files.keys() - old.keys() - {MARKER})
        # The next run, with another result.
        write_document(Path(out, "next.json"), {})
        files = content(out)
        del files["next.json"]
        assert files in (old, new)
    assert hit >= tries // 3, "killed before or after the writing"


@pytest.mark.slow
@pytest.mark.parametrize("name", WORK)
def test_commands_that_are_killed_often_leave_no_torn_or_mixed_results(name: str) -> None:
    kill_often(WORK[name], 12)
