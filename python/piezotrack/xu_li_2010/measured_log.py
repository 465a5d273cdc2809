"""The same experiments on a measured log, up to the feedforward.

The log is that of Y. N. Aye and W. T. Ang, "A Discrete Backlash Operator for Identification and
Compensation of Hysteresis and Non-linearity for Piezoelectric Micromanipulator", ICSTSD 2018: a
piezo stack under 1 Hz. In its second part the drive is the feedforward of its authors' own inverse
model, with which ours is compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data.reader import read
from ..errors import DataError
from ..identification.fit import identify
from ..identification.methods.descents import Descents
from ..references.reference import Reference, read_reference
from .extensions import rivals
from .section import Section

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Drives", "drives"]

# Part of training.csv after the transient of an unknown history [s].
FITTED = (3.0, 23.0)
# Row of tracking.csv from which on the drive is the authors' feedforward, and the number of rows
# after it to skip as a transient.
COMPENSATED, CHANGE = 7432, 200


@dataclass(frozen=True, kw_only=True, eq=False)
class Drives:
    """Measured drive, and drives computed for the same reference.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time in tracking.csv [s].
    desired : ndarray, shape (n,)
        Reference [m], in the frame of the sensor.
    measured : ndarray, shape (n,)
        Drive of the authors' inverse [V].
    line : ndarray, shape (n,)
        Straight line in the reference fitted to it [V]: a drive without compensation.
    computed : dict of str to ndarray, shape (n,)
        Drive of each of our inverses [V], shifted to the mean of the measured one.
    fits : dict of str to float
        Residual rms of each model, in parts of the stroke.
    shifts : dict of str to float
        Differences of the means before the shift [V].
    """

    t: Array
    desired: Array
    measured: Array
    line: Array
    computed: dict[str, Array]
    fits: dict[str, float]
    shifts: dict[str, float]

    def section(self) -> Section:
        """Table of the differences of the drives."""
        span = float(np.ptp(self.measured))
        off = _rms(self.line - self.measured)
        rows = [("no compensation", "", f"{1e3 * off:.1f}", f"{100 * off / span:.2f}", "", "")]
        for name, voltage in self.computed.items():
            away = _rms(voltage - self.measured)
            rows.append(
                (
                    name,
                    f"{100 * self.fits[name]:.2f}",
                    f"{1e3 * away:.1f}",
                    f"{100 * away / span:.2f}",
                    f"{100 * (1.0 - (away / off) ** 2):.0f}",
                    f"{1e3 * self.shifts[name]:.0f}",
                )
            )
        return Section(
            title="A measured log: drive of our inverse and of the authors' inverse",
            text="Models fitted to 20 s of training.csv; their inverse along the reference of "
            f"tracking.csv, compared from row {COMPENSATED + CHANGE} on with the recorded "
            "drive, the feedforward of another group's inverse of another model. Means are "
            "removed, as the two records have different offsets. Explained: of the variance of "
            "the difference between that feedforward and a straight line.",
            heads=(
                "inverse of",
                "fit, % of stroke",
                "rms difference, mV",
                "% of range",
                "explained, %",
                "mean difference, mV",
            ),
            rows=tuple(rows),
        )


def drives(folder: str | os.PathLike[str]) -> Drives:
    """Identify from ``training.csv`` and invert for the reference of ``tracking.csv``.

    Parameters
    ----------
    folder : path-like
        Folder of both files.

    Returns
    -------
    Drives
        Measured and computed.

    Raises
    ------
    DataError
        A file is missing, or is not of that log.
    """
    where = Path(folder)
    training = read(where / "training.csv")[FITTED[0] : FITTED[1]]
    file = where / "tracking.csv"
    log, wanted = read(file), read_reference(file)
    reached = wanted.sample(log.dt).x
    if len(log) < COMPENSATED + 2 * CHANGE or reached.size != len(log):
        raise DataError(
            f"{file.name} has {len(log)} rows: expected those of the log, more than "
            f"{COMPENSATED + 2 * CHANGE}, each with a reference"
        )
    part = slice(COMPENSATED + CHANGE, None)
    # Reference and sensor have different zeros.
    reached = reached + float(np.mean((log.y - reached)[part]))
    reference = Reference.from_samples(reached, log.dt, name=file.name)
    desired, measured = reached[part], log.u[part]
    slope, level = np.polyfit(desired, measured, 1)
    line = float(slope) * desired + float(level)
    computed, fits, shifts = {}, {}, {}
    dahl = identify(training, "dahl", method=Descents(seed=1, runs=2), progress=False)
    found: dict[str, Any] = {"Dahl": dahl, **rivals(training)}
    for name, fit in found.items():
        voltage = fit.inverse().voltage(reference, log.dt)[part]
        shifts[name] = float(np.mean(voltage - measured))
        computed[name], fits[name] = voltage - shifts[name], fit.cost / training.stroke
    return Drives(
        t=log.t[part],
        desired=desired,
        measured=measured,
        line=line,
        computed=computed,
        fits=fits,
        shifts=shifts,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
