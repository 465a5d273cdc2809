"""Desk of a window: its state, its files, and what has been computed of them."""

from __future__ import annotations

import json
import shutil
import tempfile
import threading
from collections import OrderedDict
from copy import copy
from dataclasses import asdict, dataclass, field
from pathlib import Path
from traceback import print_exception
from typing import TYPE_CHECKING, Any, Literal, Protocol

from ..errors import DataError, PiezotrackError
from .parts import Plotter, message, messages
from .state import State

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from ..control.controller.controller import Controller
    from ..data.checks.record_flags import RecordFlag
    from .device import DeviceProcess
    from .parts import Light, Part

__all__ = ["Desk", "Download", "Job", "Purpose", "Same", "Step", "drawing", "own_fault"]

# Pictures are drawn by one window at a time.
drawing = threading.Lock()
# Results that are kept, the last used ones, and those that took long.
KEPT, LASTING = 64, 100
# What a file may be for.
Purpose = Literal["log", "test", "motion"]


class Step(Protocol):
    """One step of the page."""

    title: str

    def light(self, desk: Desk) -> tuple[Light, str]:
        """Return how far the step is, and that in a sentence."""

    def page(self, desk: Desk) -> Iterable[Part]:
        """Return what is shown; what comes before an error is shown with it."""

    def python(self, desk: Desk) -> list[str]:
        """Return the lines of Python that do the same; empty as long as there is nothing."""

    def commands(self, desk: Desk) -> list[str]:
        """Return the commands that do the same."""

    @property
    def actions(self) -> Mapping[str, Callable[[Desk, Mapping[str, Any]], Download | None]]:
        """Functions of the buttons by name."""


@dataclass(frozen=True)
class Download:
    """A file for the person, written by the browser."""

    name: str
    content: bytes


@dataclass
class Job:
    """A long computation in the background.

    Attributes
    ----------
    name : str
        What it computes.
    changed : callable
        Shows the page again.
    stop : threading.Event
        Set where it is to end.
    done : bool
        Whether it has ended.
    error : str
        Why it failed; empty where it did not.
    """

    name: str
    changed: Callable[[], None]
    stop: threading.Event = field(default_factory=threading.Event)
    done: bool = False
    error: str = ""

    def run(self, work: Callable[[Job], None]) -> None:
        """Do the work; an error is shown in the page."""
        try:
            work(self)
        except PiezotrackError as error:
            self.error = str(error)
        except Exception as error:
            self.error = own_fault(error)
        finally:
            self.done = True
            self.changed()


def own_fault(problem: Exception) -> str:
    """Describe an error that is none of the person's; the terminal has where it arose."""
    print_exception(problem)
    return f"an error in piezotrack itself, {type(problem).__name__}: {problem}"


@dataclass(frozen=True)
class Same:
    """An object that a result depends on, by its identity."""

    value: object


