"""The Prandtl-Ishlinskii stage: play operators at the input, simulated by the Rust core."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Literal

import numpy as np

from .. import _core
from .._support.arguments import as_numbers
from ..errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..data.dataset import Hold
    from .inverse import Inverse

    Array = NDArray[np.float64]

__all__ = ["PlaysResponse", "PlaysState", "PrandtlIshlinskiiStage"]

# Name, symbol and unit of each parameter; the first of them are vectors.
PARAMETERS = (
    ("linear", "w0", "m/V"),
    ("thresholds", "r", "V"),
    ("weights", "w", "m/V"),
    ("corners", "d", "m"),
    ("bends", "s", ""),
    ("creep_shares", "c", ""),
    ("creep_times", "tau", "s"),
    ("time_constant", "T", "s"),
    ("frequency", "fn", "Hz"),
    ("damping_ratio", "zeta", ""),
)
VECTORS = ("thresholds", "weights", "corners", "bends", "creep_shares", "creep_times")


@dataclass(frozen=True, kw_only=True)
class PlaysState:
    """Where a Prandtl-Ishlinskii stage is and what it remembers, at one instant.

    Parameters
    ----------
    u : float
        Drive [V].
    plays : tuple of float
        Where each play stands [V].
    creep : tuple of float
        What each relaxation of the creep has reached [m].
    x : float
        Displacement [m].
    v : float
        Velocity [m/s]; 0 where the stage has no mode.
    """

    u: float
    plays: tuple[float, ...]
    creep: tuple[float, ...] = ()
    x: float = 0.0
    v: float = 0.0

    @property
    def values(self) -> tuple[float, tuple[float, ...], tuple[float, ...], float, float]:
        """The values in their order."""
        return self.u, self.plays, self.creep, self.x, self.v


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaysResponse:
    """Motion of a Prandtl-Ishlinskii stage at the samples of its drive.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s], from 0 on.
    u : ndarray, shape (n,)
        Drive [V].
    x : ndarray, shape (n,)
        Displacement [m].
    hysteresis : ndarray, shape (n,)
        What comes out of the hysteresis, before creep and dynamics [m].
    final : PlaysState
        State at the last sample; ``initial=final`` carries on from there.
    """

    t: Array
    u: Array
    x: Array
    hysteresis: Array
    final: PlaysState


@dataclass(frozen=True, kw_only=True)
class PrandtlIshlinskiiStage:
    r"""A stage with play operators at its input, after Kuhnen 2003.

    .. math::

        p = w_0 u + \sum_i w_i z_i, \qquad z_i = \max(u - r_i, \min(u + r_i, z_i))

        h = S(p) - S(0), \qquad S(p) = p + \sum_j s_j \max(p - d_j, 0)

        d = h + \sum_k c_k q_k, \qquad \tau_k \dot q_k = h - q_k

    and the displacement follows `d` at once, with a first-order lag
    :math:`T \dot x + x = d`, or through a mode
    :math:`\ddot x + 2 \zeta \omega_n \dot x + \omega_n^2 x = \omega_n^2 d`.

    K. Kuhnen, European Journal of Control 9(4), 407-418, 2003, doi 10.3166/ejc.9.407-418.

    Parameters
    ----------
    linear : float
        w0 [m/V], above 0: what passes without memory, the slope just after a reversal.
    thresholds : sequence of float
        r [V], half the width of each play's backlash, 0 or above and ascending; 32 at most.
    weights : sequence of float
        w [m/V], as many, 0 or above.
    corners : sequence of float, optional
        d [m], where each one-sided dead zone ends, ascending; 8 at most.
    bends : sequence of float, optional
        s, by how much the slope changes there; sums stay above -1. Plays alone give loops that
        look the same when turned by half a turn, dead zones make them asymmetric.
    creep_shares : sequence of float, optional
        c, what each relaxation of the creep adds in the end, 0 or above; 8 at most.
    creep_times : sequence of float, optional
        tau [s]. A decade apart and with equal shares they make a creep that grows with the
        logarithm of time.
    time_constant : float, optional
        T [s] of a first-order lag.
    frequency, damping_ratio : float, optional
        Undamped frequency [Hz] and damping ratio zeta of a mode; not with `time_constant`.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing.

    Notes
    -----
    The hysteresis is exact from sample to sample. Creep and dynamics are exact for an `h` that
    goes straight from one sample to the next.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
    ... )
    >>> x = stage.simulate([0.0, 50.0, 0.0], 0.01).x
    >>> print(", ".join(f"{1e6 * y:.0f} um" for y in x))
    0 um, 61 um, 4 um
    """

    linear: float
    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    corners: tuple[float, ...] = ()
    bends: tuple[float, ...] = ()
    creep_shares: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()
    time_constant: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in VECTORS:
                object.__setattr__(self, field.name, as_numbers(field.name, value))
            elif value is not None or field.name == "linear":
                object.__setattr__(self, field.name, _core.as_number(field.name, value))
        if (self.frequency is None) != (self.damping_ratio is None):
            raise ParameterError(
                f"frequency is {self.frequency} and damping_ratio {self.damping_ratio}: expected "
                "both or neither"
            )
        if self.frequency is not None and self.time_constant is not None:
            raise ParameterError(
                f"time_constant is {self.time_constant} s: expected None beside a frequency"
            )
        _ = self.core

    @property
    def core(self) -> _core.Plays:
        """The stage as the core has it."""
        mode = (
            None
            if self.frequency is None or self.damping_ratio is None
            else (self.frequency, self.damping_ratio)
        )
        return _core.Plays(
            linear=self.linear,
            thresholds=self.thresholds,
            weights=self.weights,
            corners=self.corners,
            bends=self.bends,
            creep_shares=self.creep_shares,
            creep_times=self.creep_times,
            time_constant=self.time_constant,
            mode=mode,
        )

    def inverse(
        self,
        *,
        playback: Literal["table", "online"] = "table",
        settle: int = 1,
        initial: PlaysState | None = None,
    ) -> Inverse:
        """Feedforward of the bare stage: the inverse of each part in turn.

        Dynamics are undone with the derivatives of the reference, creep by its exact inverse
        from sample to sample, dead zones and plays in Kuhnen's closed form.

        Parameters
        ----------
        playback : {"table", "online"}, optional
            Whether one settled period is played again and again, or all is computed.
        settle : int, optional
            Periods before the one of the table.
        initial : PlaysState, optional
            What the stage remembers before the reference begins, such as the `final` of a
            response to the drive that settled it; at rest where it is not given.

        Returns
        -------
        Inverse
            For `Controller` or on its own.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> stage = pt.PrandtlIshlinskiiStage(
        ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
        ... )
        >>> reference = pt.sine(frequency=1.0, low=0.0, high=50e-6, duration=3.0)
        >>> volts = stage.inverse().voltage(reference, 1e-3)
        >>> error = stage.simulate(volts, 1e-3).x - reference.sample(1e-3).x
        >>> bool(np.abs(error).max() < 1e-15)
        True
        """
        from .inverse import Inverse

        return Inverse(
            stage=self,
            playback=playback,
            settle=settle,
            initial=initial,
        )

    def simulate(
        self,
        u: ArrayLike,
        dt: float,
        *,
        hold: Hold = "foh",
        initial: PlaysState | None = None,
    ) -> PlaysResponse:
        """Displacement under a sampled drive.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V]. It jumps from where `initial` has it to its first sample.
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            Between two samples the drive goes straight from one to the next (``"foh"``), or
            stays where it is until the next (``"zoh"``). A sample under ``"zoh"`` shows the
            stage before the step of the drive at that instant has any effect.
        initial : PlaysState, optional
            State at the first sample; at rest at 0 V where it is not given. To carry on, begin
            the new drive with the last sample of the one before.

        Returns
        -------
        PlaysResponse
            Motion at the n samples.

        Raises
        ------
        ParameterError
            `dt` is not above 0, or `hold` is unknown.
        ShapeError, DataError
            `u` is not one-dimensional, is empty, or holds NaN or infinity; `initial` is of a
            stage with another number of plays or relaxations.

        Examples
        --------
        >>> import piezotrack as pt
        >>> stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[5.0], weights=[0.5e-6])
        >>> u = [0.0, 20.0, 8.0, 15.0, 0.0]
        >>> whole = stage.simulate(u, 0.02)
        >>> first = stage.simulate(u[:3], 0.02)
        >>> second = stage.simulate(u[2:], 0.02, initial=first.final)
        >>> bool(second.x[-1] == whole.x[-1])
        True
        """
        if initial is not None and not isinstance(initial, PlaysState):
            raise ParameterError(
                f"initial is {type(initial).__name__}: expected the final of a response of this "
                "kind of stage"
            )
        dt = _core.as_number("dt", dt)
        run = self.core.simulate(u, dt, hold, None if initial is None else initial.values)
        drive, plays, creep, x, v = run.last
        return PlaysResponse(
            t=np.arange(run.x.size, dtype=np.float64) * dt,
            u=np.array(u, dtype=np.float64),
            x=run.x,
            hysteresis=run.hysteresis,
            final=PlaysState(u=drive, plays=tuple(plays), creep=tuple(creep), x=x, v=v),
        )
