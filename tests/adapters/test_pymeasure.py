"""The virtual instrument by other people's software: PyMeasure over PyVISA-py."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pymeasure.instruments import Instrument, SCPIMixin

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Iterator

COUNT = 100


class Amplifier(SCPIMixin, Instrument):  # type: ignore[misc]
    """As PyMeasure's users write an instrument."""

    voltage = Instrument.control("VOLT?", "VOLT %.6f", "Voltage [V].")
    displacement = Instrument.measurement("MEAS?", "Displacement [um].")

    def joined(self, volts: float) -> float:
        (micrometres,) = self.values(f"VOLT {volts:.6f};:MEAS?")
        return 1e-6 * float(micrometres)

    def apart(self, volts: float) -> float:
        self.voltage = volts
        return 1e-6 * float(self.displacement)


@pytest.fixture
def there() -> Iterator[pt.hardware.VirtualScpi]:
    stage = pt.hardware.VirtualDevice(pt.VirtualStage.xu_li_2010(seed=3))
    with pt.hardware.VirtualScpi(stage) as instrument:
        yield instrument


@pytest.fixture
def amplifier(there: pt.hardware.VirtualScpi) -> Iterator[Amplifier]:
    host, port = there.address
    ends = {"read_termination": "\n", "write_termination": "\n"}
    place = f"TCPIP::{host}::{port}::SOCKET"
    one = Amplifier(place, "virtual stage", visa_library="@py", **ends)
    yield one
    one.adapter.close()


def test_pymeasure_knows_the_instrument(amplifier: Amplifier) -> None:
    assert amplifier.id.startswith("piezotrack,virtual stage")
    amplifier.voltage = 12.5
    assert amplifier.voltage == 12.5
    assert math.isfinite(amplifier.displacement)


def test_an_instrument_of_pymeasure_is_a_device(amplifier: Amplifier) -> None:
    record = pt.hardware.play_paced(amplifier.joined, np.linspace(0.0, 20.0, 21), 20.0)
    assert record.volts[-1] == 20.0
    assert "round trip" in record.notes[0]


@pytest.mark.slow
def test_joined_is_one_line_and_apart_two(
    there: pt.hardware.VirtualScpi,
    amplifier: Amplifier,
    monkeypatch: pytest.MonkeyPatch,
    record_property: Any,
) -> None:
    """How long they take is printed (`pytest -s`), as it is the machine's; what is sent is not."""
    lines: list[str] = []
    whole = there.answer

    def spy(line: str) -> str | None:
        lines.append(line)
        return whole(line)

    monkeypatch.setattr(there, "answer", spy)
    host, port = there.address
    device = pt.hardware.ScpiDevice(host, port, unit="um", limits=(0.0, 75.0))
    ways = {"own": device.exchange, "joined": amplifier.joined, "apart": amplifier.apart}
    for name, exchange in ways.items():
        lines.clear()
        times = []
        for _ in range(COUNT):
            before = time.perf_counter()
            assert math.isfinite(exchange(1.0))
            times.append(time.perf_counter() - before)
        trip = pt.hardware.RoundTrip.of(times)
        record_property(name, str(trip))
        print(f"{name}: {trip}")
        assert len(lines) == COUNT * (2 if name == "apart" else 1)
    device.close()
