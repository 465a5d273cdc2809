"""Measured logs that come with the package.

They are text in the layout of the README's own example, compressed; see the README beside them.
"""

from __future__ import annotations

import gzip
from importlib.resources import files

import numpy as np

from ..dataset import Dataset

__all__ = ["dbo_tracking", "dbo_training"]


def dbo_training() -> Dataset:
    """Load a piezo stack under a sine of 1 Hz: a record to fit a model to.

    A PI PICMA P-885.91 stack, driven through a voltage amplifier with a command of 0 to 3.6 V
    and measured by a capacitive sensor: 8027 samples at 200 Hz, 40 cycles, stroke 45 um in
    ``[3.0:]``.

    Returns
    -------
    Dataset
        `Dataset.u` is the command to the amplifier. The displacement is not zeroed.

    Notes
    -----
    - The first 3 s are a transient from an unknown history: use them as warm-up, as
      ``dbo_training()[3.0:23.0]`` does, and not in a fit.
    - The sensor is delayed by about one sample.

    References
    ----------
    Y. N. Aye and W. T. Ang, "A Discrete Backlash Operator for Identification and Compensation of
    Hysteresis and Non-linearity for Piezoelectric Micromanipulator", International Conference on
    Science and Technology for Sustainable Development (ICSTSD), Yangon, 2018. Data:
    https://github.com/yan9a/DiscreteBacklashOperator at 79fd060, copyright 2019 Yan Naing Aye,
    MIT licence.

    Examples
    --------
    >>> dbo_training()[3.0:23.0]
    Dataset(4000 samples, 20 s at 200 Hz, stroke 45.4 um, warm-up 600 samples)
    """
    return _load("dbo_training")


def dbo_tracking() -> Dataset:
    """Load the same piezo stack under a sine of varying amplitude: a record for validation.

    14155 samples at 200 Hz of a 1 Hz sine whose amplitude grows and shrinks again. In the first
    7432 samples the drive is a straight line of the reference (no compensation), in the rest the
    feedforward of the authors' inverse model.

    Returns
    -------
    Dataset
        As from `dbo_training`, with the desired displacement [m] in ``columns["reference"]``.

    Notes
    -----
    - The first 3 s are a transient here too: use ``dbo_tracking()[3.0:]``.
    - Displacements are offset by about -0.8 um from those of `dbo_training`. `Identification.score`
      gives each record an offset of its own.
    - The authors report a tracking error of 1.68 um rms without and 0.58 um with compensation.

    References
    ----------
    As for `dbo_training`.

    Examples
    --------
    >>> log = dbo_tracking()
    >>> log[3.0:]
    Dataset(13555 samples, 67.775 s at 200 Hz, stroke 41.4 um, warm-up 600 samples)
    >>> dict(log.column_units)
    {'reference': 'm'}
    """
    return _load("dbo_tracking")


def _load(name: str) -> Dataset:
    text = gzip.decompress((files(__package__) / f"{name}.csv.gz").read_bytes()).decode("ascii")
    header, *rows = text.splitlines()
    signals = dict(zip(header.split(","), np.loadtxt(rows, delimiter=",").T, strict=True))
    # Divided, not multiplied by 1e-6: the bits are then those that `read` gives.
    lengths = {key: signals[key] / 1e6 for key in signals if key.endswith("_um")}
    y = lengths.pop("displacement_um")
    columns = {key.removesuffix("_um"): values for key, values in lengths.items()}
    return Dataset(
        u=signals["voltage_V"],
        y=y,
        t=signals["time_s"],
        columns=columns,
        column_units=dict.fromkeys(columns, "m"),
        source=name,
    )
