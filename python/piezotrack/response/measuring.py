"""`frequency_response`: of a device, of a stage, or from logs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.arguments import expect, has_entries, plain, positive
from .._support.messages import quoted
from ..data.dataset import Dataset
from ..errors import DataError, ParameterError
from ..hardware.device import Device
from ..hardware.measuring import check_device, measure, obtained_rate, rest_of
from ..hardware.virtual import VirtualDevice
from ..identification.fitted.identified_model import IdentifiedModel
from ..stages.base import Stage
from ..stages.virtual import VirtualStage
from .best_linear_approximation import approximate, spectra
from .excitation import RandomPhaseMultisine
from .nonperiodic import from_nonperiodic
from .periods import period_of
from .response_data import FrequencyResponse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["frequency_response"]

# Ratio to the largest of the amplitude at a line of a log below which it is not excited.
EXCITED = 1e-3
# Parts of a log, up to its end, in which a period is sought.
SHARES = (1.0, 0.75, 0.5)


def frequency_response(
    source: Device | Stage | VirtualStage | IdentifiedModel | Dataset | Sequence[Dataset],
    excitation: RandomPhaseMultisine | None = None,
    *,
    rate: float | None = None,
    period: float | None = None,
    resolution: float | None = None,
    rest: float | None = None,
) -> FrequencyResponse:
    """Measure the frequency response of a stage with its uncertainty, or compute it from logs.

    A device or a stage is excited by a random-phase multisine; the result is the best linear
    approximation with the share of noise and of nonlinear distortion in its variance (Pintelon and
    Schoukens, System Identification, 2nd ed., 2012, section 4.3). A log whose drive repeats is
    evaluated in the same way, several logs as realisations; any other by Welch's method with its
    coherence, where noise and distortion cannot be distinguished.

    Hysteresis makes gain and phase depend on the amplitude: measure at the amplitude of the motion
    that is wanted, or at several.

    Parameters
    ----------
    source : Device, Stage, VirtualStage, IdentifiedModel, Dataset or sequence of Dataset
        What is measured: a device, a simulated stage, or one log or several.
    excitation : RandomPhaseMultisine, optional
        Of a device or a stage.
    rate : float, optional
        Sampling rate [Hz] of a device or a stage; a device may round it.
    period : float, optional
        Period of the drive of a log [s]; found by default.
    resolution : float, optional
        Of a log that does not repeat: distance of the frequencies [Hz]; default 16 over its
        length.
    rest : float, optional
        Voltage of a device before and after [V]; default 0 V, or the limit nearest to it.

    Returns
    -------
    FrequencyResponse
        The response from sample to sample, delays included.

    Raises
    ------
    ParameterError
        An argument is missing, has no effect or is out of its range: the band is beyond half the
        rate, or the amplitude beyond the limits.
    DataError
        A log has no excitation, or is too short.
    DeviceError, Interrupted
        A device failed, or the measurement was interrupted: the output is at rest.

    Examples
    --------
    >>> import piezotrack as pt
    >>> device = pt.hardware.VirtualDevice(pt.VirtualStage.xu_li_2010(seed=1))
    >>> lines = pt.RandomPhaseMultisine(band=(2.0, 300.0), low=32.0, high=43.0)
    >>> response = pt.frequency_response(device, lines, rate=2000.0)
    >>> response
    <FrequencyResponse: 75 lines, 2 to 298 Hz>
    >>> print(f"{1e6 * response.magnitude[0]:.1f} um/V")
    1.3 um/V
    """
    if isinstance(source, Dataset):
        source = [source]
    if has_entries(source):
        _refuse({"excitation": excitation, "rate": rate, "rest": rest}, "of a log")
        return _of_logs(list(source), period, resolution)
    _refuse({"period": period, "resolution": resolution}, "where it is measured")
    if not isinstance(excitation, RandomPhaseMultisine):
        raise ParameterError("excitation", quoted(excitation), "pt.RandomPhaseMultisine")
    if rate is None:
        raise ParameterError("rate", "missing", "a sampling rate [Hz]")
    if isinstance(source, (Stage, VirtualStage, IdentifiedModel)):
        source = _device_of(source, excitation)
    check_device(source)
    assert isinstance(source, Device)
    return _measured(source, excitation, rate, rest)


def _refuse(given: dict[str, object], where: str) -> None:
    for name, value in given.items():
        if value is not None:
            raise ParameterError(name, f"{value!r}", f"none {where}")


def _device_of(
    stage: Stage | VirtualStage | IdentifiedModel, excitation: RandomPhaseMultisine
) -> VirtualDevice:
    """Return a stage as a device, with the limits of its amplifier or those of the excitation."""
    virtual = stage if isinstance(stage, VirtualStage) else VirtualStage.of(stage)
    if np.isfinite(virtual.amplifier.limits).all():
        return VirtualDevice(virtual)
    return VirtualDevice(virtual, limits=(min(excitation.low, 0.0), max(excitation.high, 0.0)))


def _measured(
    device: Device, excitation: RandomPhaseMultisine, rate: float, rest: float | None
) -> FrequencyResponse:
    """Play each realisation on a device, from rest and back, and evaluate the records."""
    obtained, notes = obtained_rate(device, positive("rate", rate, "Hz"))
    low, high = device.limits
    if not low <= excitation.low < excitation.high <= high:
        raise ParameterError(
            "excitation",
            f"{plain(excitation.low)} to {plain(excitation.high)} V",
            f"{plain(low)} to {plain(high)} V at most, the limits of {device.channels[0]}",
        )
    home = rest_of(device, rest)
    signals, count = excitation.signals(obtained), excitation.samples(obtained)
    total = excitation.settle + excitation.periods
    records = []
    for signal in signals:
        log = measure(device, np.tile(signal, total), obtained, rest=home)
        records.append(log[log.t[excitation.settle * count] :])
        _check_moves(records[-1], device.channels[-1])
    # A device notes the same for every realisation.
    notes = tuple(dict.fromkeys((*notes, *(note for log in records for note in log.notes))))
    return _approximated(
        records,
        count,
        excitation.numbers(obtained),
        excitation=f"{excitation.realisations} realisations of {excitation.periods} periods of "
        f"{plain(count / obtained)} s",
        notes=notes,
    )


def _of_logs(logs: list[Any], period: float | None, resolution: float | None) -> FrequencyResponse:
    """Evaluate logs, as periods and realisations where the drive repeats."""
    if not logs:
        raise ParameterError("source", "an empty list", "a log or more")
    for log in logs:
        expect("source", log, Dataset, "a device, a stage, pt.Dataset or several of these")
    first = logs[0]
    for k, log in enumerate(logs):
        if abs(log.dt - first.dt) > 1e-6 * first.dt or log.drive_unit != first.drive_unit:
            raise ParameterError(
                "source",
                f"log {k} at {1.0 / log.dt:.6g} Hz in {log.drive_unit}",
                f"{1.0 / first.dt:.6g} Hz in {first.drive_unit}, as log 0",
                verb="has",
            )
        _check_moves(log, f"log {k}")
    given = None if period is None else positive("period", period, "s")
    # A drive may begin with a ramp.
    for share in SHARES if given is None else (1.0,):
        ends = [log[log.t[round((1.0 - share) * (len(log) - 1))] :] for log in logs]
        counts = {period_of(log, given) for log in ends}
        if counts != {None}:
            break
    if len(counts) > 1:
        known = ", ".join("none" if n is None else f"{n * first.dt:.6g} s" for n in counts)
        raise ParameterError("source", f"periods of {known}", "one period in all logs", verb="has")
    (count,) = counts
    if count is None:
        return from_nonperiodic(logs, resolution)
    logs = ends
    _refuse({"resolution": resolution}, "of a log that repeats")
    lines = _excited(logs, count)
    periods = min(len(log) for log in logs) // count
    words = f"{len(logs)} logs of" if len(logs) > 1 else ""
    return _approximated(
        logs,
        count,
        lines,
        excitation=f"{words} {periods} periods of {count * first.dt:.6g} s".strip(),
    )


def _check_moves(log: Dataset, name: str) -> None:
    """Refuse a record without an excitation, or of a sensor that shows nothing."""
    for signal, words in ((log.u, "drive"), (log.y, "displacement")):
        if not np.ptp(signal) > 0.0:
            raise DataError(f"{name}: the {words} does not move: expected an excitation")


def _excited(logs: list[Dataset], count: int) -> NDArray[np.intp]:
    """Return the lines that all logs excite."""
    sizes = np.array([np.abs(np.fft.rfft(log.u[:count])) for log in logs]).min(axis=0)
    sizes = sizes[: (count + 1) // 2]
    sizes[0] = 0.0
    return np.flatnonzero(sizes > EXCITED * sizes.max())


def _approximated(
    logs: list[Dataset],
    count: int,
    lines: NDArray[np.intp],
    *,
    excitation: str,
    notes: tuple[str, ...] = (),
) -> FrequencyResponse:
    """Return the response from logs of whole periods, each a realisation."""
    first = logs[0]
    periods = min(len(log) for log in logs) // count
    # The last periods, as the first may not have settled.
    drives, outputs = (
        np.stack([getattr(log, name)[-periods * count :].reshape(periods, count) for log in logs])
        for name in ("u", "y")
    )
    if len(logs) * periods < 2:
        raise DataError(f"the log has one period of {count * first.dt:.6g} s: expected two or more")
    drive, output = spectra(drives, lines), spectra(outputs, lines)
    found = approximate(output, drive, drive.mean(axis=1))
    return FrequencyResponse(
        frequency=lines / (count * first.dt),
        value=found.value,
        variance=found.variance,
        degrees=found.degrees,
        noise=found.noise,
        distortion=found.distortion,
        dt=first.dt,
        amplitude=float(drives.std()),
        offset=float(drives.mean()),
        drive_unit=first.drive_unit,
        excitation=excitation,
        source=first.source,
        notes=(*notes, *_missing(len(logs), periods)),
    )


def _missing(realisations: int, periods: int) -> tuple[str, ...]:
    """Warn of what one realisation or one period does not show."""
    if realisations == 1:
        return ("one realisation: the band holds noise only, not nonlinear distortion",)
    if periods == 1:
        return ("one period: noise and nonlinear distortion are not distinguished",)
    return ()