class Desk:
    """State, files and results of a window.

    Parameters
    ----------
    changed : callable
        Shows the page again, from any thread, or does an action of it.
    device : DeviceProcess, optional
        The device that was named on the command line.

    Attributes
    ----------
    state : State
        What the person has set.
    plotter : Plotter
        Thins lines to the pixels of the window.
    jobs : dict of str to Job
        What is or was computed in the background, by name.
    suggested : tuple or None
        The drive to record next, with the log that it is for.
    last_tuned, accepted : Controller or None
        The controller of the last search, and the one that the person accepted.
    tuned_for : object
        Settings that the last search was for.
    live : bool
        Whether a control is dragged.
    flags : list of RecordFlag or None
        What is unusual in the record, as it was last looked at.
    on_device : dict of str to object
        What was recorded, played and learnt on the device, by name.
    """

    def __init__(self, changed: Callable[[str], None], device: DeviceProcess | None = None) -> None:
        self.state = State()
        self.plotter = Plotter(800, {})
        self.suggested: Any = None
        self.last_tuned: Controller | None = None
        self.accepted: Controller | None = None
        self.tuned_for: object = None
        self.jobs: dict[str, Job] = {}
        self.on_device: dict[str, Any] = {}
        self.device = device
        self.live = False
        self.flags: list[RecordFlag] | None = None
        self._changed = changed
        self._folder = Path(tempfile.mkdtemp(prefix="piezotrack-"))
        self._files: dict[Purpose, Path] = {}
        self._results: OrderedDict[str, tuple[Any, list[object]]] = OrderedDict()
        self._lasting: OrderedDict[str, tuple[Any, list[object]]] = OrderedDict()
        self._once: dict[str, tuple[State, int, Any]] = {}
        self._opened = [0]
        self._lock = threading.Lock()

    def changed(self, do: str = "refresh") -> None:
        """Show the page again soon, or do an action of it; from any thread."""
        self._changed(do)

    def at(self, state: State) -> Desk:
        """Return the desk as it is, but for its state: for a computation in the background."""
        same = copy(self)
        same.state = state
        return same

    def close(self) -> None:
        """Stop what runs, and remove the files."""
        self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    def keep(self, purpose: Purpose, name: str, content: bytes) -> str:
        """Keep the content of a file under its own name.

        Parameters
        ----------
        purpose : {"log", "test", "motion"}
            What it is for.
        name : str
            Name in the browser; folders in it are left aside.
        content : bytes
            The content.

        Returns
        -------
        str
            The name that it has.
        """
        plain = "".join(c if c.isalnum() or c in " ._-()+" else "_" for c in name)[-100:]
        plain = plain.lstrip(". ") or "log.csv"
        place = self._folder / purpose
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        self._opened[0] += 1
        (place / plain).write_bytes(content)
        self._files[purpose] = place / plain
        return plain

    def forget(self, purpose: Purpose) -> None:
        """Remove a file."""
        self._opened[0] += 1
        shutil.rmtree(self._folder / purpose, ignore_errors=True)
        self._files.pop(purpose, None)

    def file(self, purpose: Purpose, name: str) -> Path:
        """Return the file of that name.

        Raises
        ------
        DataError
            It is not there: the state was made with it, and it has to be opened again.
        """
        found = self._files.get(purpose)
        if not name:
            raise DataError("there is no file yet: drop one here")
        if found is None or found.name != name:
            raise DataError(f"{name} is not open: drop it here again")
        return found

    def is_open(self, purpose: Purpose) -> bool:
        """Whether a file was opened for a purpose."""
        return purpose in self._files

    def place(self, name: str) -> Path:
        """Return an empty folder for files that are to be taken away."""
        place = self._folder / name
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        return place

    def once(self, name: str, compute: Callable[[], Any]) -> Any:
        """Return what follows from state and files alone, without a look at them while they stay.

        Parameters
        ----------
        name : str
            Which result.
        compute : callable
            Computes it.

        Returns
        -------
        object
            As `compute` returns it.
        """
        opened = self._opened[0]
        known = self._once.get(name)
        if known is None or known[0] is not self.state or known[1] != opened:
            known = self.state, opened, compute()
            self._once[name] = known
        return known[2]

    def result(
        self, name: str, settings: Any, compute: Callable[[], Any], *, lasting: bool = False
    ) -> Any:
        """Return a result, computed once for the same settings.

        Parameters
        ----------
        name : str
            Which result.
        settings : object
            What it depends on: dataclasses, numbers, texts, and objects as `Same`.
        compute : callable
            Computes it.
        lasting : bool, optional
            Whether it is kept beside the others, as what took long is.

        Returns
        -------
        object
            As `compute` returns it.
        """
        key, kept = _key(name, settings)
        results = self._lasting if lasting else self._results
        with self._lock:
            if key in results:
                results.move_to_end(key)
                return results[key][0]
        found = compute()
        with self._lock:
            results[key] = found, kept
            while len(results) > (LASTING if lasting else KEPT):
                results.popitem(last=False)
        return found

    def known(self, name: str, settings: Any) -> Any:
        """Return a result that was computed before; None where it was not."""
        key, _ = _key(name, settings)
        with self._lock:
            for results in (self._lasting, self._results):
                if key in results:
                    results.move_to_end(key)
                    return results[key][0]
        return None

    def start(self, name: str, work: Callable[[Job], None]) -> None:
        """Begin a long computation, in place of the last one of that name."""
        if name in self.jobs:
            self.jobs[name].stop.set()
        self.jobs[name] = job = Job(name, self.changed)
        threading.Thread(target=job.run, args=(work,), daemon=True, name=name).start()

    def stop(self) -> None:
        """End what is computed in the background, at its next iteration."""
        for job in self.jobs.values():
            job.stop.set()

    @property
    def running(self) -> list[str]:
        """Names of what is computed in the background."""
        return [name for name, job in self.jobs.items() if not (job.done or job.stop.is_set())]

    @property
    def stopping(self) -> list[str]:
        """Names of what was stopped and goes on to the end of its iteration."""
        return [name for name, job in self.jobs.items() if job.stop.is_set() and not job.done]

    def faults(self, name: str) -> list[Part]:
        """Return why a computation failed, as a part of the page; nothing where it did not."""
        job = self.jobs.get(name)
        if job is None or not job.error:
            return []
        return [messages(f"{name}-fault", message("red", job.error))]


def _key(name: str, settings: Any) -> tuple[str, list[object]]:
    """Return the key of a result, and the objects in it, which live as long as the result."""
    kept: list[object] = []

    def entry(value: Any) -> Any:
        if isinstance(value, Same):
            kept.append(value.value)
            return id(value.value)
        return _text_of(value)

    return name + json.dumps(settings, default=entry, sort_keys=True), kept


# Texts of the last states, by identity: states do not change, and are asked for all the time.
_texts: OrderedDict[int, tuple[object, str]] = OrderedDict()
_texts_lock = threading.Lock()


def _text_of(state: Any) -> str:
    """Write a part of a state as a text that is the same for the same settings."""
    with _texts_lock:
        if id(state) not in _texts:
            _texts[id(state)] = state, json.dumps(asdict(state), sort_keys=True)
            while len(_texts) > KEPT:
                _texts.popitem(last=False)
        return _texts[id(state)][1]
