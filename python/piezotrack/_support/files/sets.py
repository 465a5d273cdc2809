"""Results that belong together: several files of a folder, put in place at once.

They are written to temporary files first. Only when all are complete are they renamed, which takes
some milliseconds. Meanwhile the folder has the file `MARKER`, which lists them: if the run is
killed just then, it stays, and says which results are older. The next run that writes to the folder
finishes the renaming, so that old and new results are never mixed unnoticed.
"""

from __future__ import annotations

import json
import os
import time
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from ...errors import DataError
from .temporary import create, forget, is_temporary, may_run, sweep, this_host

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    # A complete temporary file, and the result that it becomes.
    Pair = tuple[Path, Path]

__all__ = ["MARKER", "current_set", "finish_others", "result_set"]

MARKER = "piezotrack-incomplete.json"
NOTE = (
    "A run was putting these results in place and has not finished. Where the temporary file is "
    "still in this folder, its result is older than the others, or missing. The next run of "
    "piezotrack that writes to this folder finishes this."
)
# Longest wait for a run that is renaming its files at the moment [s].
PATIENCE = 5.0
# Only one thread sets markers and renames.
_one_at_a_time = Lock()
# Folders that this process has looked through.
_swept: set[str] = set()


class ResultSet:
    """Temporary files waiting for the end of `result_set`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files: dict[Path, Path] = {}

    def add(self, temporary: Path, file: Path) -> None:
        """Take over a complete temporary file."""
        if earlier := self._files.get(file):
            _remove(earlier)
        self._files[file] = temporary

    def put_in_place(self) -> None:
        """Rename all files, and finish what killed runs have left in the folder."""
        try:
            if self._files:
                _rename(self.folder, [(temporary, file) for file, temporary in self._files.items()])
            finish_others(self.folder)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise DataError(f"{self.folder} cannot be written to: {reason}") from None

    def remove(self) -> None:
        """Remove what has not been put in place."""
        # Those that a marker lists are for the next run.
        listed = {temporary.name for temporary, _ in _listed(self.folder)}
        for temporary in self._files.values():
            if temporary.name in listed:
                forget(temporary)
            else:
                _remove(temporary)


_current: ContextVar[ResultSet | None] = ContextVar("_current", default=None)


def current_set(folder: Path) -> ResultSet | None:
    """Return the set that a file in `folder` belongs to, if `result_set` is under way."""
    found = _current.get()
    return found if found is not None and found.folder == folder else None


@contextmanager
def result_set(folder: Path) -> Iterator[Path]:
    """Put all files that are written within in place at its end, or none if it fails.

    Within another `result_set` of the same folder, the files join that one's.

    Parameters
    ----------
    folder : pathlib.Path
        Where they are.

    Yields
    ------
    pathlib.Path
        The folder.

    Raises
    ------
    DataError
        A file cannot be replaced.
    """
    if current_set(folder) is not None:
        yield folder
        return
    results = ResultSet(folder)
    token = _current.set(results)
    try:
        yield folder
        results.put_in_place()
    finally:
        _current.reset(token)
        results.remove()


def finish_others(folder: Path) -> None:
    """Finish the renaming of a killed run, and remove the temporary files of killed runs.

    Parameters
    ----------
    folder : pathlib.Path
        Where results are about to be written.
    """
    if (folder / MARKER).exists():
        _rename(folder, [])
    if (name := os.path.abspath(folder)) not in _swept:
        _swept.add(name)
        sweep(folder, {temporary.name for temporary, _ in _listed(folder)})


def _rename(folder: Path, pairs: Sequence[Pair]) -> None:
    """Rename own files, and before them those of a run that was killed while it did so."""
    for _, file in pairs:
        if file.is_dir():
            raise DataError(f"{file} cannot be written: it is a folder")
    marker = folder / MARKER
    interruption: BaseException | None = None
    with _one_at_a_time:
        was_there = marker.exists()
        try:
            others = _take(marker, pairs)
        except BaseException:
            # Nothing has been put in place, and what was to be is removed. A signal may come as
            # the marker is opened, before there is anything in it.
            ours = _is_ours(marker) and {f for _, f in _listed(folder)} <= {f for _, f in pairs}
            if ours or (not was_there and _is_empty(marker)):
                marker.unlink(missing_ok=True)
            raise
        try:
            failed = _move(others, pairs)
        except BaseException as error:
            # It waits for the few that are left.
            interruption, failed = error, _move(others, pairs)
        if failed:
            # Without room for a shorter list, the longer one stays.
            with suppress(OSError):
                _write(marker, [pair for pair in (*others, *pairs) if pair[1] in failed])
        else:
            marker.unlink(missing_ok=True)
    if interruption is not None:
        raise interruption
    for _, file in pairs:
        if file in failed:
            reason = (failed[file].strerror or str(failed[file])).lower()
            raise DataError(f"{file} cannot be written: {reason}; {MARKER} lists what is older")


def _take(marker: Path, pairs: Sequence[Pair]) -> list[Pair]:
    """Set the marker, and return the files that a killed run has not renamed."""
    start = time.monotonic()
    while True:
        try:
            _write(marker, pairs, exclusive=True)
        except FileExistsError:
            # The run that set it is renaming now, or was killed.
            if _owner_is_gone(marker) or time.monotonic() - start > PATIENCE:
                break
            time.sleep(0.01)
        else:
            return []
    listed = _listed(marker.parent)
    replaced = {file for _, file in pairs}
    others = [pair for pair in listed if pair[1] not in replaced]
    _write(marker, [*others, *pairs])
    for temporary, file in listed:
        if file in replaced:
            _remove(temporary)
    return others


def _move(others: Sequence[Pair], pairs: Sequence[Pair]) -> dict[Path, OSError]:
    """Rename files, except those that have been; return those that cannot be, with the reason."""
    for temporary, file in others:
        # Somebody may have put another file there since.
        with suppress(OSError):
            if file.stat().st_mtime_ns > temporary.stat().st_mtime_ns:
                temporary.unlink()
    failed = {}
    for temporary, file in (*others, *pairs):
        try:
            if temporary.exists():
                temporary.replace(file)
        except OSError as error:
            failed[file] = error
        else:
            forget(temporary)
    return failed


def _write(marker: Path, pairs: Sequence[Pair], *, exclusive: bool = False) -> None:
    """Write the marker, in place of one that is there unless it is to be the only one."""
    files = [{"result": file.name, "temporary": temporary.name} for temporary, file in pairs]
    document = {"note": NOTE, "host": this_host(), "process": os.getpid(), "files": files}
    text = json.dumps(document, indent=2) + "\n"
    if not exclusive:
        temporary = create(marker.parent, ".json")
        try:
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(marker)
        finally:
            _remove(temporary)
        return
    with marker.open("x", encoding="utf-8") as file:
        try:
            # In one piece: what is read meanwhile is whole, or no JSON.
            file.write(text)
            file.flush()
        except BaseException:
            marker.unlink(missing_ok=True)
            raise


def _read(marker: Path) -> dict[str, object]:
    """Read the marker; one that is missing or incomplete is empty."""
    try:
        content = json.loads(marker.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _is_a_name(text: str) -> bool:
    """Whether a text is the name of a file in its folder."""
    try:
        os.fsencode(text)
    except UnicodeEncodeError:
        return False
    return text == Path(text).name and text != ".." and "\0" not in text


def _listed(folder: Path) -> list[Pair]:
    """Return the pairs of the marker of a folder; names that lead elsewhere are left out."""
    files = _read(folder / MARKER).get("files")
    pairs = []
    for entry in files if isinstance(files, list) else []:
        found = entry if isinstance(entry, dict) else {}
        temporary, result = str(found.get("temporary")), str(found.get("result"))
        if _is_a_name(result) and is_temporary(temporary):
            pairs.append((folder / temporary, folder / result))
    return pairs


def _is_ours(marker: Path) -> bool:
    """Whether this process has set a marker."""
    found = _read(marker)
    return (found.get("host"), found.get("process")) == (this_host(), os.getpid())


def _is_empty(marker: Path) -> bool:
    """Whether a marker has been opened and not written."""
    try:
        return marker.stat().st_size == 0
    except OSError:
        return False


def _owner_is_gone(marker: Path) -> bool:
    """Return whether the run that set a marker has ended."""
    found = _read(marker)
    host, process = found.get("host"), found.get("process")
    if isinstance(host, str) and isinstance(process, int):
        # Threads wait for one another, so one of this process is from an earlier failure.
        ours = (host, process) == (this_host(), os.getpid())
        if ours or may_run(host, process) is False:
            return True
    try:
        return time.time() - marker.stat().st_mtime > PATIENCE
    except OSError:
        return False


def _remove(temporary: Path) -> None:
    with suppress(OSError):
        temporary.unlink(missing_ok=True)
    forget(temporary)
