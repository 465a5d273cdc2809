"""Desk of a window: its state, its files, and what has been computed of them."""

from __future__ import annotations

import json
import shutil
import tempfile
import threading
from collections import OrderedDict
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

from ..errors import DataError, PiezotrackError
from .parts import Plotter
from .state import State

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from .parts import Box, Light, Part

__all__ = ["Desk", "Download", "Job", "Purpose", "Step"]

# Results that are kept, the last used ones.
KEPT = 64
# What a file may be for.
Purpose = Literal["log", "test", "motion"]


class Step(Protocol):
    """One step of the page."""

    title: str

    def light(self, desk: Desk) -> tuple[Light, str]:
        """Return how far the step is, and that in a sentence."""

    def page(self, desk: Desk) -> list[Part]:
        """Return what is shown."""

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
        finally:
            self.done = True
            self.changed()


class Desk:
    """State, files and results of a window.

    Parameters
    ----------
    changed : callable
        Shows the page again, from any thread.
    device : str, optional
        Address of the device that was named on the command line.

    Attributes
    ----------
    state : State
        What the person has set.
    plotter : Plotter
        Thins lines to the pixels of the window.
    job : Job or None
        What is computed in the background.
    """

    def __init__(self, changed: Callable[[], None], device: str | None = None) -> None:
        self.state = State()
        self.plotter = Plotter(800, {})
        self.device = device
        # The drive to record next, with the log that it is for.
        self.suggested: Any = None
        self.job: Job | None = None
        self._changed = changed
        self._folder = Path(tempfile.mkdtemp(prefix="piezotrack-"))
        self._files: dict[Purpose, Path] = {}
        self._results: OrderedDict[str, Any] = OrderedDict()
        self._lock = threading.Lock()

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
        (place / plain).write_bytes(content)
        self._files[purpose] = place / plain
        return plain

    def forget(self, purpose: Purpose) -> None:
        """Remove a file."""
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
        if found is None or found.name != name:
            raise DataError(f"{name} is not open: drop it here again")
        return found

    def place(self, name: str) -> Path:
        """Return an empty folder for files that are to be taken away."""
        place = self._folder / name
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        return place

    def result(self, name: str, settings: Any, compute: Callable[[], Any]) -> Any:
        """Return a result, computed once for the same settings.

        Parameters
        ----------
        name : str
            Which result.
        settings : object
            What it depends on: dataclasses, numbers and texts.
        compute : callable
            Computes it.

        Returns
        -------
        object
            As `compute` returns it.
        """
        key = name + json.dumps(settings, default=asdict, sort_keys=True)
        with self._lock:
            if key in self._results:
                self._results.move_to_end(key)
                return self._results[key]
        found = compute()
        with self._lock:
            self._results[key] = found
            while len(self._results) > KEPT:
                self._results.popitem(last=False)
        return found

    def start(self, name: str, work: Callable[[Job], None]) -> None:
        """Begin a long computation, in place of the one that runs."""
        self.stop()
        self.job = job = Job(name, self._changed)
        threading.Thread(target=job.run, args=(work,), daemon=True, name=name).start()

    def stop(self) -> None:
        """End what is computed in the background, at its next iteration."""
        if self.job is not None:
            self.job.stop.set()

    def running(self, name: str) -> bool:
        """Whether a computation runs."""
        return self.job is not None and self.job.name == name and not self.job.done
