"""Loops around several axes: a PID controller on each decoupled axis, margins and runs."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ... import _core
from ..._support.arguments import expect, has_entries, not_negative, number_pair, one_of
from ..._support.arrays import real_array
from ..._support.display.result import Result
from ..._support.files.writing import write_result
from ..._support.statistics import ErrorStatistics
from ...control.laws.pid import Pid
from ...errors import ParameterError, ShapeError
from ..modal_model import MultiAxisModel
from ..virtual import VirtualAxes
from .decoupling import decoupling_matrix, reference_of, terms_of
from .references import sampled_references

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from ..modal_terms import ModalTerms

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["AxesMargins", "MultiAxisTracking", "check_axes", "track_axes"]

# Frequencies at which margins are sought, and about each mode.
POINTS, NEAR = 2000, 41
FEEDFORWARDS = ("none", "static")


@dataclass(frozen=True, kw_only=True)
class AxesMargins:
    r"""Stability of a loop around several axes, and its margins by singular values.

    .. math:: M_s = 1 / \min_\omega \underline\sigma(I + L), \qquad
        M_t = \max_\omega \overline\sigma(L (I + L)^{-1})

    with L at the sensors. The margins that follow hold where gain or phase at the sensors change,
    in one loop or in each by itself (Skogestad and Postlethwaite, Multivariable Feedback Control,
    2nd ed., 2005, chapter 9).

    Attributes
    ----------
    stable : bool
        Whether all closed-loop poles are inside the unit circle.
    poles : ndarray of complex
        Sampled poles of the closed loop.
    sensitivity, complementary : float
        Peaks Ms and Mt; infinite where the loop is unstable.
    worst : float
        Frequency of Ms [Hz].
    """

    stable: bool
    poles: Any
    sensitivity: float
    complementary: float
    worst: float

    @property
    def radius(self) -> float:
        """Largest magnitude of the poles."""
        return float(np.abs(self.poles).max())

    @property
    def gain_margin(self) -> float:
        """Rise of gains that is allowed at least, from Ms and Mt [dB]."""
        if not self.stable:
            return 0.0
        from_s = self.sensitivity / (self.sensitivity - 1.0) if self.sensitivity > 1.0 else np.inf
        return float(20.0 * np.log10(max(from_s, 1.0 + 1.0 / self.complementary)))

    @property
    def phase_margin(self) -> float:
        """Lag that is allowed at least, from Ms and Mt [deg]."""
        if not self.stable:
            return 0.0
        peak = min(self.sensitivity, self.complementary)
        return float(np.degrees(2.0 * np.arcsin(min(1.0, 0.5 / peak))))

    def __str__(self) -> str:
        if not self.stable:
            return f"unstable: a pole of magnitude {self.radius:.4f}"
        return (
            f"stable, Ms {self.sensitivity:.2f} at {self.worst:.4g} Hz, Mt "
            f"{self.complementary:.2f}: gain margin {self.gain_margin:.1f} dB, phase margin "
            f"{self.phase_margin:.0f} deg at least"
        )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MultiAxisTracking(Result):
    """Motion of several axes in a closed loop; printed, the errors of each.

    Attributes
    ----------
    reference, y : ndarray, shape (samples, sensors)
        Desired and actual displacements [m].
    u : ndarray, shape (samples, drives)
        Drives, within their limits [V].
    dt : float
        Sampling interval [s].
    margins : AxesMargins
        Stability and margins of the loop.
    note : str
        Description of the loop.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "multiaxis.views.model_text:axes_tracking_text",
        "plot": "multiaxis.views.model_plot:plot_tracking",
    }

    reference: Array
    y: Array
    u: Array
    dt: float
    margins: AxesMargins
    note: str

    def __repr__(self) -> str:
        worst = " / ".join(f"{1e9 * one.rms_error:.4g}" for one in self.metrics)
        return f"<MultiAxisTracking: rms error {worst} nm>"

    @property
    def error(self) -> Array:
        """Desired minus actual displacement, shape (samples, sensors) [m]."""
        return self.reference - self.y

    @property
    def metrics(self) -> tuple[ErrorStatistics, ...]:
        """Errors of each axis."""
        return tuple(
            ErrorStatistics.of(_core.spread(self.error[:, k])) for k in range(self.y.shape[1])
        )

    @property
    def cross_coupling(self) -> Array:
        """Peak motion of each axis off its reference, relative to the largest stroke of all."""
        stroke = np.ptp(self.reference, axis=0).max()
        return np.asarray(np.abs(self.error).max(axis=0) / stroke)

    @property
    def table(self) -> dict[str, Array]:
        """Columns of the signals, with their units in the names."""
        columns = {"time_s": self.dt * np.arange(len(self.y), dtype=np.float64)}
        for name, unit, signals in (
            ("reference", "um", 1e6 * self.reference),
            ("displacement", "um", 1e6 * self.y),
            ("drive", "V", self.u),
        ):
            for k in range(signals.shape[1]):
                columns[f"{name}_{k}_{unit}"] = signals[:, k]
        return columns

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": "piezotrack-axes-run",
            "schema_version": 1,
            "dt_s": self.dt,
            "note": self.note,
            "stable": self.margins.stable,
            "sensitivity": self.margins.sensitivity,
            "complementary": self.margins.complementary,
            "gain_margin_dB": self.margins.gain_margin,
            "phase_margin_deg": self.margins.phase_margin,
            "rms_error_m": [one.rms_error for one in self.metrics],
            "max_error_m": [one.max_error for one in self.metrics],
            "cross_coupling": self.cross_coupling.tolist(),
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(
        self, folder: str | os.PathLike[str], *, entries: Mapping[str, Any] | None = None
    ) -> list[Path]:
        """Write the motion to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.
        entries : mapping, optional
            Further entries of the JSON file.

        Returns
        -------
        list of pathlib.Path
            ``axes_run.csv`` with the signals, ``axes_run.json``, ``axes_run.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        document = self.document() | dict(entries or {})
        return write_result(folder, "axes_run", document, self.plot(), self.table)


def check_axes(
    stage: MultiAxisModel | VirtualAxes,
    feedback: Pid | Sequence[Pid],
    *,
    decoupling: str = "static",
    level: float | None = None,
    model: MultiAxisModel | VirtualAxes | None = None,
) -> AxesMargins:
    """Compute stability and margins of a loop around several axes.

    Parameters
    ----------
    stage : MultiAxisModel or VirtualAxes
        The axes.
    feedback : Pid or sequence of Pid
        A law for each axis, or one for all. It acts from the error to a displacement, so `kp` is a
        ratio [m/m].
    decoupling : {"static", "diagonal"}, optional
        The matrix behind the laws, as of `decoupling_matrix`.
    level : float, optional
        Level of the drives [V rms], as of `MultiAxisModel.at`.
    model : MultiAxisModel or VirtualAxes, optional
        The model whose gains are inverted, where it is not the stage itself.

    Returns
    -------
    AxesMargins
        Poles and margins.

    Raises
    ------
    ParameterError
        An argument is of another kind.
    ShapeError
        There are not as many laws as sensors.
    """
    terms, laws, matrix = _parts(stage, feedback, decoupling, level, model)
    poles = np.asarray(np.linalg.eigvals(_closed(terms, laws, matrix, stage.dt)), np.complex128)
    if not (np.abs(poles) < 1.0).all():
        return AxesMargins(
            stable=False,
            poles=poles,
            sensitivity=np.inf,
            complementary=np.inf,
            worst=np.nan,
        )
    frequency = _frequencies(poles, stage.dt)
    z = np.exp(2j * np.pi * frequency * stage.dt)
    loop = terms.response(z) @ matrix
    polynomials = [law._linear(stage.dt) for law in laws]
    gains = [np.polyval(above, z) / np.polyval(below, z) for above, below in polynomials]
    loop = loop * np.stack(gains, axis=1)[:, np.newaxis, :] / z[:, np.newaxis, np.newaxis]
    returned = np.eye(len(laws)) + loop
    least = np.linalg.svd(returned, compute_uv=False)[:, -1]
    closed = np.linalg.solve(returned, loop)
    place = int(np.argmin(least))
    return AxesMargins(
        stable=True,
        poles=poles,
        sensitivity=float(1.0 / least[place]),
        complementary=float(np.linalg.svd(closed, compute_uv=False)[:, 0].max()),
        worst=float(frequency[place]),
    )


def track_axes(
    stage: MultiAxisModel | VirtualAxes,
    reference: ArrayLike | str | os.PathLike[str],
    feedback: Pid | Sequence[Pid],
    *,
    decoupling: str = "static",
    feedforward: str | ArrayLike = "none",
    level: float | None = None,
    model: MultiAxisModel | VirtualAxes | None = None,
    limits: tuple[float, float] | None = None,
    noise: float | None = None,
    seed: int = 0,
) -> MultiAxisTracking:
    """Simulate a loop around several axes from rest, each decoupled axis with a law of its own.

    A command is computed from the readings of one sample and put out at the next. Where a drive is
    at a limit, the laws unwind by what was cut off.

    Parameters
    ----------
    stage : MultiAxisModel or VirtualAxes
        The axes; the drives are about the operating point.
    reference : array_like of shape (samples, sensors), str or path-like
        Desired displacements [m], from rest at 0; or as the command line takes them: a file with a
        displacement column of each axis, a path of two axes, as ``"circle:2Hz,10um"``, or a motion
        of each divided by semicolons, as ``"sine:5Hz,0..2um;;"``, where an axis without one stays.
    feedback : Pid or sequence of Pid
        A law for each axis, or one for all; `kp` is a ratio [m/m].
    decoupling : {"static", "diagonal"}, optional
        The matrix behind the laws, as of `decoupling_matrix`.
    feedforward : {"none", "static"} or array_like of shape (samples, drives), optional
        Drives that are added [V]: none, the reference through the decoupling matrix, or any, as of
        `repeating_drive`.
    level : float, optional
        Level of the drives [V rms], as of `MultiAxisModel.at`.
    model : MultiAxisModel or VirtualAxes, optional
        The model whose gains are inverted, where it is not the stage itself.
    limits : tuple of float, optional
        Least and largest drive [V].
    noise : float, optional
        Noise of each sensor [m rms]; by default that of a virtual stage, or none.
    seed : int, optional
        Seed of the noise.

    Returns
    -------
    MultiAxisTracking
        The motion.

    Raises
    ------
    ParameterError
        An argument is of another kind, a text cannot be parsed, or the limits are no range.
    ShapeError
        Sizes do not fit each other, or references of axes have unequal lengths.
    DataError
        A file cannot be read or used.
    NumericalError
        The motion leaves the range of numbers, as the loop is unstable.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.multiaxis.VirtualAxes.three()
    >>> wanted = np.zeros((4000, 3))
    >>> wanted[500:, 0] = 1e-6
    >>> run = pt.multiaxis.track_axes(stage, wanted, pt.Pid(kp=0.005, ti=5e-4))
    >>> bool(abs(run.error[-1]).max() < 1e-9)
    True
    """
    terms, laws, matrix = _parts(stage, feedback, decoupling, level, model)
    sensors, drives = terms.direct.shape
    if isinstance(reference, str | os.PathLike):
        reference = sampled_references(reference, sensors, stage.dt)
    wanted = reference_of(reference, sensors)
    low, high = (-np.inf, np.inf) if limits is None else number_pair("limits", limits, "V")
    if isinstance(feedforward, str):
        one_of("feedforward", feedforward, FEEDFORWARDS)
        added = wanted @ matrix.T if feedforward == "static" else np.zeros((len(wanted), drives))
    else:
        added = real_array("feedforward", feedforward)
        if added.shape != (len(wanted), drives):
            raise ShapeError("feedforward", f"the shape {added.shape}", f"{len(wanted)} x {drives}")
    if noise is None:
        noise = stage.noise if isinstance(stage, VirtualAxes) else 0.0
    random = np.random.default_rng(_core.as_count("seed", seed))
    scatter = not_negative("noise", noise, "m") * random.standard_normal(wanted.shape)
    if isinstance(stage, VirtualAxes) and stage.cubic != 0.0:
        raise ParameterError("stage", f"bent by {stage.cubic:g} 1/V^2", "one without cubic")
    y, u = terms.core.track(
        [(law.kp, law.ti, law.td, law.tt) for law in laws],
        stage.dt,
        (matrix.ravel(), np.linalg.pinv(matrix).ravel()),
        [(low, high)] * drives,
        (wanted.ravel(), added.ravel(), scatter.ravel()),
    )
    margins = check_axes(stage, feedback, decoupling=decoupling, level=level, model=model)
    return MultiAxisTracking(
        reference=wanted,
        y=y.reshape(-1, sensors),
        u=u.reshape(-1, drives),
        dt=stage.dt,
        margins=margins,
        note=f"{sensors} axes, {decoupling} decoupling: {margins}",
    )


def _parts(
    stage: MultiAxisModel | VirtualAxes,
    feedback: Pid | Sequence[Pid],
    decoupling: str,
    level: float | None,
    model: MultiAxisModel | VirtualAxes | None,
) -> tuple[ModalTerms, list[Pid], Array]:
    """Return the modes, the law of each axis, and the matrix behind them."""
    for name, value in (("stage", stage), ("model", stage if model is None else model)):
        expect(name, value, (MultiAxisModel, VirtualAxes), "a MultiAxisModel or a VirtualAxes")
    terms = terms_of(stage, level)
    sensors = terms.direct.shape[0]
    laws: list[Any] = list(feedback) if has_entries(feedback) else [feedback] * sensors
    for law in laws:
        expect("feedback", law, Pid, "pt.Pid, one or one for each axis")
    if len(laws) != sensors:
        raise ShapeError("feedback", f"{len(laws)} laws", f"{sensors}, one for each sensor")
    matrix = decoupling_matrix(stage if model is None else model, decoupling, level=level)
    if matrix.shape != (terms.direct.shape[1], sensors):
        raise ShapeError(
            "model", f"{matrix.shape[0]} drives and {matrix.shape[1]} sensors",
            f"{terms.direct.shape[1]} and {sensors}, as the stage",
        )  # fmt: skip
    return terms, laws, matrix


def _closed(terms: ModalTerms, laws: list[Pid], matrix: Array, dt: float) -> Array:
    """Return the state matrix of the closed loop: modes, drives on their way, and laws."""
    modes, (sensors, drives) = terms.poles.size, terms.direct.shape
    a = np.zeros((2 * modes, 2 * modes))
    for k, pole in enumerate(terms.poles):
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[pole.real, -pole.imag], [pole.imag, pole.real]]
    b = np.empty((2 * modes, drives))
    b[0::2], b[1::2] = terms.inputs.real, terms.inputs.imag
    c = np.empty((sensors, 2 * modes))
    c[:, 0::2], c[:, 1::2] = 2.0 * terms.outputs.real.T, -2.0 * terms.outputs.imag.T
    size = 2 * modes + drives + 2 * sensors
    closed = np.zeros((size, size))
    x, u, v = slice(2 * modes), slice(2 * modes, 2 * modes + drives), 2 * modes + drives
    closed[x, x], closed[x, u] = a, b
    reading = np.zeros((sensors, size))
    reading[:, x], reading[:, u] = c, terms.direct
    wanted = np.zeros((sensors, size))
    for k, law in enumerate(laws):
        above, below = (np.asarray(one, dtype=np.float64) for one in law._linear(dt))
        # Controllable canonical form of (a0 z^2 + a1 z + a2)/(z^2 + b1 z + b2).
        through = above[0]
        rest = above[1:] - through * below[1:]
        first = v + 2 * k
        closed[first, first : first + 2] = -below[1:]
        closed[first + 1, first] = 1.0
        closed[first] -= reading[k]
        wanted[k, first : first + 2] = rest
        wanted[k] -= through * reading[k]
    closed[u] = matrix @ wanted
    return closed


def _frequencies(poles: Complex, dt: float) -> Array:
    """Return frequencies all over the band, and densely about each closed-loop pole [Hz]."""
    half = 0.5 / dt
    even = np.geomspace(1e-4 * half, half, POINTS)
    own = np.abs(np.angle(poles)) / (2.0 * np.pi * dt)
    width = np.maximum(1.0 - np.abs(poles), 1e-9) / (2.0 * np.pi * dt)
    about = own[:, np.newaxis] + width[:, np.newaxis] * np.linspace(-4.0, 4.0, NEAR)
    every = np.concatenate([even, about.ravel()])
    return np.unique(every[(every > 0.0) & (every <= half)])
