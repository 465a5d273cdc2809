"""Judge of the fuzzers: makes a call, and notes what no call may do.

A call may return, or raise one of piezotrack's own errors in a short sentence. Anything else is a
failure: another exception, a warning, NaN or infinity in a result, another result when repeated.
What takes long, as a search or a drive of a gigavolt does, has to stop when asked to, as by Ctrl-C.
The statements that led to a failure are kept as a script that `tests/soak/test_finds.py` replays.
"""

from __future__ import annotations

import dataclasses
import faulthandler
import math
import re
import signal
import time
import traceback
import unicodedata
import warnings
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

# The folders above it may have its name too, as a checkout often has.
PACKAGE = Path(pt.__file__).parent
LONGEST_MESSAGE = 500
# Of one call: CPU time [s] after which it is asked to stop, and by which it has to have done so,
# which other work on the machine does not change; time by the clock [s] after which it is asked as
# well, as one that waits takes no CPU, and after which the process ends with a traceback.
LONG, SLOW = 2.0, 12.0
WAITING, HANG = 10.0, 240.0
# Every so many successful calls are made twice.
REPEAT_EVERY = 8
KEPT = 3


Row = tuple[str, int, int, int, int, int]


class Tally:
    """Tries and failures of one target."""

    def __init__(self, target: str) -> None:
        self.target = target
        self.tries = self.accepted = self.refused = self.stopped = 0
        self.failures: Counter[str] = Counter()
        self.finds: list[str] = []

    def fail(self, kind: str, find: str) -> None:
        self.failures[kind] += 1
        if self.failures[kind] <= KEPT:
            self.finds.append(f"# {kind}\n{find}")

    def row(self) -> Row:
        failed = sum(self.failures.values())
        return self.target, self.tries, self.accepted, self.refused, self.stopped, failed

    def verdict(self) -> None:
        """Fail the test where there is a failure, with the kinds and a find of each."""
        assert not self.failures, "\n".join(
            [f"{count} x {kind}" for kind, count in self.failures.most_common()] + ["", *self.finds]
        )


class Script:
    """Calls one after the other on the objects that they make, each of them judged."""

    # Where each script is written before its last call is made, to find what ended a process.
    trace: Path | None = None

    def __init__(self, tally: Tally) -> None:
        self.tally = tally
        self.lines: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = []
        self.made: list[Any] = []
        # Whether the last call was.
        self.refused = False

    def new(self, path: str, /, *args: Any, **keywords: Any) -> Any:
        """Call a public name, as `"pt.sine"`; return None where it refuses."""
        function: Any = pt
        for name in path.split(".")[1:]:
            function = getattr(function, name)
        return self._verdict_of(path, function, args, keywords)

    def on(
        self, owner: Any, name: str, /, *args: Any, finite: bool = True, again: bool = True,
        **keywords: Any,
    ) -> Any:  # fmt: skip
        """Call a method or read a property; return None where it refuses."""
        path = f"{self._name(owner)}.{name}"
        found = getattr(type(owner), name, None)
        if isinstance(found, property) or not callable(found):
            return self._verdict_of(path, lambda: getattr(owner, name), (), {}, read=True)
        bound = getattr(owner, name)
        return self._verdict_of(path, bound, args, keywords, finite=finite, again=again)

    def judge(self, holds: bool, kind: str, statement: str) -> None:
        """Note where a statement about the last result, {}, does not hold."""
        if not holds:
            name = f"v{len(self.made) - 1}"
            self.tally.fail(kind, f"{self.text()}\nassert {statement.format(name)}")

    def _verdict_of(
        self, path: str, function: Callable[..., Any], args: tuple[Any, ...],
        keywords: dict[str, Any], *, read: bool = False, finite: bool = True, again: bool = True,
    ) -> Any:  # fmt: skip
        tally = self.tally
        tally.tries += 1
        self.lines.append((path if read else f"{path}(", args, keywords))
        self.made.append(None)
        if Script.trace is not None:
            name = re.sub(r"\W+", "_", tally.target)
            (Script.trace / f"{name}.txt").write_text(self.text(), "utf-8", "backslashreplace")
        faults, value = verdict_of(lambda: function(*args, **keywords))
        self.refused = value is REFUSED or value is STOPPED
        if self.refused:
            tally.refused += value is REFUSED
            tally.stopped += value is STOPPED
            value = None
        else:
            tally.accepted += 1
            # What is only held, as the parameters of a stage, may be infinite where that is said.
            if finite and not path.startswith("pt."):
                faults += [f"not finite: {where}" for where in not_finite(value)][:1]
            if again and not faults and tally.accepted % REPEAT_EVERY == 0:
                faults += repeated(lambda: function(*args, **keywords), value)
        for fault in faults:
            name = path if path.startswith("pt.") else "." + path.rpartition(".")[2]
            tally.fail(f"{name}: {fault}", self.text())
        self.made[-1] = value
        return value

    def _name(self, value: Any) -> str:
        for k, made in enumerate(self.made):
            if value is made and value is not None:
                return f"v{k}"
        return literal(value)

    def text(self) -> str:
        """The calls as a script of Python; v0, v1 and so on are their results."""
        return "\n".join(f"v{k} = {self._statement(*line)}" for k, line in enumerate(self.lines))

    def _statement(self, path: str, args: tuple[Any, ...], keywords: dict[str, Any]) -> str:
        if not path.endswith("("):
            return path
        shown = [self._shown(v) for v in args]
        shown += [f"{name}={self._shown(v)}" for name, v in keywords.items()]
        return f"{path}{', '.join(shown)})"

    def _shown(self, value: Any) -> str:
        if isinstance(value, (list, tuple)) and any(dataclasses.is_dataclass(v) for v in value):
            inner = ", ".join(self._shown(v) for v in value)
            return f"[{inner}]" if isinstance(value, list) else f"({inner},)"
        return self._name(value) if not isinstance(value, (float, int, str)) else literal(value)


