"""Feedback laws by H-infinity design with mixed sensitivities; needs python-control and slycot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .... import _core
from ...._support.arguments import not_negative, number_pair, positive
from ...._support.arrays import check_dt
from ....errors import NumericalError, ParameterError
from ....identification.fitted.identified_model import IdentifiedModel
from ...controller.controller import Controller
from ...laws.state_space import StateSpace
from ...plant import linearised_plants, plant_of
from .systems import sampled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...plant import Plant

    Array = NDArray[np.float64]
    Matrices = tuple[Array, Array, Array, Array]

__all__ = ["MixedSensitivity", "mixed_sensitivity"]

# States of a `StateSpace` at most.
MOST_STATES = 16
# Sensitivity at frequency 0 that is asked for: an integrator, but for what no run shows.
STATIC = 1e-4
# Gamma from which the law is nothing like what was asked for.
FAR_ABOVE = 1.5
# Gamma over the least: a law at the least has poles beyond all frequencies.
SUBOPTIMAL = 1.1
# Methods of sb10ad: bisection for the least gamma, and the law of a given one.
BISECTION, GIVEN = 1, 4
# Gamma from which the bisection begins, and the share to which it is found.
HIGHEST, TOLERANCE = 1e3, 1e-3
# Corner of the weight of the effort over the bandwidth, and its rise.
CORNER, RISE = 2.0, 10.0
# The largest sensitivity that is reached, over that which is proven, but for rounding.
ROUNDED = 1.05


@dataclass(frozen=True, eq=False)
class MixedSensitivity(StateSpace):
    r"""Feedback law in state space that `mixed_sensitivity` has designed.

    Parameters
    ----------
    a, b, c, d, back : optional
        As of `StateSpace`.
    gamma : float, optional
        Largest ratio of what was reached to what was asked for, over all frequencies: at 1 or
        below all of it is kept.
    bandwidth : float, optional
        Frequency of the design [Hz] up to which the sensitivity is below 1.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.control.MixedSensitivity([[1.0]], [2000.0], [1.0], gamma=0.9, bandwidth=10.0).gamma
    0.9
    """

    gamma: float = math.nan
    bandwidth: float = math.nan


def mixed_sensitivity(
    stage: Plant | IdentifiedModel,
    *,
    dt: float,
    bandwidth: float,
    limits: tuple[float, float] | None = None,
    largest_sensitivity: float = 2.0,
    effort: float = 10.0,
    roll_off: float | None = None,
    delay: float = 0.0,
) -> MixedSensitivity:
    r"""Design a feedback law by H-infinity with mixed sensitivities.

    .. math::

        \min_K \left\| \begin{matrix} W_1 S \\ W_2 K S \\ W_3 T \end{matrix} \right\|_\infty,
        \quad W_1 = \frac{s / M + \omega_b}{s + 10^{-4} \omega_b},
        \quad W_2 = \frac{|P(0)|}{m} \frac{1 + s / 2\omega_b}{1 + s / 20\omega_b},
        \quad W_3 = \frac{s}{\omega_r} \frac{1}{1 + s / (100 \omega_r)}

    with the bandwidth, the largest sensitivity M, the effort m and the frequency of the roll-off:
    Skogestad and Postlethwaite, Multivariable Feedback Control, 2nd edition, 2005, sections 2.8
    and 9.3. The weight of the effort rises with frequency, and the law has a gamma 10 % above the
    least, as the law of the least one has a pole near -1: both keep noise from the voltage.

    The stage is linearised at its middle gain and sampled exactly, with hold and delay, and the
    design is made in the plane of the bilinear transform, in which that is a continuous system.

    Parameters
    ----------
    stage : Stage, VirtualStage or IdentifiedModel
        The plant.
    dt : float
        Sampling interval [s].
    bandwidth : float
        Frequency [Hz] up to which the sensitivity is to be below 1, less than a quarter of the
        sampling rate.
    limits : (float, float), optional
        Voltages [V] between which the stage is linearised; of an identified model by default the
        range of the drive of its record.
    largest_sensitivity : float, optional
        M, the largest amplification of a disturbance, above 1.
    effort : float, optional
        m, the largest gain from the reference, or from noise, to the voltage, in parts of
        ``1 / |P(0)|``, below twice the bandwidth; a tenth of that far above.
    roll_off : float, optional
        Frequency [Hz] from which the complementary sensitivity falls; default no W3.
    delay : float, optional
        Time from a reading to the effect of its voltage [s], besides the stage's own.

    Returns
    -------
    MixedSensitivity
        A `StateSpace` of 16 states at most for ``Controller(feedback=...)``, with its gamma.

    Raises
    ------
    ParameterError
        A number is out of its range, python-control or slycot is not installed, or gamma is above
        1.5: what is asked for cannot be had together.
    NumericalError
        The design fails, or a law of 16 states is not good enough: with many samples of delay.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.xu_li_2010()
    >>> law = pt.control.mixed_sensitivity(stage, dt=1e-3, limits=(0.0, 75.0), bandwidth=10.0)
    >>> loop = pt.Controller(dt=1e-3, limits=(0.0, 75.0), feedback=law)
    >>> pt.check_loop(stage, loop).everywhere
    True
    """
    interval = check_dt(dt)
    rate = 1.0 / interval
    wanted = positive("bandwidth", bandwidth, "Hz")
    if wanted >= 0.25 * rate:
        raise ParameterError(
            "bandwidth",
            f"{wanted:g} Hz",
            f"below {0.25 * rate:g} Hz, a quarter of the sampling rate",
        )
    peak = positive("largest_sensitivity", largest_sensitivity, "parts of 1")
    if peak <= 1.0:
        raise ParameterError("largest_sensitivity", f"{peak:g}", "above 1")
    most = positive("effort", effort, "parts of 1")
    fall = None if roll_off is None else positive("roll_off", roll_off, "Hz")
    if fall is not None and not wanted < fall < 0.5 * rate:
        raise ParameterError(
            "roll_off", f"{fall:g} Hz", f"above the bandwidth and below {0.5 * rate:g} Hz"
        )
    if limits is None and isinstance(stage, IdentifiedModel):
        limits = stage.drive_range
    if limits is None:
        raise ParameterError("limits", "missing", "(low, high) in V", verb="are")
    pair = number_pair("limits", limits, "V")
    linear = linearised_plants(plant_of(stage), pair, not_negative("delay", delay, "s"))[1]
    gain = linear.static_gain
    # Frequencies in the plane of the bilinear transform (z - 1)/(z + 1).
    edge = math.tan(math.pi * wanted * interval)
    end = None if fall is None else math.tan(math.pi * fall * interval)
    made, gamma = _designed(_bilinear(_plant(linear, gain, interval)), edge, peak, most, end)
    if not gamma <= FAR_ABOVE:
        raise ParameterError(
            "bandwidth",
            f"{wanted:g} Hz, with which gamma is {gamma:.3g}",
            f"1 or little more, with a lower bandwidth, a largest_sensitivity above {peak:g} or "
            f"an effort above {most:g}",
        )
    a, b, c, d = _back(made)
    law = MixedSensitivity(a, b.ravel() / gain, c.ravel(), d[0, 0] / gain, None, gamma, wanted)
    loop = Controller(dt=interval, limits=pair, feedback=law)
    found = _core.check_loop(loop._core, linear)
    reached = found["sensitivity"] if found["stable"] else math.inf
    # What is proven of the whole law need not hold of one that was reduced.
    if not reached <= ROUNDED * max(gamma, 1.0) * peak:
        raise NumericalError(
            f"the law of {b.size} states has a largest sensitivity of {reached:.3g}, not "
            f"{peak:g}: expected less delay than {linear.matrices()[4] / interval:.3g} samples, as "
            "with a longer dt"
        )
    return law


def _plant(linear: _core.LoopPlant, gain: float, dt: float) -> Matrices:
    """Sample a plant, divided by its static gain."""
    rows, b, c, d, late = linear.matrices()
    a = np.array(rows, dtype=np.float64).reshape(len(b), len(b))
    states = sampled(a, np.array(b), np.array(c) / gain, d / gain, late, dt)
    ad, bd, cd, dd = (np.atleast_2d(np.asarray(part, dtype=np.float64)) for part in states)
    return ad, bd, cd, dd


def _designed(
    plant: Matrices, edge: float, peak: float, effort: float, end: float | None
) -> tuple[Matrices, float]:
    """Return the law in the bilinear plane, of 16 states at most, and gamma."""
    control, design = _toolbox()
    a, b, c, d = _weighted(plant, edge, peak, effort, end)
    sizes = (len(a), b.shape[1], len(c), 1, 1)
    try:
        best = design(*sizes, HIGHEST, a, b, c, d, job=BISECTION, gtol=TOLERANCE)[0]
        gamma, *made = design(*sizes, SUBOPTIMAL * best, a, b, c, d, job=GIVEN)[:5]
        law = control.ss(*made)
        if law.nstates > MOST_STATES:
            law = control.balred(law, MOST_STATES, method="truncate")
    except (ValueError, ArithmeticError, np.linalg.LinAlgError, control.ControlSlycot) as error:
        raise NumericalError(f"the H-infinity design fails: {error}") from None
    a, b, c, d = (np.asarray(part, dtype=np.float64) for part in (law.A, law.B, law.C, law.D))
    return (a, b, c, d), float(gamma)


def _weighted(
    plant: Matrices, edge: float, peak: float, effort: float, end: float | None
) -> Matrices:
    """Return the plant with its weights: from reference and voltage to their outputs and the error.

    Skogestad and Postlethwaite 2005, equation (9.60).
    """
    a, b, c, d = plant
    n, more = len(a), 2 if end is None else 3
    through = d[0, 0]
    states, inputs = np.zeros((n + more, n + more)), np.zeros((n + more, 2))
    shown, direct = np.zeros((more + 1, n + more)), np.zeros((more + 1, 2))
    states[:n, :n], inputs[:n, 1] = a, b.ravel()
    # The error, reference less displacement, enters W1 and is what the law is given.
    slow = STATIC * edge
    states[n, :n], states[n, n], inputs[n] = -c, -slow, (1.0, -through)
    shown[0, :n], shown[0, n], direct[0] = -c / peak, edge - slow / peak, inputs[n] / peak
    shown[-1, :n], direct[-1] = -c, inputs[n]
    # The voltage enters W2, which rises tenfold from its corner on.
    corner = CORNER * edge
    states[n + 1, n + 1], inputs[n + 1, 1] = -RISE * corner, RISE * corner
    shown[1, n + 1], direct[1, 1] = (1.0 - RISE) / effort, RISE / effort
    if end is not None:
        pole = 100.0 * end
        states[n + 2, :n], states[n + 2, n + 2], inputs[n + 2, 1] = c, -pole, through
        shown[2, :n], shown[2, n + 2], direct[2, 1] = 100.0 * c, -100.0 * pole, 100.0 * through
    return states, inputs, shown, direct


def _toolbox() -> tuple[Any, Any]:
    try:
        import control
        import slycot
    except ImportError as error:
        raise ParameterError(
            f"mixed_sensitivity needs {error.name}: expected the extra, pip install "
            "'piezotrack[robust]'"
        ) from None
    return control, slycot.sb10ad


def _bilinear(states: Matrices) -> Matrices:
    """Return a discrete system as a continuous one, by s = (z - 1)/(z + 1)."""
    a, b, c, d = states
    identity = np.eye(len(a))
    inverse = np.linalg.inv(a + identity)
    # Glover 1984, section 2: the factors share the root of 2.
    root = math.sqrt(2.0)
    return (a - identity) @ inverse, root * inverse @ b, root * c @ inverse, d - c @ inverse @ b


def _back(states: Matrices) -> Matrices:
    """Return a continuous system as the discrete one that it came from: z = (1 + s)/(1 - s)."""
    a, b, c, d = states
    identity = np.eye(len(a))
    inverse = np.linalg.inv(identity - a)
    root = math.sqrt(2.0)
    return (identity + a) @ inverse, root * inverse @ b, root * c @ inverse, d + c @ inverse @ b
