"""Settings of the particle swarm."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from ... import _core
from ..._core import SwarmSettings

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["ParticleSwarm"]


@dataclass(frozen=True, kw_only=True)
class ParticleSwarm:
    r"""Settings of the particle swarm.

    .. math::

        V_i \leftarrow w V_i + c_1 r_1 (P_i - X_i) + c_2 r_2 (P_g - X_i), \qquad
        X_i \leftarrow X_i + V_i

    Xu and Li 2010, equations (17) and (18), doi 10.1115/1.4001712. r1 and r2 are drawn anew for
    each particle and coordinate. The hypersphere update takes the centre of gravity of the
    particle, a point beyond its own best position and one beyond that of its best informant, draws
    a point uniformly from the hypersphere about it whose surface holds the particle, and does not
    depend on the orientation of the coordinates:

    .. math::

        G_i &= \tfrac{1}{3} \bigl(X_i + (X_i + c_1 (P_i - X_i)) + (X_i + c_2 (P_g - X_i))\bigr)

        X'_i &\sim \mathcal{U}\bigl(\mathcal{H}(G_i, |G_i - X_i|)\bigr), \qquad
        V_i \leftarrow w V_i + X'_i - X_i, \qquad X_i \leftarrow X_i + V_i

    Clerc 2012, hal-00764996. A particle that is its own best informant has G half-way between X
    and the point beyond P. The default is a ring of 64 particles with the constriction of Clerc
    and Kennedy 2002, doi 10.1109/4235.985692: it takes more evaluations than the global topology,
    but ends more reliably in the same local minimum, whatever the seed.

    Where `identify` is given no history, the swarm runs once, as of a stage that never moved before
    the record. Another history is searched by descents from the best candidate of the swarm and a
    few random places, and is taken where the cost falls by 2 % below the minimum next to that
    candidate. The result then keeps the runs and the history of costs of the swarm.

    Parameters
    ----------
    particles : int, optional
        Number of particles, 2 or more.
    iterations : int, optional
        Largest number of iterations after the first evaluation.
    update : {"classic", "hypersphere", "hypersphere-radial"}, optional
        How a particle moves. ``"hypersphere-radial"`` draws the radius of X' about G from a
        uniform distribution: points are denser near G, and a swarm converges sooner.
    inertia_start, inertia_end : float, optional
        Inertia w at the first iteration, and from `inertia_iterations` on.
    inertia_iterations : int, optional
        Iterations over which w goes linearly from one to the other.
    cognitive, social : float, optional
        c1 and c2.
    topology : {"ring", "global", "random"}, optional
        P_g is the best position of a particle and its two neighbours, or of all particles, or of
        the particle and those that inform it: each informs three, drawn anew after every
        iteration that did not improve the swarm's best.
    velocity_limit : float, optional
        Largest velocity of a coordinate as a fraction of its range; ``inf`` for none.
    boundary : {"absorb", "rebound", "reflect", "invisible"}, optional
        A particle that leaves the box stops at the bound with velocity 0 (``"absorb"``) or with
        half its velocity reversed (``"rebound"``), is reflected at the bound (``"reflect"``), or
        moves on outside without being evaluated (``"invisible"``).
    min_improvement : float, optional
        Improvement of the best cost [m] below which an iteration counts as a stall.
    stall_iterations : int, optional
        Consecutive stalled iterations after which the search stops.
    polish : bool, optional
        Whether the best candidate is then refined to the local minimum, by the method of
        Levenberg and Marquardt: Marquardt 1963, doi 10.1137/0111030.
    seed : int, optional
        0 or above. The same seed gives the same bits, for any number of threads.
    runs : int, optional
        Number of independent swarms, each with its own random numbers: 4 where not given, and 2 in
        the trials of ``model="auto"``. Different final costs show that there are several local
        minima. Swarms are simulated side by side in the processor's SIMD lanes. Up to a million
        particles in all of them.

    Raises
    ------
    ParameterError
        A setting has a value that cannot be used.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.ParticleSwarm.xu_li_2010().particles
    10
    """

    particles: int = 64
    iterations: int = 200
    update: Literal["classic", "hypersphere", "hypersphere-radial"] = "classic"
    inertia_start: float = 0.7298
    inertia_end: float = 0.7298
    inertia_iterations: int = 1
    cognitive: float = 1.49618
    social: float = 1.49618
    topology: Literal["ring", "global", "random"] = "ring"
    velocity_limit: float = 0.5
    boundary: Literal["absorb", "rebound", "reflect", "invisible"] = "absorb"
    min_improvement: float = 1e-12
    stall_iterations: int = 50
    polish: bool = True
    seed: int = 0
    runs: int | None = None

    name: ClassVar[str] = "swarm"

    def __post_init__(self) -> None:
        # NumPy's numbers become Python's: they are compared, printed and written to JSON.
        for field in fields(self):
            value = CHECKS[field.name](field.name, getattr(self, field.name))
            object.__setattr__(self, field.name, value)
        # The core checks the ranges.
        _ = self._core

    @classmethod
    def xu_li_2010(cls, *, seed: int = 0, runs: int | None = None) -> ParticleSwarm:
        """Return the settings of section 3.3 of Xu and Li 2010, doi 10.1115/1.4001712.

        10 particles, w from 0.9 to 0.4 over 500 iterations, c1 = c2 = 2, at most 2000
        iterations, stopped after 500 in a row that improve the best cost by less than 1e-6.
        The paper gives that number without a unit; in metres it would stop every search after
        500 iterations, so it is taken as micrometres. It says nothing of a velocity limit or
        of what happens at the bounds: a tenth of the range, and absorbing walls, are ours. A
        single swarm with these settings does not always reach the minimum of the paper's search.

        Parameters
        ----------
        seed, runs : int, optional
            As of the class.

        Returns
        -------
        ParticleSwarm
            The paper's settings.
        """
        return cls(**_core.SwarmSettings.xu_li_2010(), seed=seed, runs=runs)

    @classmethod
    def spso_2011(cls, *, seed: int = 0, runs: int | None = None) -> ParticleSwarm:
        """Return the settings of Standard Particle Swarm Optimisation 2011.

        Clerc 2012, hal-00764996; Zambrano-Bigiarini, Clerc and Rojas 2013, doi
        10.1109/CEC.2013.6557848. 40 particles that move by the hypersphere, w = 1/(2 ln 2),
        c1 = c2 = 1/2 + ln 2, three informed at random, half the velocity turned back at a bound.
        The standard leaves the end of a search to its user: at most 1000 iterations, stopped
        after 200 in a row that improve the best cost by less than 1e-6 um, are ours. It has no
        descent; ``dataclasses.replace(swarm, polish=True)`` adds one. Points are drawn evenly in
        the hypersphere's volume; the programs released with the standard draw the radius evenly,
        which is ``update="hypersphere-radial"``.

        Parameters
        ----------
        seed, runs : int, optional
            As of the class.

        Returns
        -------
        ParticleSwarm
            The standard's settings.

        Examples
        --------
        >>> import piezotrack as pt
        >>> pt.ParticleSwarm.spso_2011().update
        'hypersphere'
        """
        return cls(**_core.SwarmSettings.spso_2011(), seed=seed, runs=runs)

    @property
    def _core(self) -> SwarmSettings:
        """The settings in the core."""
        return SwarmSettings(**self.settings())

    def settings(self) -> dict[str, Any]:
        """Return the settings of one swarm, without `seed` and `runs`."""
        return {name: value for name, value in vars(self).items() if name not in ("seed", "runs")}


def _text(_name: str, value: object) -> str:
    # Anything but a string is refused by the core, as an unknown option.
    return value if isinstance(value, str) else repr(value)


def _count_if_given(name: str, value: object) -> int | None:
    return None if value is None else _core.as_count(name, value)


CHECKS: dict[str, Callable[[str, object], Any]] = {
    "particles": _core.as_count,
    "iterations": _core.as_count,
    "update": _text,
    "inertia_start": _core.as_number,
    "inertia_end": _core.as_number,
    "inertia_iterations": _core.as_count,
    "cognitive": _core.as_number,
    "social": _core.as_number,
    "topology": _text,
    "velocity_limit": _core.as_number,
    "boundary": _text,
    "min_improvement": _core.as_number,
    "stall_iterations": _core.as_count,
    "polish": _core.as_truth,
    "seed": _core.as_count,
    "runs": _count_if_given,
}