REFUSED, STOPPED = object(), object()
# Signals and timers of CPU time and of the clock; none on Windows.
ALARMS = (
    [
        (signal.SIGPROF, signal.ITIMER_PROF, 1.0),
        (signal.SIGALRM, signal.ITIMER_REAL, WAITING / LONG),
    ]
    if hasattr(signal, "setitimer")
    else []
)


class TimeUpError(KeyboardInterrupt):
    """Raised in a call that takes long, where Ctrl-C would be."""


class Alarm:
    """Interrupts a call after a while, as Ctrl-C would."""

    rung = False

    @classmethod
    def ring(cls, *_: object) -> None:
        # Both may ring where a call did not look up in between.
        if not cls.rung:
            cls.rung = True
            raise TimeUpError

    @classmethod
    def set(cls, after: float) -> None:
        cls.rung = False
        faulthandler.dump_traceback_later(HANG, exit=True)
        for number, timer, ratio in ALARMS:
            signal.signal(number, cls.ring)
            signal.setitimer(timer, ratio * after)

    @staticmethod
    def off() -> None:
        for _, timer, _ in ALARMS:
            signal.setitimer(timer, 0.0)
        faulthandler.cancel_dump_traceback_later()


def verdict_of(call: Callable[[], Any], *, after: float = LONG) -> tuple[list[str], Any]:
    """What a call did that it may not, and its result, `REFUSED` or `STOPPED`."""
    try:
        Alarm.set(after)
        return _verdict_of(call)
    except TimeUpError:
        # It rang when the call was over.
        return [], STOPPED
    finally:
        Alarm.off()


def _verdict_of(call: Callable[[], Any]) -> tuple[list[str], Any]:
    faults: list[str] = []
    value: Any = REFUSED
    began = time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            value = call()
        except (pt.PiezotrackError, MemoryError) as error:
            # MemoryError: a size within the documented limits and beyond those of the machine.
            faults += bad_message(str(error))
            if getattr(error, "argument", "") is None:
                faults.append(f"no argument {origin(error)}: {str(error)[:80]}")
        except KeyboardInterrupt:
            if not Alarm.rung:
                raise
            value = STOPPED
        except Exception as error:
            faults.append(f"{type(error).__name__} {origin(error)}: {str(error)[:80]}")
        except BaseException as error:
            if isinstance(error, SystemExit):
                raise
            # PanicException of the Rust module.
            faults.append(f"{type(error).__name__}: {str(error)[:80]}")
    faults += [f"{w.category.__name__}: {str(w.message)[:80]}" for w in caught[:2]]
    if Alarm.rung and time.process_time() - began > SLOW:
        faults.append(f"not stopped within {SLOW:g} s")
    return faults, value


