"""Repetitive control and the filters that it may have."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

from ... import _core
from ...errors import ParameterError
from .part import Part, flat, part

__all__ = ["Lag", "Repetitive", "ZeroPhase"]


@part("lag")
@dataclass(frozen=True, kw_only=True)
class Lag(Part):
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


@part("zero-phase")
@dataclass(frozen=True, kw_only=True)
class ZeroPhase(Part):
    """Symmetric low-pass without delay as the filter Q of a repetitive controller.

    Parameters
    ----------
    order : int, optional
        Order, 1 to 4: the higher, the lower its cutoff.
    """

    order: int = 2


# The filter of the paper, and the default.
LAG = Lag()


@part("repetitive")
@dataclass(frozen=True, kw_only=True)
class Repetitive(Part):
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
        if tq is not None:
            if smoothing is not LAG:
                raise ParameterError(
                    "tq", f"{tq} s beside smoothing, which is {smoothing!r}", "one of them"
                )
            smoothing = Lag(tq=tq)
        return cls(
            period=period,
            kq=1e6 * _core.as_number("kq", kq),
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
                kind, number = ("compensated-lag" if compensated else "lag"), tq
            case ZeroPhase(order=order):
                kind, number = "zero-phase", float(order)
            case None:
                kind, number = "none", 0.0
            case other:
                expected = "pt.control.Lag, pt.control.ZeroPhase or None"
                raise ParameterError("smoothing", f"{other!r}", expected)
        period, kq, lead, forgetting_factor, pause = chain.from_iterable(
            flat(of, getattr(self, of.name)) for of in self.info.numbers if of.form != "part"
        )
        return kind, [period, kq, number, forgetting_factor, float(lead), float(pause)]
