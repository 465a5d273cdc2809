"""Reading in a process of its own, with libraries that a damaged file can hang or end.

The process starts with the first file of such a format. It ends with this one, after a minute
without a file, and where a file takes too long; the next file starts another.
"""

from __future__ import annotations

import atexit
import faulthandler
import importlib
import importlib.util
import inspect
import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
import traceback
from contextlib import suppress
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import PiezotrackError
from .source import Source
from .table import Channel, ChannelTable, numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Request = Mapping[str, Any]

__all__ = ["read_apart", "serve"]

# Time for one request [s], and bytes a second that the slowest disk gives; and for a start.
PATIENCE, SLOWEST = 20.0, 5e6
# Time without a request after which the process ends, where pipes can be waited for, and after
# which it is not relied on [s]; and that it takes to end.
IDLE, RELIED_ON, ENDS = 60.0, 50.0, 5.0
# Address space beyond what the samples of a file may need [bytes]: libraries reserve some.
MARGIN = 1 << 30
BEGUN = b"reader\n"
START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from piezotrack.data.formats.apart import serve; serve()"
)


def read_apart(
    library: str, extra: str
) -> Callable[[Callable[[Source], ChannelTable]], Callable[[Source], ChannelTable]]:
    """Make a function that opens files work in the reader process.

    Parameters
    ----------
    library : str
        The library that it uses.
    extra : str
        The extra of piezotrack that installs it.

    Returns
    -------
    callable
        A decorator. Where Python cannot be started, as in a program that embeds it, files are
        opened in this process.
    """

    def decorate(opens: Callable[[Source], ChannelTable]) -> Callable[[Source], ChannelTable]:
        @wraps(opens)
        def apart(source: Source) -> ChannelTable:
            if importlib.util.find_spec(library) is None:
                source.library(library, extra)
            request: dict[str, Any] = {
                "library": library,
                "opens": [opens.__module__, opens.__qualname__],
                "path": str(source.path.absolute()),
                "skip": source.skip,
                "patience": PATIENCE + source.size / SLOWEST,
            }
            if (answer := _ask(source, request)) is None:
                return opens(source)
            head, _ = answer
            request |= {"table": head["table"], "version": head["version"]}
            channels = [
                Channel(read=partial(_read, source, {**request, "channel": k}), **told)
                for k, told in enumerate(head["channels"])
            ]
            table = ChannelTable(source, channels, dt=head["dt"])
            table.columns.notes[:] = head["notes"]
            return table

        return apart

    return decorate


def _read(source: Source, request: Request) -> Array:
    """Read the samples of a channel."""
    answer = _ask(source, request)
    if answer is None:
        raise source.error("cannot be read: there is no process to read it any more")
    head, values = answer
    return np.empty(0, head["dtype"]) if "dtype" in head else values.reshape(head["shape"])


class _Reader:
    """The reader process, as this process sees it."""

    def __init__(self) -> None:
        command = [sys.executable, "-P", "-c", START, json.dumps(sys.path)]
        self.owner, self.used = os.getpid(), time.monotonic()
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        if self._pipes()[1].readline() != BEGUN:
            self.end()
            raise OSError("the reader process does not start")

    def _pipes(self) -> tuple[Any, Any]:
        return self.process.stdin, self.process.stdout

    def is_fresh(self) -> bool:
        """Whether it is this process's, and will not end before the next request."""
        idle = time.monotonic() - self.used
        return self.owner == os.getpid() and idle < RELIED_ON and self.process.poll() is None

    def ask(self, request: Request) -> tuple[dict[str, Any], Array]:
        """Send a request, and wait for head and samples of the answer; EOFError where it ends."""
        requests, answers = self._pipes()
        try:
            requests.write(json.dumps(request).encode() + b"\n")
            requests.flush()
            head: dict[str, Any] = json.loads(answers.readline() or b"null")
        except OSError:
            raise EOFError from None
        if head is None:
            raise EOFError
        values = np.empty(head.get("count", 0))
        if answers.readinto(values.data.cast("B")) < values.nbytes:
            raise EOFError
        self.used = time.monotonic()
        return head, values

    def end(self, *, at_once: bool = False) -> None:
        """End the process, where it is this one's child."""
        for pipe in self._pipes():
            with suppress(OSError):
                pipe.close()
        if self.owner != os.getpid():
            # Waited for by the process that started it.
            self.process.returncode = 0
            return
        if not at_once:
            # It ends by itself where there are no more requests.
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(ENDS)
        self.process.kill()
        self.process.wait()


