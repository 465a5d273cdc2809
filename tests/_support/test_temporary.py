"""Temporary files: who may read them, and which of them are removed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path
from threading import Barrier, Thread

import pytest

from folders import ROOT
from piezotrack._support.files import temporary
from piezotrack._support.files.writing import replacing, write_document

POSIX = pytest.mark.skipif(os.name == "nt", reason="Windows has neither umask nor kill")


@pytest.fixture
def _private() -> object:
    before = os.umask(0o077)
    yield
    os.umask(before)


@POSIX
@pytest.mark.usefixtures("_private")
def test_threads_that_save_neither_change_the_umask_nor_see_another(tmp_path: Path) -> None:
    start, modes = Barrier(8), set()

    def save(number: int) -> None:
        start.wait()
        for _ in range(150):
            with replacing(tmp_path / f"{number}.json") as file:
                modes.add(file.stat().st_mode & 0o777)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [Thread(target=save, args=(number,)) for number in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert os.umask(0o077) == 0o077
    assert modes == {0o600}
    assert len(list(tmp_path.iterdir())) == 8


@POSIX
def test_a_result_is_readable_as_the_umask_says(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        path = write_document(tmp_path / "a.json", {})
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640


def test_the_umask_is_left_alone() -> None:
    # It belongs to the whole process, so that reading it changes it for other threads.
    for file in (ROOT / "python").rglob("*.py"):
        assert not re.search(r"\bumask\(", file.read_text(encoding="utf-8")), file


def left_by(host: str, process: int, folder: Path, *, age: float = 0.0) -> Path:
    path = folder / f".piezotrack-{host}-{process}-{os.urandom(8).hex()}.png"
    path.write_bytes(b"half")
    made = time.time() - age
    os.utime(path, (made, made))
    return path


def ended() -> int:
    """Return the number of a process that has ended."""
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        pass
    return process.pid


@POSIX
def test_files_of_runs_that_are_gone_are_removed_and_no_others(tmp_path: Path) -> None:
    here, day = temporary.this_host(), 86_400.0
    other = "00000000"
    gone = [
        left_by(here, ended(), tmp_path),
        # This process, before it had this number.
        left_by(here, os.getpid(), tmp_path),
        # The number now belongs to another program.
        left_by(here, os.getppid(), tmp_path, age=2 * day),
        left_by(other, 1, tmp_path, age=2 * day),
    ]
    kept = [
        left_by(here, os.getppid(), tmp_path),
        left_by(other, ended(), tmp_path, age=day / 2),
        temporary.create(tmp_path, ".csv"),
        tmp_path / ".piezotrack-notes",
        tmp_path / ".abcdefgh.png",
    ]
    for path in kept[3:]:
        path.touch()
    write_document(tmp_path / "a.json", {})
    assert [path for path in gone if path.exists()] == []
    assert sorted(tmp_path.iterdir()) == sorted([*kept, tmp_path / "a.json"])
    temporary.forget(kept[2])


def test_models_are_on_the_disk_before_they_replace_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []
    replace, sync = Path.replace, os.fsync

    def synced(handle: int) -> None:
        order.append(f"synced {os.fstat(handle).st_size} bytes")
        sync(handle)

    def replaced(path: Path, target: Path) -> Path:
        order.append(f"renamed to {target.name}")
        return replace(path, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", replaced)
    path = write_document(tmp_path / "dahl.json", {"a": 1})
    assert order == [f"synced {path.stat().st_size} bytes", "renamed to dahl.json"]
