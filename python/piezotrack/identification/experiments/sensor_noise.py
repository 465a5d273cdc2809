"""Noise of a sensor, from a record at rest."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ... import _core
from ..._support.arguments import expect
from ..._support.arrays import real_array
from ..._support.display.result import Result
from ..._support.files.writing import make_folder, result_set, save_figures, write_document
from ..._support.statistics import ErrorStatistics
from ...data.dataset import Dataset
from ...errors import DataError
from ...stages.virtual import VirtualStage

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Noise", "identify_noise"]

# Correlation of displacement and drive above which a record is not one at rest.
FOLLOWS = 0.5
# Smallest product of bandwidth and duration for which the fluctuations count as noise.
SLOWEST = 10.0


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Noise(Result):
    r"""Noise of a sensor at rest, and a model of it.

    The model is white noise through a first-order low-pass, quantised: the one-sided spectral
    density at interval dt, with :math:`r = e^{-2 \pi f_b \, dt}`, is

    .. math:: S(f) = 2 \, dt \left(\sigma^2 \frac{1 - r^2}{1 + r^2 - 2 r \cos 2 \pi f \, dt}
        + \frac{q^2}{12}\right)

    Attributes
    ----------
    data : Dataset
        The record.
    spread : ErrorStatistics
        Statistics of the record about its drift [m]; its `sd_error` is what Xu and Li 2010 call
        the rms of the noise.
    drift : float
        Range of the cubic that is removed as creep and drift [m].
    resolution : float
        Quantisation step q of the readings [m]; 0 if none is found.
    levels : int
        Number of distinct readings.
    noise, bandwidth : float
        Sigma before quantisation [m rms], and bandwidth [Hz], infinite for white noise.
    bandwidth_sd : float or None
        Standard deviation of the bandwidth [Hz]; None for white noise.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.experiments.sensor_noise_report:noise_text",
        "plot": "identification.views.experiments.sensor_noise_plot:plot_noise",
    }

    data: Dataset
    spread: ErrorStatistics
    drift: float
    resolution: float
    levels: int
    noise: float
    bandwidth: float
    bandwidth_sd: float | None

    def __repr__(self) -> str:
        return f"<Noise of {self.data!r}: {1e6 * self.rms:.4g} um rms>"

    @property
    def rms(self) -> float:
        """Rms of the record about its drift [m], quantisation included."""
        return self.spread.sd_error

    def of_stage(self, stage: VirtualStage) -> VirtualStage:
        """Return a virtual stage with this sensor.

        Parameters
        ----------
        stage : VirtualStage
            The stage.

        Returns
        -------
        VirtualStage
            The same with this noise, bandwidth and resolution.
        """
        expect("stage", stage, VirtualStage, "pt.VirtualStage")
        sensor = replace(
            stage.sensor,
            noise=self.noise,
            noise_bandwidth=self.bandwidth,
            resolution=self.resolution,
        )
        return replace(stage, sensor=sensor)

    def spectrum(self) -> tuple[Array, Array]:
        """Amplitude spectral density of the record by Welch's method.

        Returns
        -------
        frequency : ndarray, shape (m,)
            Frequencies [Hz], without 0.
        density : ndarray, shape (m,)
            One-sided [m/sqrt(Hz)]; Hann windows, half overlapping, about 16 of them.
        """
        from scipy.signal import welch

        y = self.data.y
        f, power = welch(
            y, 1.0 / self.data.dt, nperseg=min(y.size, max(64, y.size // 8)), detrend="linear"
        )
        return f[1:], np.sqrt(power[1:])

    def density(self, frequency: Array) -> Array:
        """Amplitude spectral density of the model.

        Parameters
        ----------
        frequency : ndarray, shape (m,)
            Frequencies, up to half the sampling rate [Hz].

        Returns
        -------
        ndarray, shape (m,)
            One-sided [m/sqrt(Hz)].
        """
        frequency, dt = real_array("frequency", frequency), self.data.dt
        r = math.exp(-math.tau * self.bandwidth * dt)
        shape = (1.0 - r * r) / (1.0 + r * r - 2.0 * r * np.cos(math.tau * frequency * dt))
        power = 2.0 * dt * (self.noise**2 * shape + self.resolution**2 / 12.0)
        return np.asarray(np.sqrt(power))

    @property
    def notes(self) -> list[str]:
        """Warnings about the record, one sentence each."""
        if self.bandwidth_sd is None or self.bandwidth * self.data.duration >= SLOWEST:
            return []
        return [
            f"the fluctuations are slower than sensor noise, {self.bandwidth:.3g} Hz in a record "
            f"of {self.data.duration:.4g} s: was the stage at rest?"
        ]

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": "piezotrack-noise",
            "schema_version": 1,
            "unit": "m, Hz",
            "spread": asdict(self.spread),
            "drift": self.drift,
            "resolution": self.resolution,
            "levels": self.levels,
            "noise": self.noise,
            # JSON has no infinity.
            "bandwidth": None if self.bandwidth_sd is None else self.bandwidth,
            "bandwidth_sd": self.bandwidth_sd,
            "data": {"source": self.data.source, "sha256": self.data.sha256},
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the figures as JSON, and the picture.

        Parameters
        ----------
        folder : path-like
            Where to; made where it is missing.

        Returns
        -------
        list of pathlib.Path
            ``noise.json``, ``noise.png`` and ``noise.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        with result_set(make_folder(folder)) as path:
            return [
                write_document(path / "noise.json", self.document()),
                *save_figures({"noise": self.plot()}, path),
            ]


def identify_noise(log: Dataset) -> Noise:
    """Identify the noise of a sensor from a record at rest.

    A cubic in time is removed as creep and drift. The quantisation step is the largest of which all
    differences of readings are whole multiples; its rounding error is white and adds
    ``step^2 / 12`` to the variance (Widrow 1956, doi 10.1109/TCT.1956.1086334), which holds for a
    noise above half a step. The bandwidth follows from the autocorrelation of the rest.

    Parameters
    ----------
    log : Dataset
        A record at rest, of 100 samples or more; its window is used.

    Returns
    -------
    Noise
        Figures, a model, and pictures.

    Raises
    ------
    ParameterError
        `log` is not a Dataset.
    ShapeError, DataError
        The record is too short, or shows no noise.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.xu_li_2010(seed=1)
    >>> found = pt.identification.identify_noise(stage.record(np.zeros(20000), 1 / 5000.0))
    >>> print(f"{1e6 * found.rms:.3f} um rms in steps of {1e6 * found.resolution:.3f} um")
    0.097 um rms in steps of 0.038 um
    """
    expect("log", log, Dataset, "pt.Dataset")
    ranges = np.ptp(log.u), np.ptp(log.y)
    if min(ranges) > 0.0:
        # From 0 to 1: the squares of small readings would be no numbers.
        drive, motion = (log.u - log.u.min()) / ranges[0], (log.y - log.y.min()) / ranges[1]
        alike = float(np.corrcoef(drive, motion)[0, 1])
        if abs(alike) > FOLLOWS:
            raise DataError(
                f"the displacement follows the drive, which goes from {log.u.min():.4g} to "
                f"{log.u.max():.4g} {log.drive_unit} (correlation {alike:.2f}): expected a record "
                "of a stage at rest"
            )
    figures, drift, resolution, levels, noise, bandwidth, sd = _core.sensor_noise(log.y, log.dt)
    return Noise(
        data=log,
        spread=ErrorStatistics.of(figures),
        drift=drift,
        resolution=resolution,
        levels=levels,
        noise=noise,
        bandwidth=bandwidth,
        bandwidth_sd=sd,
    )