_LOCK = threading.Lock()
_reader: _Reader | None = None
_starts = True


def _ask(source: Source, request: Request) -> tuple[dict[str, Any], Array] | None:
    """Ask the reader process, and raise what it refused; return None where there is none."""
    global _reader, _starts
    with _LOCK:
        if _reader is None or not _reader.is_fresh():
            _end()
            if not _starts or not Path(sys.executable or "").stem.lower().startswith("python"):
                return None
            try:
                _reader = _Reader()
            except OSError:
                _starts = False
                return None
        begun = time.monotonic()
        try:
            head, values = _reader.ask(request)
        except EOFError:
            _end()
            if time.monotonic() - begun < request["patience"]:
                raise source.error(
                    "is damaged: it ended the process that read it, expected a sound file"
                ) from None
            raise source.error(
                f"is not read within {request['patience']:.0f} s: expected a sound file"
            ) from None
        except BaseException:
            _end(at_once=True)
            raise
    if "refused" in head:
        raise source.error(head["refused"].removeprefix(f"{source.name}: "))
    if "fault" in head:
        raise RuntimeError(head["fault"])
    return head, values


def _end(*, at_once: bool = False) -> None:
    global _reader
    if _reader is not None:
        _reader.end(at_once=at_once)
        _reader = None


atexit.register(_end)


def serve() -> None:
    """Answer requests from the standard input until it ends: what the reader process does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "r+b") as nothing:
        # Libraries print.
        for stream in (0, 1):
            os.dup2(nothing.fileno(), stream)
        tables: dict[int, ChannelTable] = {}
        answers.write(BEGUN)
        answers.flush()
        while os.name != "posix" or select.select([requests], [], [], IDLE)[0]:
            line = requests.readline()
            if not line:
                break
            request = json.loads(line)
            # It ends the process from a thread of its own, also where a library has hung it.
            faulthandler.dump_traceback_later(request["patience"], exit=True, file=nothing)
            head, samples = _answer(request, tables)
            faulthandler.cancel_dump_traceback_later()
            answers.write(json.dumps(head).encode() + b"\n")
            answers.write(samples)
            answers.flush()


def _answer(request: Request, tables: dict[int, ChannelTable]) -> tuple[dict[str, Any], bytes]:
    """Answer a request; `tables` has the file that was opened last."""
    try:
        source = Source(request["path"], request["skip"])
        importlib.import_module(request["library"])
        _limit_memory(MARGIN + 4 * source.most)
        # Opened again where another file was opened since.
        if (number := request.get("table", time.monotonic_ns())) not in tables:
            stat = source.path.stat()
            version = [stat.st_mtime_ns, stat.st_size]
            if request.get("version", version) != version:
                raise source.error("has changed while it was read: expected the same file")
            tables.clear()
            module, name = request["opens"]
            opens = getattr(importlib.import_module(module), name)
            tables[number] = inspect.unwrap(opens)(source)
        table = tables[number]
        if "channel" not in request:
            names = ("name", "count", "group", "unit", "dt")
            return {
                "table": number,
                "version": version,
                "channels": [
                    {name: getattr(one, name) for name in names} for one in table.channels
                ],
                "dt": table.dt,
                "notes": list(table.columns.notes),
            }, b""
        raw = table.channels[request["channel"]].read()
        values = numbers(raw)
        if values is None:
            return {"dtype": np.asarray(raw).dtype.str}, b""
        return {"shape": values.shape, "count": values.size}, values.tobytes()
    except PiezotrackError as error:
        return {"refused": str(error)}, b""
    except MemoryError:
        return {"refused": "asks for more memory than its samples need: expected a sound file"}, b""
    except Exception:
        return {"fault": traceback.format_exc()}, b""


def _limit_memory(size: int) -> None:
    """Limit the memory that is still to be taken, where the system can [bytes]."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        limit = pages * resource.getpagesize() + size
        if most != resource.RLIM_INFINITY:
            limit = min(limit, most)
        resource.setrlimit(resource.RLIMIT_AS, (limit, most))