def repeated(call: Callable[[], Any], value: Any) -> list[str]:
    """Whether the same call gives another result."""
    faults, second = verdict_of(call)
    if faults or second is STOPPED:
        return faults
    return [] if same(value, second) else ["differs when repeated"]


def bad_message(text: str) -> list[str]:
    """What a message of an error may not be: long, raw, or an admission."""
    faults = []
    if len(text) > LONGEST_MESSAGE:
        faults.append("message too long")
    if any(unicodedata.category(c) in ("Cc", "Cs") for c in text):
        faults.append("raw control character in a message")
    if "please report" in text:
        faults.append("panic")
    return faults


def origin(error: BaseException) -> str:
    """The function of the package in which an exception came up."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if Path(f.filename).is_relative_to(PACKAGE)]
    return f"in {Path(ours[-1].filename).name}:{ours[-1].name}" if ours else "outside"


def not_finite(value: Any, path: str = "", depth: int = 0) -> Iterator[str]:
    """Places in a result that are NaN or infinite."""
    if depth > 4:
        return
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "fc" and not np.isfinite(value).all():
            yield path or "array"
    elif isinstance(value, (float, np.floating)):
        if not math.isfinite(value):
            yield path or "number"
    elif isinstance(value, (list, tuple)):
        fields = getattr(value, "_fields", range(len(value)))
        for name, entry in zip(fields, value, strict=True):
            yield from not_finite(entry, f"{path}.{name}", depth + 1)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            if field.name not in HELD:
                yield from not_finite(getattr(value, field.name), f"{path}.{field.name}", depth + 1)


# Fields of a result that are what was given.
HELD = {"controller", "reference", "path", "stage", "plant", "motion", "swarm", "least_squares"}


def same(a: Any, b: Any, depth: int = 0) -> bool:
    """Whether two results are equal to the last bit."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return bool(a.shape == b.shape and a.tobytes() == b.tobytes())
    if isinstance(a, float):
        return a == b or (math.isnan(a) and math.isnan(b))
    if depth < 5 and isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(same(x, y, depth + 1) for x, y in zip(a, b, strict=True))
    if depth < 5 and dataclasses.is_dataclass(a):
        return all(
            same(getattr(a, field.name), getattr(b, field.name), depth + 1)
            for field in dataclasses.fields(a)
            if field.name not in HELD
        )
    return not isinstance(a, (str, int)) or a == b


# Names in the scripts.
NAMES = {"nan": math.nan, "inf": math.inf, "np": np, "pt": pt}


def literal(value: Any) -> str:
    """A value as Python writes it, with the names above."""
    if isinstance(value, np.generic):
        return f"np.{type(value).__name__}({value.item()!r})"
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
        return repr(value)
    if isinstance(value, np.ma.MaskedArray):
        return (
            f"np.ma.masked_array({value.data.tolist()!r}, {np.ma.getmaskarray(value).tolist()!r})"
        )
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "fiubc" and value.flags.c_contiguous and value.dtype != np.float64:
            return f"np.array({value.tolist()!r}, dtype={value.dtype.str!r})"
        return f"np.array({value.tolist()!r})"
    if isinstance(value, (list, tuple)):
        inner = ", ".join(literal(v) for v in value)
        return f"[{inner}]" if isinstance(value, list) else f"({inner}{',' * (len(value) == 1)})"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{literal(k)}: {literal(v)}" for k, v in value.items()) + "}"
    if value is object:
        return "object"
    if dataclasses.is_dataclass(value):
        given = (
            f"{f.name}={literal(getattr(value, f.name))}"
            for f in dataclasses.fields(value)
            if f.init
        )
        return f"{home(type(value).__name__)}({', '.join(given)})"
    return repr(value)


def home(name: str) -> str:
    """Where a class is public."""
    for room in ("", "control.", "stages.", "references.", "identification.", "data."):
        owner = getattr(pt, room[:-1]) if room else pt
        if name in owner.__all__:
            return f"pt.{room}{name}"
    return name


def table(rows: list[Row]) -> str:
    """Tries and failures of each target, in Markdown."""
    total = ("all", *(sum(int(row[k]) for row in rows) for k in range(1, 6)))
    lines = ["| target | tries | answered | refused | stopped | failures |", "| --- " * 6 + "|"]
    for name, *counts in [*sorted(rows), total]:
        shown = " | ".join(f"{n:,}".replace(",", " ") for n in counts)
        lines.append(f"| {name} | {shown} |")
    return "\n".join(lines) + "\n"
