"""Device that was named on the command line, in a process of its own that always ends at rest."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import closing, suppress
from dataclasses import dataclass
from multiprocessing import get_context
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from ..errors import DeviceError, Interrupted, PiezotrackError
from ..hardware.addresses import connect

if TYPE_CHECKING:
    from collections.abc import Callable
    from multiprocessing.connection import Connection

    from ..hardware.device import Device

    Tell = Callable[[object], None]

__all__ = ["IN_USE", "DeviceProcess", "Facts"]

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
# Longest wait for a connection, and for the way to rest at the end [s]; time between two looks at
# what the process reports.
PATIENCE, LEAVE, PACE = 60.0, 5.0, 0.02
IN_USE = "the device is in use: wait until it is at rest, or press STOP"
ENDED = "the process that keeps the device has ended: start piezotrack app again"


class Work(Protocol[T_co]):
    """A function that does something with a device; it can be pickled, and may tell how it goes."""

    def __call__(self, device: Device, tell: Tell, /) -> T_co: ...


@dataclass(frozen=True)
class Facts:
    """Limits, rates and names of a device, as it says them.

    Attributes
    ----------
    address : str
        Its address.
    channels : tuple of str
        Names of output and input.
    limits : (float, float)
        Lowest and highest voltage [V].
    rates : (float, float)
        Lowest and highest sampling rate [Hz].
    """

    address: str
    channels: tuple[str, ...]
    limits: tuple[float, float]
    rates: tuple[float, float]


class DeviceProcess:
    """A connection to a device, kept by a process that can be interrupted at any moment.

    What plays there is ended as Ctrl-C ends a command: the output is led to rest. The same happens
    where this process ends or is killed.

    Parameters
    ----------
    address : str
        As of `piezotrack.hardware.connect`.

    Attributes
    ----------
    facts : Facts
        What the device says of itself.
    stroked : (float, float) or None
        Voltages over which it was moved slowly, before anything else; None before.

    Raises
    ------
    ParameterError
        The address cannot be parsed.
    DeviceError
        Nobody answers.
    """

    def __init__(self, address: str) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_attend, args=(address, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self._using, self._sending = threading.Lock(), threading.Lock()
        self.stroked: tuple[float, float] | None = None
        try:
            if not self._pipe.poll(PATIENCE):
                raise DeviceError(f"{address}: no connection within {PATIENCE:g} s")
            self.facts: Facts = self._answer()[1]
        except BaseException:
            self.close()
            raise

    @property
    def busy(self) -> bool:
        """Whether something is done with it."""
        return self._using.locked()

    def run(
        self,
        work: Work[T],
        tell: Tell = lambda _: None,
        ended: Callable[[], bool] = lambda: False,
    ) -> T:
        """Do something with the device, and wait for it.

        Parameters
        ----------
        work : callable
            Takes the device and a function that tells how it goes on; it can be pickled.
        tell : callable, optional
            Gets what `work` tells.
        ended : callable, optional
            Whether it is to be ended; looked at again and again.

        Returns
        -------
        object
            As `work` returns it.

        Raises
        ------
        DeviceError
            Another window uses the device, or its process has ended.
        Interrupted
            It was stopped; the output is at rest.
        PiezotrackError
            As of `work`.
        """
        if not self._using.acquire(blocking=False):
            raise DeviceError(IN_USE)
        try:
            self._send(("run", work))
            while True:
                while not self._pipe.poll(PACE):
                    if ended():
                        self.stop()
                kind, found = self._answer()
                if kind == "done":
                    result: T = found
                    return result
                tell(found)
        finally:
            self._using.release()

    def stop(self) -> None:
        """Interrupt what is done with the device; the output is led to rest."""
        if self.busy:
            self._send(("stop", None))

    def close(self) -> None:
        """Interrupt what is done, and give the connection back."""
        with suppress(DeviceError):
            self._send(("close", None))
        self._process.join(LEAVE)
        self._process.terminate()

    def _send(self, message: tuple[str, Any]) -> None:
        try:
            with self._sending:
                self._pipe.send(message)
        except OSError:
            raise DeviceError(ENDED) from None

    def _answer(self) -> tuple[str, Any]:
        try:
            kind, found = self._pipe.recv()
        except (OSError, EOFError):
            raise DeviceError(ENDED) from None
        if kind == "failed":
            raise found
        return kind, found


def _attend(address: str, pipe: Connection) -> None:
    """Connect to a device, and do what is sent until the pipe ends."""
    # Ctrl-C in a terminal is for the other process, which then ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        os.setsid()
    try:
        device = connect(address)
    except PiezotrackError as error:
        pipe.send(("failed", error))
        return
    with closing(device):
        low, high = device.rates.lowest, device.rates.highest
        pipe.send(("done", Facts(address, device.channels, device.limits, (low, high))))
        _Attendant(device, pipe).serve()


class _Attendant:
    """The work of the process: one order after the other, each of which can be interrupted."""

    def __init__(self, device: Device, pipe: Connection) -> None:
        self.device, self.pipe = device, pipe
        self.orders: SimpleQueue[Work[object] | None] = SimpleQueue()
        self.stopped, self.at_work = threading.Event(), False
        self.turn = threading.Lock()

    def serve(self) -> None:
        """Work until the other process closes the pipe, or ends."""
        threading.Thread(target=self._listen, daemon=True).start()
        while (work := self.orders.get()) is not None:
            self._report(self._outcome(work))

    def _listen(self) -> None:
        """Take orders, also during work."""
        kind, work = "", None
        while kind != "close":
            try:
                kind, work = self.pipe.recv()
            except (OSError, EOFError):
                kind, work = "close", None
            if kind == "run":
                self.stopped.clear()
            elif not self.stopped.is_set():
                # Once: what comes again would end the way to rest in one step.
                self.stopped.set()
                with self.turn:
                    if self.at_work:
                        _interrupt()
            if kind != "stop":
                self.orders.put(work)

    def _outcome(self, work: Work[object]) -> tuple[str, object]:
        """Do some work, and return what it gives or why it failed."""
        try:
            try:
                signal.signal(signal.SIGINT, signal.default_int_handler)
                self.at_work = True
                if self.stopped.is_set():
                    raise KeyboardInterrupt
                return "done", work(self.device, lambda found: self._report(("told", found)))
            finally:
                with self.turn:
                    self.at_work = False
                signal.signal(signal.SIGINT, signal.SIG_IGN)
        except Interrupted as error:
            return "failed", error
        except KeyboardInterrupt as error:
            return "failed", Interrupted(str(error) or "stopped; the output is at rest")
        except PiezotrackError as error:
            return "failed", error
        except Exception as error:
            return "failed", DeviceError(f"{type(error).__name__}: {error}")

    def _report(self, message: tuple[str, object]) -> None:
        """Report to the other process; where that has ended, the end of the pipe ends this one."""
        with suppress(OSError):
            self.pipe.send(message)


def _interrupt() -> None:
    """Raise KeyboardInterrupt in the main thread, also where it waits for a device."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)
