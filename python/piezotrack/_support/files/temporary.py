"""Temporary files beside results, and those that a killed run has left behind."""

from __future__ import annotations

import os
import re
import time
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Container
    from pathlib import Path

__all__ = ["create", "forget", "is_temporary", "may_run", "sweep", "this_host"]

# Host, process and random digits; then the ending of the result.
NAME = re.compile(r"\.piezotrack-([0-9a-f]{8})-(\d{1,10})-[0-9a-f]{16}(\.[^/\\]*)?")
# Age from which a file whose process cannot be looked up counts as left behind [s].
OLD = 86_400.0
FLAGS = os.O_WRONLY | os.O_CREAT | os.O_EXCL
FLAGS |= getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0)

# Names of the files that this process is writing.
_ours: set[str] = set()


@cache
def this_host() -> str:
    """Return eight digits that stand for the name of this computer."""
    import platform
    from hashlib import sha256

    return sha256(platform.node().encode("utf-8", "replace")).hexdigest()[:8]


def create(folder: Path, ending: str) -> Path:
    """Create an empty file with a random name, readable as the umask of the process says.

    Parameters
    ----------
    folder : pathlib.Path
        Where to.
    ending : str
        With its dot; may be empty.

    Returns
    -------
    pathlib.Path
        The file. `forget` it when it has been renamed or removed.
    """
    import secrets

    name = f".piezotrack-{this_host()}-{os.getpid()}-{secrets.token_hex(8)}{ending}"
    _ours.add(name)
    try:
        # The kernel takes the mask off; asking for it would change it for the other threads.
        os.close(os.open(folder / name, FLAGS, 0o666))
    except BaseException:
        _ours.discard(name)
        raise
    return folder / name


def forget(path: Path) -> None:
    """Declare a file of `create` as no longer in use."""
    _ours.discard(path.name)


def is_temporary(name: str) -> bool:
    """Return whether a file has a name as `create` gives it."""
    return NAME.fullmatch(name) is not None


def may_run(host: str, process: int) -> bool | None:
    """Return whether another process runs; None where that cannot be known.

    Parameters
    ----------
    host : str
        As of `this_host`.
    process : int
        Its number, which may meanwhile be that of another program.

    Returns
    -------
    bool or None
        None on other computers, and on Windows, where asking would stop the process.
    """
    if host != this_host() or os.name == "nt":
        return None
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def sweep(folder: Path, keep: Container[str] = ()) -> None:
    """Remove the temporary files of runs that are gone; none of them is a reason to fail.

    Parameters
    ----------
    folder : pathlib.Path
        Where they are.
    keep : container of str, optional
        Names to keep.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            match = NAME.fullmatch(entry.name)
            if match is None or entry.name in keep or entry.name in _ours:
                continue
            with suppress(OSError):
                process = int(match[2])
                runs = process != os.getpid() and may_run(match[1], process) is not False
                age = time.time() - entry.stat(follow_symlinks=False).st_mtime
                if not runs or age > OLD:
                    os.unlink(entry.path)
