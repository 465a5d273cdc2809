"""Components of a controller: PID, state space, repetitive part, filters of the measurement."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.arguments import MOST_ENTRIES, finite, in_range, not_negative, positive
from ..._support.arrays import real_array
from ..._support.messages import quoted
from ...errors import DataError, ParameterError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Lag", "LowPass", "Notch", "Pid", "Repetitive", "StateSpace", "ZeroPhase"]


@dataclass(frozen=True, kw_only=True)
class Pid:
    r"""Incremental PID controller with back-calculation antiwindup.

    .. math::

        u_k = u_{k-1} + K_p (e_k - e_{k-1}) + \frac{K_p T_s}{T_i} e_k
        + \frac{K_p T_d}{T_s} (e_k - 2 e_{k-1} + e_{k-2}) + \frac{T_s}{T_t} (v - u)_{k-1}

    Xu and Li 2010, equations (22) to (25), doi 10.1115/1.4001712, corrected: the recursion is
    that of the feedback part only, while `v - u` is the voltage of the amplifier less the sum of
    all parts of the command.

    Parameters
    ----------
    kp : float
        Proportional gain [V/m]. `from_um` takes it in V/um.
    ti : float
        Integral time [s], above 0; infinity for no integral part.
    td : float, optional
        Derivative time [s], 0 or above.
    tt : float, optional
        Tracking time of the antiwindup [s], above half a sampling interval; ``sqrt(ti td)``
        where it is not given, and `ti` where `td` is 0.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.Pid.from_um(kp=0.120, ti=0.009, td=0.044).kp
    120000.0
    """

    kp: float
    ti: float
    td: float = 0.0
    tt: float | None = None

    def __post_init__(self) -> None:
        finite("kp", self.kp, "V/m")
        if not (_core.as_number("ti", self.ti) > 0.0):
            raise ParameterError(
                f"ti is {self.ti} s: expected a time above 0, or infinity for no integral part"
            )
        not_negative("td", self.td, "s")
        if self.tt is not None and not (_core.as_number("tt", self.tt) > 0.0):
            raise ParameterError(f"tt is {self.tt} s: expected a time above 0")

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them; NaN for the default of tt."""
        tt = math.nan if self.tt is None else self.tt
        return "pid", [float(one) for one in (self.kp, self.ti, self.td, tt)]

    @classmethod
    def from_um(cls, *, kp: float, ti: float, td: float = 0.0, tt: float | None = None) -> Pid:
        """Make a controller from a proportional gain in V/um.

        Parameters
        ----------
        kp : float
            Proportional gain [V/um].
        ti, td, tt : float
            Times [s], as in the class.

        Returns
        -------
        Pid
            The controller.
        """
        return cls(kp=1e6 * _core.as_number("kp", kp), ti=ti, td=td, tt=tt)

    @classmethod
    def xu_li_2010(cls) -> Pid:
        """Gains of Xu and Li 2010: 0.120 V/um, 0.009 s, 0.044 s, for a loop at 50 Hz.

        Returns
        -------
        Pid
            The controller.
        """
        return cls.from_um(kp=0.120, ti=0.009, td=0.044)


