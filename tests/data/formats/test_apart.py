"""The process that reads with other people's libraries: a file that hangs or ends it is refused."""

from __future__ import annotations

import os
import signal
import sys
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest

import bad_readers
import piezotrack as pt
from children import child
from piezotrack.data.formats import apart
from piezotrack.data.formats.source import Source

if TYPE_CHECKING:
    from pathlib import Path

opens = apart.read_apart("json", "none")(bad_readers.opens)
RIGHT = np.arange(5.0)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "PATIENCE", 2.0)


def read(path: Path, text: str) -> np.ndarray:
    path.write_text(text, encoding="utf-8")
    table = opens(Source(path))
    return table.column(table.columns[0])


@pytest.mark.parametrize("when", ["{}\n", "none\n{}"])
@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("hang", "log: is not read within 2 s: expected a sound file"),
        ("end", "log: is damaged: it ended the process that read it, expected a sound file"),
        ("take", "log: asks for more memory than its samples need: expected a sound file"),
    ],
)
def test_a_file_that_hangs_or_ends_the_reader_is_refused(
    tmp_path: Path, what: str, sentence: str, when: str
) -> None:
    begun = time.monotonic()
    with pytest.raises(pt.DataError, match=f"^{sentence}$"):
        read(tmp_path / "log", when.format(what))
    assert time.monotonic() - begun < 20.0
    # The next file is read as before.
    assert np.array_equal(read(tmp_path / "log", "none"), RIGHT)


def test_what_a_library_prints_is_not_taken_for_an_answer(tmp_path: Path) -> None:
    assert np.array_equal(read(tmp_path / "log", "print\nprint"), RIGHT)


def test_a_fault_of_the_code_is_no_fault_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="a fault of ours"):
        read(tmp_path / "log", "fail")


def test_another_file_may_be_opened_in_between(tmp_path: Path) -> None:
    tables = []
    for name in ("one", "other"):
        (tmp_path / name).write_text("none", encoding="utf-8")
        tables.append(opens(Source(tmp_path / name)))
    for table in (*tables, *tables):
        assert np.array_equal(table.column(table.columns[0]), RIGHT)


def test_a_file_that_is_replaced_while_it_is_read_is_refused(tmp_path: Path) -> None:
    tables = []
    for name in ("one", "other"):
        (tmp_path / name).write_text("none", encoding="utf-8")
        tables.append(opens(Source(tmp_path / name)))
    (tmp_path / "one").write_text("none\nnone", encoding="utf-8")
    with pytest.raises(pt.DataError, match="one: has changed while it was read"):
        tables[0].column(tables[0].columns[0])


def test_one_process_serves_until_it_is_idle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def process() -> int:
        assert np.array_equal(read(tmp_path / "log", "none"), RIGHT)
        assert apart._reader is not None
        return apart._reader.process.pid

    first = process()
    assert process() == first
    monkeypatch.setattr(apart, "RELIED_ON", 0.0)
    assert process() != first


def test_without_a_python_to_start_files_are_read_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    apart._end()
    monkeypatch.setattr(sys, "executable", "/opt/program/that/embeds")
    assert np.array_equal(read(tmp_path / "log", "none"), RIGHT)
    assert apart._reader is None


@pytest.mark.skipif(os.name != "posix", reason="signals and forks are those of POSIX")
def test_an_interrupt_ends_the_wait_and_a_fork_has_a_reader_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_text("wait", encoding="utf-8")
    code = f"""
import os, signal, sys, threading
sys.path[:0] = {sys.path!r}
import bad_readers
from piezotrack.data.formats import apart
from piezotrack.data.formats.source import Source
opens = apart.read_apart("json", "none")(bad_readers.opens)
opens(Source({str(path)!r}))
first = apart._reader.process.pid
if (other := os.fork()) == 0:
    opens(Source({str(path)!r}))
    os._exit(apart._reader.process.pid == first)
assert os.waitpid(other, 0)[1] == 0
opens(Source({str(path)!r}))
assert apart._reader.process.pid == first
# Ctrl-C reaches both processes.
open({str(path)!r}, "w").write("hang")
def interrupt():
    for process in (first, os.getpid()):
        os.kill(process, signal.SIGINT)
threading.Timer(0.5, interrupt).start()
try:
    opens(Source({str(path)!r}))
except KeyboardInterrupt:
    print("interrupted", apart._reader)
open({str(path)!r}, "w").write("none")
opens(Source({str(path)!r}))
print(apart._reader.process.pid)
"""
    done = child(code)
    assert done.returncode == 0, done.stderr
    told, last = done.stdout.splitlines()
    assert told == "interrupted None"
    # It ends with the process that started it.
    with pytest.raises(ProcessLookupError):
        os.kill(int(last), signal.SIG_DFL)
