"""Device that was named on the command line: its limits, a slow first stroke, and a log of it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.units import best_length_unit, length_text
from ...errors import DataError, DeviceError, Interrupted, ParameterError
from ...hardware.measuring import RAMP, measure
from .. import parts
from ..code import command, plain
from ..device import IN_USE
from ..state import LogState, State

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from ...data.dataset import Dataset
    from ...hardware.device import Device
    from ..desk import Desk, Job
    from ..device import Facts, Tell
    from ..parts import Part

__all__ = [
    "RECORDING",
    "begin",
    "facts_of",
    "first",
    "limits_fault",
    "limits_of_device",
    "need_stroke",
    "ready",
    "recording",
    "stroke",
]

WAVES = {
    "decaying": "shrinking triangles",
    "triangle": "triangle",
    "sine": "sine",
    "staircase": "staircase",
}
# Sampling rate where none is given, and of the slow stroke [Hz]; length of that [s].
USUAL_RATE, STROKE_RATE, STROKE = 1000.0, 200.0, 10.0
STEPS_UP = 5


def recording(desk: Desk) -> list[Part]:
    """Return the part of the page that records a log."""
    if desk.device is None:
        return []
    if limits_fault(desk):
        return first(desk, "log")
    state = desk.state.device
    drive = parts.controls(
        "recording",
        "Record a log",
        parts.select("wave", "Drive", state.wave, list(WAVES.items())),
        parts.number("frequency", "Frequency", state.frequency, "Hz"),
        parts.number("rate", "Sampling rate", _rate(desk), "Hz"),
        step="device",
    )
    drive["buttons"] = [
        parts.action("Record", "log.record", primary=True, disabled=not ready(desk))
    ]
    line = command(
        "measure",
        _drive(desk),
        device=desk.device.facts.address,
        rate=f"{plain(_rate(desk))}Hz",
        out="measured.csv",
    )
    return [*first(desk, "log"), drive, parts.code("record-code", "Record as a command", line)]


def first(desk: Desk, step: str) -> list[Part]:
    """Return the limits, and the slow stroke that comes before everything else."""
    facts, state = facts_of(desk), desk.state.device
    lowest, highest = facts.limits
    span = f"{facts.limits[0]:g} to {facts.limits[1]:g} V"
    title = f"Device: {' to '.join(facts.channels)}, {span}"
    limits = parts.controls(
        "limits",
        title,
        parts.number("low", "Lowest voltage", lowest if state.low is None else state.low, "V"),
        parts.number("high", "Highest voltage", highest if state.high is None else state.high, "V"),
        step="device",
    )
    if fault := limits_fault(desk):
        return [limits, parts.messages("limits-fault", parts.message("red", fault))]
    low, high = limits_of_device(desk)
    stroked, busy = _stroked(desk), _busy(desk)
    limits["buttons"] = [
        parts.action("Slow first stroke", f"{step}.stroke", primary=not stroked, disabled=busy)
    ]
    page = [limits, *desk.faults("device")]
    if busy:
        if "device" not in desk.running:
            # Another window moves it, and says nothing here.
            desk.changed()
        words = "the device moves; STOP leads it to rest"
        return [*page, parts.messages("moving", parts.message("amber", words))]
    if not stroked:
        words = (
            f"first one slow stroke over {low:g} to {high:g} V, {STROKE:g} s: watch the stage, and "
            "press STOP (Esc) where something is wrong"
        )
        page.append(parts.messages("stroke-first", parts.message("amber", words)))
    log: Dataset | None = desk.on_device.get("stroke")
    if log is not None and not desk.state.log.source:
        page.append(_stroke_chart(desk, log))
    return page


def facts_of(desk: Desk) -> Facts:
    """Return what the device says of itself."""
    if desk.device is None:
        raise DataError("no device was named: start piezotrack app with --device ADDRESS")
    return desk.device.facts


def limits_of_device(desk: Desk) -> tuple[float, float]:
    """Return the voltages that are used [V]: within those of the device."""
    lowest, highest = facts_of(desk).limits
    state = desk.state.device
    low = lowest if state.low is None else state.low
    high = highest if state.high is None else state.high
    if not lowest <= low < high <= highest:
        name, value = ("low", low) if not lowest <= low < highest else ("high", high)
        expected = f"voltages that increase, within {lowest:g} to {highest:g} V of the device"
        raise ParameterError(name, f"{value:g} V", expected)
    return low, high


def limits_fault(desk: Desk) -> str:
    """Say why the limits that are set cannot be used; empty where they can."""
    try:
        limits_of_device(desk)
    except ParameterError as error:
        return str(error)
    return ""


def _rate(desk: Desk) -> float:
    """Return the sampling rate of a record [Hz]."""
    return desk.state.device.rate or _near(desk, USUAL_RATE)


def _near(desk: Desk, rate: float) -> float:
    lowest, highest = facts_of(desk).rates
    return min(max(rate, lowest), highest)


def _stroked(desk: Desk) -> bool:
    """Whether the device has been moved slowly over all that is used."""
    low, high = limits_of_device(desk)
    known = None if desk.device is None else desk.device.stroked
    return known is not None and known[0] <= low and high <= known[1]


def ready(desk: Desk) -> bool:
    """Whether the device rests, and has been moved slowly over what is used."""
    return not _busy(desk) and _stroked(desk)


def _busy(desk: Desk) -> bool:
    """Whether this window, or another one, moves the device."""
    return "device" in desk.running or (desk.device is not None and desk.device.busy)


def _drive(desk: Desk) -> str:
    """Return the drive of a record as a text."""
    low, high = limits_of_device(desk)
    state = desk.state.device
    span = f"{plain(low)}..{plain(high)}V"
    if state.wave == "staircase":
        return f"staircase:{STEPS_UP},{span},dwell={plain(1.0 / (state.frequency or 1.0))}s"
    return f"{state.wave}:{plain(state.frequency)}Hz,{span}"


def begin(desk: Desk, work: Any, ended: Callable[[Any], None], tell: Tell = lambda _: None) -> None:
    """Do something with the device in the background; `ended` gets what it gives."""
    device = desk.device
    if device is None or _busy(desk):
        raise DeviceError(IN_USE)

    def run(job: Job) -> None:
        def told(found: object) -> None:
            tell(found)
            job.changed()

        try:
            ended(device.run(work, told, job.stop.is_set))
        except (Interrupted, DeviceError, DataError) as error:
            if error.partial is not None:
                ended(error.partial)
            raise DeviceError(str(error)) from None

    desk.start("device", run)


def need_stroke(desk: Desk) -> None:
    """Raise DeviceError unless the device has been moved slowly over what is used."""
    if not _stroked(desk):
        raise DeviceError(
            "these voltages were not reached slowly yet: expected a slow stroke first"
        )


def stroke(desk: Desk, _: Mapping[str, Any]) -> None:
    """Move once up and down, slowly, before anything else."""
    low, high = limits_of_device(desk)
    device = desk.device

    def ended(log: Dataset) -> None:
        desk.on_device["stroke"] = log
        if device is not None:
            device.stroked = low, high

    span = f"{plain(low)}..{plain(high)}V"
    drive = f"triangle:{plain(1.0 / STROKE)}Hz,{span},{plain(STROKE)}s"
    rate = _near(desk, STROKE_RATE)
    begin(desk, partial(_measured, drive=drive, rate=rate, ramp=STROKE / 4.0), ended)


def _record(desk: Desk, _: Mapping[str, Any]) -> None:
    """Record a log, and open it."""
    need_stroke(desk)

    def ended(log: Dataset) -> None:
        desk.on_device["record"] = log
        desk.changed("log.recorded")

    work = partial(_measured, drive=_drive(desk), rate=_rate(desk))
    begin(desk, work, ended)


def _recorded(desk: Desk, _: Mapping[str, Any]) -> None:
    """Open the log that was recorded."""
    log: Dataset | None = desk.on_device.get("record")
    if log is None:
        raise DataError("nothing has been recorded yet")
    content = log.full.save(desk.place("recorded") / "measured.csv").read_bytes()
    source = desk.keep("log", "measured.csv", content)
    desk.forget("test")
    window = float(f"{log.t[0]:.6g}"), float(f"{log.t[-1]:.6g}")
    fresh = State(step=desk.state.step, device=desk.state.device, use=desk.state.use)
    desk.state = replace(fresh, log=LogState(source=source, window=window, hold="zoh"))


# In the process of the device, which is why they are functions of the module.


def _measured(device: Device, _: Tell, *, drive: str, rate: float, ramp: float = RAMP) -> Dataset:
    return measure(device, drive, rate, ramp=ramp)


def _stroke_chart(desk: Desk, stroke: Dataset) -> Part:
    """Draw the loop of the slow stroke."""
    unit, scale = best_length_unit(stroke.stroke)
    line = desk.plotter.in_plane("stroke", stroke.u, scale * stroke.y, "measured", "measured")
    words = f"The slow stroke: {length_text(stroke.stroke)} over {np.ptp(stroke.u):.4g} V."
    axes = ("drive", "V"), ("displacement", unit)
    return parts.chart("stroke", "Slow first stroke", words, *axes, [line])


RECORDING = {"stroke": stroke, "record": _record, "recorded": _recorded}
