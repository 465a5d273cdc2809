"""A virtual stage behind the converters of a firmware that runs here or in an emulator."""

from __future__ import annotations

import math
import struct
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ... import _core
from ..._support.arguments import expect
from ...errors import ParameterError
from ...stages.virtual import VirtualStage
from .listening import Listening

if TYPE_CHECKING:
    import socket

__all__ = ["Converters"]

# A sample to the board: a code and what is wrong with it; and the board's answer.
SAMPLE, ANSWER = struct.Struct("<IB"), struct.Struct("<I")
OVERRUN, INVALID = 1, 2
# Time from a reading to the voltage that answers it [s], and its largest share of the interval.
CONVERSION, SHARE = 1e-6, 0.01
# Numbers with which a board says how its codes are meant.
NUMBERS = 7


class Scale(NamedTuple):
    """How a board means its codes: interval [s], zeros [V, m] and steps, the safe voltage [V]."""

    dt: float
    dac_zero: float
    codes_per_volt: float
    adc_zero: float
    metres_per_code: float
    most: float
    safe: float


class Converters(Listening):
    """DAC, ADC and clock of a board, with a virtual stage between them.

    A firmware built for this computer connects to it, and the second serial port of an emulated
    board. It sends a sample in each interval, and takes the code of the voltage in answer. In real
    time an answer that comes late is an overrun of the board.

    Parameters
    ----------
    stage : VirtualStage
        The stage between its amplifier and its sensor; each board that connects has one of its own.
    host : str, optional
        Address to listen at; default this computer only.
    port : int, optional
        TCP port; default any that is free.
    speed : float, optional
        Speed relative to real time; infinite for as fast as the board answers.

    Raises
    ------
    ParameterError
        `speed` is not above 0, or it cannot listen there, which is seen when it begins to.

    Examples
    --------
    >>> import piezotrack as pt
    >>> with pt.hardware.Converters(pt.VirtualStage.xu_li_2010()) as converters:
    ...     host, port = converters.address
    >>> host
    '127.0.0.1'
    """

    def __init__(
        self,
        stage: VirtualStage,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        speed: float = math.inf,
    ) -> None:
        expect("stage", stage, VirtualStage, "pt.VirtualStage, as VirtualStage.of makes it")
        self._stage = stage
        super().__init__(host, port)
        self._speed = _core.as_number("speed", speed)
        if not self._speed > 0.0:
            raise ParameterError("speed", f"{self._speed:g} times real time", "above 0")
        # The last voltage that the stage got [V], and whether its sensor shows anything.
        self.voltage, self.reads = math.nan, True

    def _converse(self, link: socket.socket) -> None:
        scale = _scale_of(link)
        if scale is None:
            return
        run = _core.VirtualRun(self._stage._core)
        low, high = self._stage.amplifier.limits
        volts, late, begun, count = np.array([scale.safe]), False, time.perf_counter(), 0
        conversion = min(CONVERSION, SHARE * scale.dt)
        while True:
            _, y, _ = run.advance(volts, scale.dt - conversion)
            link.sendall(_sample(float(y[0]), scale, late=late, reads=self.reads))
            answer = _received(link, ANSWER.size)
            if answer is None:
                return
            code = ANSWER.unpack(answer)[0]
            volts[0] = min(max(scale.dac_zero + code / scale.codes_per_volt, low), high)
            run.advance(volts, conversion)
            self.voltage = float(volts[0])
            count += 1
            wait = begun + count * scale.dt / self._speed - time.perf_counter()
            late = wait < 0.0 and math.isfinite(self._speed)
            if wait > 0.0:
                time.sleep(wait)
            elif late:
                # What is lost is not made up for.
                begun, count = time.perf_counter(), 0


def _sample(y: float, scale: Scale, *, late: bool, reads: bool) -> bytes:
    code = (y - scale.adc_zero) / scale.metres_per_code
    valid = reads and math.isfinite(code)
    shown = round(min(max(code, 0.0), scale.most)) if valid else 0
    return SAMPLE.pack(shown, OVERRUN * late | INVALID * (not valid))


def _scale_of(link: socket.socket) -> Scale | None:
    """Read how a board means its codes; None where it goes before."""
    head = _received(link, 1)
    if head is None or head[0] not in (4, 8):
        return None
    form = f"<{NUMBERS}{'f' if head[0] == 4 else 'd'}"
    numbers = _received(link, struct.calcsize(form))
    return None if numbers is None else Scale(*struct.unpack(form, numbers))


def _received(link: socket.socket, count: int) -> bytes | None:
    """Receive so many bytes; None where the other end goes."""
    got = b""
    while len(got) < count:
        more = link.recv(count - len(got))
        if not more:
            return None
        got += more
    return got
