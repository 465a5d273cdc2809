"""What is printed, whatever is in names, and wherever it goes."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import piezotrack as pt
from commands import COMMAND, names, refusal, write_model
from piezotrack.cli.process.terminal import PlainStream, one_line

POSIX = pytest.mark.skipif(os.name == "nt", reason="needs a POSIX shell")
WORK = ["feedforward", "dahl.json", "sine:0.5Hz,0..50um,2s", "--dt", "0.02"]
WRITTEN = [f"feedforward.{ending}" for ending in ("csv", "png", "svg")]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_model()


def through(shell: str, *arguments: str) -> tuple[int, str, str]:
    """Run the command with something after it in a shell."""
    done = subprocess.run(
        ["sh", "-c", f"exec {shlex.join([*COMMAND, *arguments])} {shell}"],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.slow
@POSIX
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_reason_to_fail(closed: str) -> None:
    code, output, errors = through(closed, *WORK)
    assert (code, errors) == (0, "")
    assert (output == "") == (">&- " in closed + " " and not closed.startswith("2"))
    assert names("results") == WRITTEN
    # No result has what was printed.
    assert Path("results", "feedforward.csv").read_text().count("\n") == 101
    code, output, errors = through(closed, "feedforward", "gone.json", "x")
    assert (code, output) == (2, "")
    assert "Traceback" not in errors


FULL = pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device here")


@FULL
@pytest.mark.parametrize("arguments", [WORK, ["--help"], ["track", "--help"], ["--version"]])
def test_what_cannot_be_printed_is_said(arguments: list[str]) -> None:
    code, _, errors = through("> /dev/full", *arguments)
    assert (code, errors) == (1, "piezotrack: cannot print: no space left on device\n")


@POSIX
def test_a_reader_that_leaves_is_no_error() -> None:
    for arguments in (WORK, ["--help"]):
        assert through("| true", *arguments) == (0, "", "")
    assert names("results") == WRITTEN


@POSIX
def test_a_folder_that_cannot_be_made_is_named() -> None:
    code, _, errors = through("", *WORK, "--out", "a" * 300)
    assert code == 2
    assert errors == (
        f"piezotrack: --out: {'a' * 300} cannot be made a folder: file name too long\n"
    )


def refused(path: object, **_: object) -> Any:
    raise PermissionError(13, "Permission denied", str(path))


def test_a_folder_without_access_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "exists", refused)
    said = refusal(*WORK, "--out", "closed")
    assert said == "--out: closed cannot be made a folder: permission denied"


def test_a_file_without_access_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("piezotrack.identification.fitted.model_file.load", refused)
    assert refusal(*WORK) == "dahl.json: permission denied"


@POSIX
def test_the_working_folder_may_be_gone(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    arguments = [WORK[0], str(tmp_path / "dahl.json"), *WORK[2:], "--out", str(tmp_path / "o")]
    done = subprocess.run(
        ["sh", "-c", f"cd {gone} && rmdir {gone} && {shlex.join([*COMMAND, *arguments])}"],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert names(str(tmp_path / "o")) == WRITTEN


@pytest.mark.slow
@POSIX
@pytest.mark.parametrize(
    "arguments",
    [
        ["identify", "\x1b[31mred\r\n.csv"],
        ["feedforward", "dahl.json", "\x1b]0;title\x07"],
        [*WORK, "--out", "\x1b[31m\N{RIGHT-TO-LEFT OVERRIDE}[red]"],
        ["track", "dahl.json", *WORK[2:], "--limits", "\x9b31m"],
        ["\x1b[31mred"],
        ["identify", "--\x1b[31mred"],
    ],
)
def test_names_do_not_steer_the_terminal(arguments: list[str]) -> None:
    code, output, errors = through("", *arguments)
    assert code in (0, 2)
    steering = {"\x1b", "\r", "\x07", "\x9b", "\N{RIGHT-TO-LEFT OVERRIDE}"}
    assert not steering & set(output + errors)
    if code:
        assert r"\x" in errors
    else:
        assert r"\x1b[31m\u202e[red]/: feedforward.csv" in output
    if errors.startswith("piezotrack: "):
        assert errors.count("\n") == 1


def test_names_are_printed_in_one_line() -> None:
    assert (
        one_line("a\nb\tc\x1b\x7f\x85\u2066\u00e9") == r"a\nb" "\tc" r"\x1b\x7f\x85\u2066" "\u00e9"
    )


def test_a_progress_bar_still_steers_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    from io import StringIO

    from piezotrack._support.display.progress_bar import console

    screen = StringIO()
    monkeypatch.setattr(sys, "stderr", PlainStream(screen))
    place = console()
    assert place.file is screen
    print("\x1b[0m", file=sys.stderr)
    assert screen.getvalue() == "\\x1b[0m\n"


def test_memory_that_is_not_to_be_had_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise MemoryError("the response: 960 MB of memory are not to be had")

    monkeypatch.setattr(pt.Inverse, "played", full)
    assert refusal(*WORK) == "the response: 960 MB of memory are not to be had"
