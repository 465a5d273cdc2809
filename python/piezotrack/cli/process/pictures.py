"""Settings of matplotlib for a command: no window, and a folder for its cache."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from tempfile import gettempdir, mkdtemp

__all__ = ["prepare_pictures"]


def prepare_pictures() -> None:
    """Let matplotlib draw to files only, with its cache where it can be written.

    Where the home folder cannot be written to, each command would print two lines on the cache and
    build it anew.
    """
    os.environ["MPLBACKEND"] = "Agg"
    if os.environ.get("MPLCONFIGDIR") or all(map(_writable, _places())):
        return
    # Of this user alone; another's in its place is not taken.
    folder = os.path.join(gettempdir(), f"piezotrack-{getattr(os, 'getuid', int)()}")
    with suppress(OSError):
        os.mkdir(folder, 0o700)
    status = os.lstat(folder) if os.path.isdir(folder) and not os.path.islink(folder) else None
    own = status is not None and status.st_uid == getattr(os, "getuid", int)()
    os.environ["MPLCONFIGDIR"] = folder if own and _writable(folder) else mkdtemp()


def _places() -> list[str]:
    """Return the folders of settings and cache that matplotlib takes."""
    if not sys.platform.startswith(("linux", "freebsd")):
        return [os.path.expanduser("~/.matplotlib")]
    bases = (("XDG_CONFIG_HOME", "~/.config"), ("XDG_CACHE_HOME", "~/.cache"))
    return [
        os.path.join(os.environ.get(name) or os.path.expanduser(usual), "matplotlib")
        for name, usual in bases
    ]


def _writable(folder: str) -> bool:
    """Whether a folder is there, or can be made, and be written to."""
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)
