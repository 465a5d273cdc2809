"""Frequency response with its uncertainty: the result of a measurement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._support.arguments import in_range
from .._support.arrays import check_dt
from .._support.display.frames import frame_of
from .._support.display.result import Panel, Result
from .._support.files.writing import write_result
from .._support.units import shown_unit
from ..errors import ParameterError, ShapeError

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["FORMAT", "SCHEMA_VERSION", "FrequencyResponse"]

FORMAT, SCHEMA_VERSION = "piezotrack-response", 1


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FrequencyResponse(Result):
    """Frequency response at some lines, with its uncertainty; printed, a short table.

    Errors are circular complex: in every direction about the value alike. All variances are those
    of the value, but `distortion`.

    Attributes
    ----------
    frequency : ndarray, shape (n,)
        Frequencies, rising [Hz].
    value : ndarray of complex, shape (n,)
        Response, from the drive to the displacement [m/V].
    variance : ndarray, shape (n,)
        Expectation of the squared error of `value`, of noise and distortion [m^2/V^2].
    degrees : int
        Real degrees of freedom of `variance`.
    noise : ndarray or None, shape (n,)
        Part of the noise in `variance` [m^2/V^2]; None where it is not distinguished.
    distortion : ndarray or None, shape (n,)
        Variance of the nonlinear distortion of one realisation [m^2/V^2]; None where it is not
        distinguished.
    coherence : ndarray or None, shape (n,)
        Share of the power of the displacement that the drive explains, of a record that does not
        repeat; None of others.
    dt : float
        Sampling interval [s]; the drive is held between samples.
    amplitude : float
        Root mean square of the drive about its mean [V].
    offset : float
        Mean of the drive [V].
    drive_unit, output_unit : str
        Units of the drive and of what answers to it; of ratios in a loop others than V and m.
    excitation : str
        Description of the excitation.
    source : str or None
        Description of the stage or the log.
    notes : tuple of str
        Warnings, one sentence each.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "response.views.response_text:response_text",
        "plot": "response.views.response_plot:plot_frequency_response",
        "plot_magnitude": "response.views.response_plot:plot_magnitude",
        "plot_phase": "response.views.response_plot:plot_phase",
        "plot_nyquist": "response.views.response_plot:plot_nyquist",
    }

    frequency: Array
    value: NDArray[np.complex128]
    variance: Array
    degrees: int
    noise: Array | None = None
    distortion: Array | None = None
    coherence: Array | None = None
    dt: float
    amplitude: float
    offset: float
    drive_unit: str = "V"
    output_unit: str = "m"
    excitation: str
    source: str | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_dt(self.dt)
        for name in ("value", "variance", "noise", "distortion", "coherence"):
            signal = getattr(self, name)
            if signal is not None and signal.shape != self.frequency.shape:
                raise ShapeError(
                    name, f"{signal.size} entries", f"{self.frequency.size}, as many as frequency"
                )

    def __repr__(self) -> str:
        ends = f"{self.frequency[0]:.4g} to {self.frequency[-1]:.4g} Hz"
        return f"<FrequencyResponse: {self.frequency.size} lines, {ends}>"

    @property
    def magnitude(self) -> Array:
        """Magnitude [m/V]."""
        return np.abs(self.value)

    @property
    def phase(self) -> Array:
        """Phase, without jumps of a turn [rad]."""
        return np.unwrap(np.angle(self.value))

    @property
    def shown_unit(self) -> tuple[str, float]:
        """Unit in which it is shown, as ``"um/V"``, and the factor to it."""
        (above, scale), (below, divisor) = shown_unit(self.output_unit), shown_unit(self.drive_unit)
        return f"{above}/{below}", scale / divisor

    def band(self, level: float = 0.95) -> Array:
        r"""Return the radius of the region that holds the response with some probability.

        .. math:: |\hat{G} - G|^2 \le \hat\sigma^2 F_p(2, \nu), \qquad
            F_p(2, \nu) = \frac{\nu}{2} \left((1 - p)^{-2/\nu} - 1\right)

        Pintelon and Schoukens 2012, section 2.4; F is the quantile of Fisher's distribution.

        Parameters
        ----------
        level : float, optional
            Probability p, at each line by itself.

        Returns
        -------
        ndarray, shape (n,)
            Radius [m/V].

        Raises
        ------
        ParameterError
            `level` is not between 0 and 1.
        """
        level = in_range("level", level, 0.9999, "probability")
        half = 0.5 * self.degrees
        quantile = half * ((1.0 - level) ** (-1.0 / half) - 1.0)
        return np.asarray(np.sqrt(self.variance * quantile))

    def within(
        self, lowest: float | None = None, highest: float | None = None
    ) -> FrequencyResponse:
        """Return the lines of a band.

        Parameters
        ----------
        lowest, highest : float, optional
            Its ends [Hz].

        Returns
        -------
        FrequencyResponse
            With these lines only.

        Raises
        ------
        ParameterError
            No line lies in the band.
        """
        low = -np.inf if lowest is None else _core.as_number("lowest", lowest)
        high = np.inf if highest is None else _core.as_number("highest", highest)
        kept = (self.frequency >= low) & (self.frequency <= high)
        if not kept.any():
            raise ParameterError(
                "lowest and highest",
                f"{low:g} and {high:g} Hz",
                f"a band with lines, which are at {self.frequency[0]:.4g} to "
                f"{self.frequency[-1]:.4g} Hz",
                verb="are",
            )
        signals = ("frequency", "value", "variance", "noise", "distortion", "coherence")
        parts: dict[str, Any] = {name: getattr(self, name) for name in signals}
        for name, signal in parts.items():
            parts[name] = None if signal is None else signal[kept]
        return replace(self, **parts)

    def to_control(self) -> Any:
        """Return the response as frequency response data of python-control.

        Returns
        -------
        control.FrequencyResponseData
            From the drive to the displacement, at `frequency`.

        Raises
        ------
        ParameterError
            python-control is not installed.
        """
        try:
            import control
        except ImportError:
            raise ParameterError("to_control needs python-control: expected it installed") from None
        return control.frd(self.value, 2.0 * np.pi * self.frequency, self.dt)

    @property
    def table(self) -> dict[str, Array]:
        """Columns of the response, with their units in the names."""
        words, scale = self.shown_unit
        name = words.replace("/", "_per_")
        columns = {
            "frequency_Hz": self.frequency,
            f"magnitude_{name}": scale * self.magnitude,
            "phase_deg": np.degrees(self.phase),
            f"band_95_{name}": scale * self.band(),
        }
        for kind in ("noise", "distortion"):
            if (variance := getattr(self, kind)) is not None:
                columns[f"{kind}_sd_{name}"] = scale * np.sqrt(variance)
        if self.coherence is not None:
            columns["coherence"] = self.coherence
        return columns

    def to_frame(self) -> Any:
        """Return the response as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            With the columns of `table`.

        Raises
        ------
        ParameterError
            pandas is not installed.
        """
        return frame_of(self.table)

    def document(self) -> dict[str, Any]:
        """Content of the JSON file, which `load_response` reads.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        optional = {
            name: None if signal is None else signal.tolist()
            for name in ("noise", "distortion", "coherence")
            for signal in (getattr(self, name),)
        }
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "drive_unit": self.drive_unit,
            "output_unit": self.output_unit,
            "frequency_Hz": self.frequency.tolist(),
            "real": self.value.real.tolist(),
            "imaginary": self.value.imag.tolist(),
            "variance": self.variance.tolist(),
            "degrees": self.degrees,
            **optional,
            "dt_s": self.dt,
            "amplitude_rms": self.amplitude,
            "offset": self.offset,
            "excitation": self.excitation,
            "source": self.source,
            "notes": list(self.notes),
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the response to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.

        Returns
        -------
        list of pathlib.Path
            ``response.csv``, ``response.json``, ``response.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        return write_result(folder, "response", self.document(), self.plot(), self.table)

    plot_magnitude = Panel("Plot the magnitude, with the band of 95 %, noise and distortion.")
    plot_phase = Panel("Plot the phase, with the band of 95 %.")
    plot_nyquist = Panel("Plot the response in the complex plane, with the band of 95 %.")
