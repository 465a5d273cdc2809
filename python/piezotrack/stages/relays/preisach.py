"""The Preisach stage: relays at the input."""

from __future__ import annotations

from dataclasses import dataclass

from ..base import Stage, stage
from ..motion import StageState

__all__ = ["PreisachStage", "PreisachState"]


@dataclass(frozen=True, kw_only=True)
class PreisachState(StageState):
    """State of a Preisach stage at one instant; its velocity is 0 without a mode.

    Parameters
    ----------
    u : float
        Drive [V].
    reversals : tuple of float
        What the stage remembers of its drive [V]: maxima and minima in turn that no later one has
        wiped out, each within the two before it; a rise from the lowest level comes before them.
    creep : tuple of float
        State of each relaxation of the creep [m].
    mode_x, mode_v : tuple of float
        Displacement [m] and velocity [m/s] of each mode beside the main one.
    """

    u: float
    reversals: tuple[float, ...]
    creep: tuple[float, ...] = ()
    mode_x: tuple[float, ...] = ()
    mode_v: tuple[float, ...] = ()


@stage("preisach", state=PreisachState)
@dataclass(frozen=True, kw_only=True)
class PreisachStage(Stage):
    r"""A stage with a plane of relays at its input, after Preisach and Mayergoyz.

    .. math::

        H = w_0 u + \iint \mu(a, b)\, \gamma_{ab}[u]\, da\, db, \qquad h = H(u) - H(0)

        E(v_i, v_j) = \sum_{v_j \le v_l,\ v_{k+1} \le v_i} \mu_{kl}

    Each relay :math:`\gamma_{ab}` switches from 0 to 1 where the drive rises to a and back where
    it falls to b. Levels of the drive divide the plane of a and b into cells. The mass of a square
    cell is spread evenly over it; that of a cell on the diagonal lies on the diagonal itself, where
    a = b and relays have no memory. The Everett function E is the output between two
    reversals at levels; a rise from a minimum m to u adds E(u, m), a fall from a maximum M to
    u takes off E(M, u), and between levels E is bilinear. Creep and dynamics are those of a
    `PrandtlIshlinskiiStage`.

    I. D. Mayergoyz, Physical Review Letters 56, 1518-1521, 1986, doi
    10.1103/PhysRevLett.56.1518; on piezoceramic actuators P. Ge, M. Jouaneh, Precision
    Engineering 17(3), 211-221, 1995, doi 10.1016/0141-6359(95)00002-U.

    Parameters
    ----------
    linear : float
        w0 [m/V], not 0: gain without memory, the only one outside the levels. Below 0 the
        displacement falls as the drive rises.
    levels : sequence of float
        v [V], ascending; 2 to 17.
    masses : sequence of float
        mu [m] of the cells, n (n + 1)/2 between n + 1 levels, each 0 or of the sign of `linear`:
        mu_00, mu_10, mu_11, mu_20, ..., where mu_ij has the relays that switch up between levels i
        and i + 1 and down between levels j and j + 1.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing.

    Notes
    -----
    A stage that never moved has those relays switched on for which a + b is below 0, as plays at
    rest at 0 V have it; the line a + b = 0 is drawn in steps from level to level. Where all
    levels are 0 V or above, no relay is on; the first rise of a stage then goes up the settled
    loop, unless the lowest level is as far below 0 V as the highest one is above: relays that
    switch down there stay on for ever.

    With equal distances between levels and all masses of a diagonal k = i - j equal, a drive that
    reverses at levels has the output of a play of threshold k/2 times that distance.

    Within more than 31 loops inside each other, the innermost has no width.

    The simulation is exact as that of a `PrandtlIshlinskiiStage`: an interval is split where the
    drive passes a level or wipes out a reversal. So is the inverse, which goes from corner to
    corner.

    An identification finds `linear` and the masses, on levels that divide the range of the drive:
    6 intervals, or 12 where they foretell a third of the window better that was left out; and one
    beyond it for relays that switch once, on the first way of a stage that never moved before.
    A record determines the masses of the cells whose relays its drive switches.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.PreisachStage(
    ...     linear=1e-6, levels=[0.0, 50.0, 100.0], masses=[5e-6, 10e-6, 15e-6]
    ... )
    >>> x = stage.simulate([0.0, 100.0, 50.0, 25.0], 0.01).x
    >>> print(", ".join(f"{1e6 * y:.1f} um" for y in x))
    0.0 um, 130.0 um, 65.0 um, 32.5 um
    """

    linear: float
    levels: tuple[float, ...]
    masses: tuple[float, ...]
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()
    time_constant: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None
    mode_weights: tuple[float, ...] = ()
    mode_frequencies: tuple[float, ...] = ()
    mode_damping_ratios: tuple[float, ...] = ()
