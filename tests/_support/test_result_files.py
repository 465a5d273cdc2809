"""Results that belong together: all new, or marked as incomplete."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

import piezotrack as pt
from piezotrack._support.files import sets
from piezotrack._support.files.sets import MARKER
from piezotrack._support.files.temporary import this_host
from piezotrack._support.files.writing import make_folder, replacing, result_set, write_document

NAMES = ["a.csv", "b.json", "c.png", "d.svg"]
POSIX = pytest.mark.skipif(os.name == "nt", reason="Windows cannot tell whether a process runs")


def save(folder: Path, text: str, names: list[str] = NAMES) -> None:
    with result_set(folder):
        for name in names:
            with replacing(folder / name) as file:
                file.write_text(text)


def content(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def listed(folder: Path) -> list[str]:
    document = json.loads((folder / MARKER).read_text())
    return [entry["result"] for entry in document["files"]]


def test_nothing_is_replaced_before_all_are_complete(tmp_path: Path) -> None:
    save(tmp_path, "old")

    def interrupted() -> None:
        with result_set(tmp_path):
            for name in NAMES[:3]:
                with replacing(tmp_path / name) as file:
                    file.write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert content(tmp_path) == dict.fromkeys(NAMES, "old")
    save(tmp_path, "new")
    assert content(tmp_path) == dict.fromkeys(NAMES, "new")


def test_a_signal_as_the_marker_is_opened_leaves_what_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path, "old")
    opened = Path.open

    def interrupted(path: Path, *mode: Any, **named: Any) -> Any:
        file = opened(path, *mode, **named)
        if path.name == MARKER and mode == ("x",):
            file.close()
            raise KeyboardInterrupt
        return file

    monkeypatch.setattr(Path, "open", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(tmp_path, "new")
    assert content(tmp_path) == dict.fromkeys(NAMES, "old")


def test_a_marker_that_has_no_room_leaves_what_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path, "old")
    opened = Path.open

    def full(path: Path, *mode: Any, **named: Any) -> Any:
        file = opened(path, *mode, **named)
        if path.name == MARKER and mode == ("x",):

            def write(text: str) -> int:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), text[:0])

            file.write = write
        return file

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises((OSError, pt.DataError), match=r"[Nn]o space left"):
        save(tmp_path, "new")
    monkeypatch.undo()
    assert content(tmp_path) == dict.fromkeys(NAMES, "old")
    save(tmp_path, "new")
    assert content(tmp_path) == dict.fromkeys(NAMES, "new")


def test_a_set_within_a_set_joins_it(tmp_path: Path) -> None:
    with result_set(tmp_path):
        save(tmp_path, "first", NAMES[:2])
        assert not (tmp_path / "a.csv").exists()
        save(tmp_path, "second", NAMES[1:])
        assert not (tmp_path / "d.svg").exists()
    assert content(tmp_path) == {"a.csv": "first"} | dict.fromkeys(NAMES[1:], "second")


# A child that is killed when it has renamed `count` files of the set.
KILLED = """
import os, pathlib, signal, sys
sys.path.insert(0, sys.argv[3])
from test_result_files import save
count, replace = int(sys.argv[2]), pathlib.Path.replace
def some(path, target):
    global count
    if count == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    count -= 1
    return replace(path, target)