@dataclass(frozen=True, eq=False)
class StateSpace:
    r"""Feedback law in discrete state space, from the error [m] to a voltage [V].

    .. math:: x_{k+1} = A x_k + B e_k, \qquad u_k = C x_k + D e_k

    Parameters
    ----------
    a : array_like, shape (n, n)
        A, with n up to 16.
    b : array_like, shape (n,) or (n, 1)
        B.
    c : array_like, shape (n,) or (1, n)
        C.
    d : float or array_like of shape (1, 1), optional
        D [V/m].
    back : array_like, shape (n,), optional
        Gain l of back-calculation: the voltage of the amplifier less the command [V] enters the
        state with it. By default that of an observer of the law, with which A - l C is stable; for
        a PI law a tracking time of Ti. Zeros turn antiwindup off.

    Examples
    --------
    >>> import piezotrack as pt
    >>> integrator = pt.control.StateSpace([[1.0]], [2000.0], [1.0])

    The matrices of a system of python-control, ``StateSpace(G.A, G.B, G.C, G.D)``, are taken as
    they are.
    """

    a: ArrayLike
    b: ArrayLike
    c: ArrayLike
    d: ArrayLike = 0.0
    back: ArrayLike | None = None

    def __post_init__(self) -> None:
        _ = self._matrices

    @property
    def _matrices(self) -> tuple[list[float], list[float], list[float], float, list[float] | None]:
        """A row by row, B, C, D and the gain of back-calculation."""
        a, b, c = (_matrix(name, getattr(self, name)) for name in ("a", "b", "c"))
        n = b.size
        if n == 0:
            raise ShapeError("b has 0 entries: expected one for each state, 1 to 16")
        if a.size != n * n or c.size != n:
            raise ShapeError(
                f"a, b and c have {a.size}, {n} and {c.size} entries: expected n x n, n and n"
            )
        back = None if self.back is None else _matrix("back", self.back).tolist()
        return a.tolist(), b.tolist(), c.tolist(), finite("d", _single("d", self.d), "V/m"), back

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them."""
        a, b, c, d, back = self._matrices
        if back == []:
            raise ParameterError("back is 0 entries: expected as many entries as b")
        return "state space", [float(len(b)), *a, *b, *c, d, *(back or [])]


def _single(name: str, value: object) -> object:
    """Take a matrix of one entry as that entry, as other libraries write a gain."""
    is_array = getattr(value, "size", 0) == 1 and getattr(value, "shape", ())
    return _matrix(name, value)[0] if is_array else value  # type: ignore[arg-type]


def _matrix(name: str, value: ArrayLike) -> NDArray[np.float64]:
    try:
        entries = real_array(name, value)
    except (DataError, ShapeError):
        raise ParameterError(f"{name} is {quoted(value)}: expected an array of numbers") from None
    if entries.size > MOST_ENTRIES:
        raise ShapeError(f"{name} has {entries.size} entries: expected {MOST_ENTRIES} at most")
    if not np.isfinite(entries).all():
        raise ParameterError(f"{name} has {entries}: expected finite numbers")
    return entries.ravel()


@dataclass(frozen=True, kw_only=True)
class Lag:
    """First-order lag as the filter Q of a repetitive controller: the form of Xu and Li 2010.

    At 0.2 s it passes half of a 0.5 Hz error.

    Parameters
    ----------
    tq : float, optional
        Time constant [s].
    compensated : bool, optional
        Whether the delay line is shortened by the delay of the filter, so that the learnt signal
        is in phase.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.Repetitive(period=5.0, kq=6e5, smoothing=pt.control.Lag(tq=0.05)).smoothing.tq
    0.05
    """

    tq: float = 0.2
    compensated: bool = False

    def __post_init__(self) -> None:
        positive("tq", self.tq, "s")
        _core.as_truth("compensated", self.compensated)


@dataclass(frozen=True, kw_only=True)
class ZeroPhase:
    """Symmetric low-pass without delay as the filter Q of a repetitive controller.

    Parameters
    ----------
    order : int, optional
        Order, 1 to 4: the higher, the lower its cutoff.
    """

    order: int = 2

    def __post_init__(self) -> None:
        if not 1 <= _core.as_count("order", self.order) <= 4:
            raise ParameterError(f"order is {self.order}: expected 1 to 4")


# The filter of the paper, and the default.
LAG = Lag()


@dataclass(frozen=True, kw_only=True)
class Repetitive:
    r"""Plug-in repetitive controller: it learns the voltage that removes a periodic error.

    .. math::

        u_k = p\, u_{k-1} + (1 - p)\,(u_{k-N-1} + K_q e_{k-N-1}),
        \qquad p = e^{-T_s/T_q}, \quad N = L/T_s

    Xu and Li 2010, equations (26) to (28), doi 10.1115/1.4001712; the coefficients printed with
    (29) and (30) are unstable. `xu_li_2010` is the paper's form with corrected coefficients.

    Parameters
    ----------
    period : float
        L [s], of the reference; two samples or more, not necessarily a whole number.
    kq : float, optional
        Learning gain [V/m], above 0 and below 2e6 (2 V/um); that is necessary, not sufficient.
        `from_um` takes it in V/um.
    smoothing : Lag or ZeroPhase or None, optional
        The filter Q; None for no filter.
    lead : int, optional
        Samples by which the learnt signal is advanced, to compensate the lag of the stage.
    forgetting_factor : float, optional
        Share of the learnt signal kept from period to period, above 0, at most 1. Below 1 it stops
        the drift of uRC against uFB, which is not observable in the error.
    pause : bool, optional
        Whether learning pauses while the voltage is clipped. Where more than a quarter of a period
        is clipped, what was learnt before is repeated unchanged until that ends; where that itself
        is what clips, half of it is forgotten with each period.

    Raises
    ------
    ParameterError
        A number is out of its range, or `smoothing` is no filter.

    Examples
    --------
    >>> import piezotrack as pt
    >>> part = pt.Repetitive.from_um(period=5.0, tq=0.2, kq=1.0)
    >>> part.kq, part.smoothing, part.forgetting_factor
    (1000000.0, Lag(tq=0.2, compensated=False), 0.99)
    """

    period: float
    kq: float = 1e6
    smoothing: Lag | ZeroPhase | None = LAG
    lead: int = 0
    forgetting_factor: float = 0.99
    pause: bool = True

    def __post_init__(self) -> None:
        positive("period", self.period, "s")
        if not 0.0 < _core.as_number("kq", self.kq) < 2e6:
            raise ParameterError(
                f"kq is {self.kq:g} V/m: expected above 0 and below 2e6 V/m (2 V/um), equation (28)"
            )
        if not (self.smoothing is None or isinstance(self.smoothing, (Lag, ZeroPhase))):
            raise ParameterError(
                f"smoothing is {self.smoothing!r}: expected pt.control.Lag, pt.control.ZeroPhase "
                "or None"
            )
        if _core.as_count("lead", self.lead) >= 2**32:
            raise ParameterError(f"lead is {self.lead}: expected less than the period allows")
        if in_range("forgetting_factor", self.forgetting_factor, 1.0, "parts of 1") == 0.0:
            raise ParameterError("forgetting_factor is 0: expected above 0, at most 1")
        _core.as_truth("pause", self.pause)

    @classmethod
    def from_um(
        cls,
        *,
        period: float,
        kq: float = 1.0,
        tq: float | None = None,
        smoothing: Lag | ZeroPhase | None = LAG,
        lead: int = 0,
        forgetting_factor: float = 0.99,
        pause: bool = True,
    ) -> Repetitive:
        """Make a controller from a learning gain in V/um.

        Parameters
        ----------
        period : float
            L [s].
        kq : float, optional
            Learning gain [V/um], above 0 and below 2.
        tq : float, optional
            Time constant of the filter [s], short for ``smoothing=Lag(tq=...)``.
        smoothing : Lag or ZeroPhase or None, optional
            The filter, in place of `tq`.
        lead, forgetting_factor, pause : optional
            As in the class.

        Returns
        -------
        Repetitive
            The controller.

        Raises
        ------
        ParameterError
            A number is out of its range, or both `tq` and `smoothing` are given.

        Examples
        --------
        >>> import piezotrack as pt
        >>> pt.Repetitive.from_um(period=5.0, kq=0.6, smoothing=pt.control.ZeroPhase()).kq
        600000.0
        """
        gain = _core.as_number("kq", kq)
        if not 0.0 < gain < 2.0:
            raise ParameterError(f"kq is {kq} V/um: expected above 0 and below 2, equation (28)")
        if tq is not None:
            if smoothing is not LAG:
                raise ParameterError(
                    f"tq is {tq} s beside smoothing, which is {smoothing!r}: expected one of them"
                )
            smoothing = Lag(tq=tq)
        return cls(
            period=period,
            kq=1e6 * gain,
            smoothing=smoothing,
            lead=lead,
            forgetting_factor=forgetting_factor,
            pause=pause,
        )

    @classmethod
    def xu_li_2010(cls, period: float) -> Repetitive:
        """Form of Xu and Li 2010: Tq = 0.2 s, Kq = 1.0 V/um, nothing forgotten, never paused.

        Parameters
        ----------
        period : float
            L [s]: 5 for 0.2 Hz, 2 for 0.5 Hz.

        Returns
        -------
        Repetitive
            The controller.
        """
        return cls(period=period, forgetting_factor=1.0, pause=False)

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """Name of the smoothing and the numbers as the core takes them."""
        match self.smoothing:
            case Lag(tq=tq, compensated=compensated):
                kind, number = ("compensated lag" if compensated else "lag"), tq
            case ZeroPhase(order=order):
                kind, number = "zero phase", float(order)
            case None:
                kind, number = "none", 0.0
        last = self.forgetting_factor, self.lead, self.pause
        return kind, [float(one) for one in (self.period, self.kq, number, *last)]


@dataclass(frozen=True)
class LowPass:
    """First-order low-pass on the measurement.

    Parameters
    ----------
    cutoff : float
        Frequency at which half of the power passes [Hz].
    """

    cutoff: float

    def __post_init__(self) -> None:
        positive("cutoff", self.cutoff, "Hz")

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them."""
        return "low pass", [self.cutoff]


@dataclass(frozen=True)
class Notch:
    """Notch on the measurement.

    Parameters
    ----------
    frequency : float
        Its middle [Hz], below half the sampling rate.
    width : float, optional
        Damping ratio of its poles.
    depth : float, optional
        Gain in the middle, 0 to 1.
    """

    frequency: float
    width: float = 0.5
    depth: float = 0.0

    def __post_init__(self) -> None:
        positive("frequency", self.frequency, "Hz")
        positive("width", self.width, "parts of the frequency")
        in_range("depth", self.depth, 1.0, "parts of 1")

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them."""
        return "notch", [self.frequency, self.width, self.depth]