pathlib.Path.replace = some
save(pathlib.Path(sys.argv[1]), sys.argv[4], sys.argv[5].split())
"""


def kill_after(count: int, folder: Path, text: str = "new", names: list[str] = NAMES) -> None:
    here = str(Path(__file__).parent)
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(folder), str(count), here, text, " ".join(names)],
        check=False,
        timeout=60.0,
    )
    assert done.returncode == -9


@POSIX
@pytest.mark.parametrize("count", range(4))
def test_what_a_killed_run_has_not_renamed_is_listed_and_renamed_by_the_next(
    tmp_path: Path, count: int
) -> None:
    save(tmp_path, "old")
    kill_after(count, tmp_path)
    found = {name: (tmp_path / name).read_text() for name in NAMES}
    assert list(found.values()) == ["new"] * count + ["old"] * (4 - count)
    assert listed(tmp_path) == NAMES
    assert "older than the others" in json.loads((tmp_path / MARKER).read_text())["note"]
    # Another set, or a single file.
    if count % 2:
        save(tmp_path, "other", ["x.csv", "y.csv"])
        more = {"x.csv": "other", "y.csv": "other"}
    else:
        with replacing(tmp_path / "x.csv") as file:
            file.write_text("other")
        more = {"x.csv": "other"}
    assert content(tmp_path) == dict.fromkeys(NAMES, "new") | more


@pytest.mark.slow
@POSIX
@pytest.mark.parametrize("count", range(5))
def test_a_run_that_is_killed_while_it_finishes_another_is_finished(
    tmp_path: Path, count: int
) -> None:
    save(tmp_path, "old")
    kill_after(1, tmp_path)
    # The marker is replaced, c and d of the first run are renamed, then the two of the second.
    kill_after(count, tmp_path, "newer", ["b.json", "x.csv"])
    save(tmp_path, "other", ["y.csv", "z.csv"])
    found = content(tmp_path)
    assert {found[name] for name in ("a.csv", "c.png", "d.svg")} == {"new"}
    assert (found["b.json"], found.get("x.csv")) == ("newer", "newer") if count else ("new", None)


@POSIX
def test_what_has_been_replaced_since_is_not_replaced_again(tmp_path: Path) -> None:
    save(tmp_path, "old")
    kill_after(1, tmp_path)
    (tmp_path / "d.svg").write_text("by hand")
    later = (tmp_path / "d.svg").stat().st_mtime + 10.0
    os.utime(tmp_path / "d.svg", (later, later))
    save(tmp_path, "newer", ["b.json"])
    expected = {"a.csv": "new", "b.json": "newer", "c.png": "new", "d.svg": "by hand"}
    assert content(tmp_path) == expected


def test_a_file_that_cannot_be_replaced_is_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path, "old")
    replace = Path.replace

    def not_c(path: Path, target: Path) -> Path:
        if Path(target).name == "c.png":
            raise PermissionError(13, "Permission denied")
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", not_c)
    with pytest.raises(
        pt.DataError, match=rf"c\.png cannot be written: permission denied; {MARKER} lists"
    ):
        save(tmp_path, "new")
    assert listed(tmp_path) == ["c.png"]
    assert (tmp_path / "c.png").read_text() == "old"
    # It stays listed, and does not keep other results from being written.
    save(tmp_path, "other", ["x.csv", "y.csv"])
    assert listed(tmp_path) == ["c.png"]
    monkeypatch.undo()
    save(tmp_path, "other", ["x.csv", "y.csv"])
    assert content(tmp_path) == dict.fromkeys(NAMES, "new") | {"x.csv": "other", "y.csv": "other"}


def test_a_folder_in_the_place_of_a_result_is_found_before_any_is_replaced(tmp_path: Path) -> None:
    save(tmp_path, "old", NAMES[:3])
    (tmp_path / "d.svg").mkdir()
    with pytest.raises(pt.DataError, match=r"d\.svg cannot be written: it is a folder"):
        save(tmp_path, "new")
    (tmp_path / "d.svg").rmdir()
    assert content(tmp_path) == dict.fromkeys(NAMES[:3], "old")


def test_ctrl_c_while_files_are_renamed_waits_for_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path, "old")
    replace = Path.replace
    pressed: list[Path] = []

    def interrupted(path: Path, target: Path) -> Path:
        if Path(target).name == "c.png" and not pressed:
            pressed.append(target)
            raise KeyboardInterrupt
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(tmp_path, "new")
    assert content(tmp_path) == dict.fromkeys(NAMES, "new")


def test_threads_that_save_the_same_set_never_mix_it(tmp_path: Path) -> None:
    def often(text: str) -> None:
        for _ in range(20):
            save(tmp_path, text)

    threads = [Thread(target=often, args=(text,)) for text in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = content(tmp_path)
    assert sorted(found) == NAMES
    assert len(set(found.values())) == 1


MARKERS = [
    "",
    "[",
    "[]",
    "5",
    '{"files": 5}',
    '{"files": [5, {}, {"result": "a.csv"}, {"result": 1, "temporary": 2}]}',
    '{"host": 5, "process": "x", "files": [{"result": "../a.csv", "temporary": "../b"}]}',
]


@pytest.mark.parametrize("text", MARKERS)
def test_a_marker_that_is_no_marker_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    monkeypatch.setattr(sets, "PATIENCE", 0.05)
    (tmp_path / MARKER).write_text(text)
    save(tmp_path, "new")
    assert content(tmp_path) == dict.fromkeys(NAMES, "new")


def test_a_marker_leads_to_no_other_folder(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    temporary = ".piezotrack-00000000-1-0123456789abcdef.json"
    for place in (folder, tmp_path):
        (place / temporary).write_text("foreign")
    files = [
        {"result": "../a.csv", "temporary": temporary},
        {"result": "..", "temporary": temporary},
        {"result": "\0", "temporary": temporary},
        {"result": "a.csv", "temporary": f"../{temporary}"},
        {"result": "a.csv", "temporary": "notes.txt"},
    ]
    document = {"host": this_host(), "process": 2**31, "files": files}
    (folder / MARKER).write_text(json.dumps(document))
    (folder / "notes.txt").write_text("mine")
    save(folder, "new", NAMES[1:])
    expected = dict.fromkeys(NAMES[1:], "new") | {"notes.txt": "mine", temporary: "foreign"}
    assert content(folder) == expected
    assert sorted(path.name for path in tmp_path.iterdir()) == [temporary, "results"]


def test_the_name_of_the_marker_is_refused(tmp_path: Path) -> None:
    with pytest.raises(pt.DataError, match="expected another name"):
        write_document(tmp_path / MARKER, {"a": 1})
    assert list(tmp_path.iterdir()) == []


def test_a_marker_with_a_name_that_no_file_can_have_is_no_obstacle(tmp_path: Path) -> None:
    entry = '{"temporary": ".piezotrack-h-1-a.json", "result": "\\ud800"}'
    (tmp_path / MARKER).write_text(f'{{"host": "h", "process": 1, "files": [{entry}]}}')
    os.utime(tmp_path / MARKER, (0.0, 0.0))
    write_document(tmp_path / "a.json", {"a": 1})
    assert (tmp_path / "a.json").exists()


def test_a_folder_without_a_name_is_refused() -> None:
    with pytest.raises(pt.DataError, match="expected a name, or "):
        make_folder("")


def test_an_interruption_while_the_marker_is_set_leaves_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = sets._write

    def interrupted(*args: Any, **kwargs: Any) -> None:
        write(*args, **kwargs)
        raise KeyboardInterrupt

    monkeypatch.setattr(sets, "_write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(tmp_path, "new")
    assert list(tmp_path.iterdir()) == []
