"""The methods of an identification: the one that the model needs is among them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ..._support.messages import quoted
from ...errors import ParameterError
from .descents import Descents
from .least_squares import LeastSquares
from .particle_swarm import ParticleSwarm

if TYPE_CHECKING:
    from ...stages.model_info import ModelInfo

    Search = Descents | ParticleSwarm
    Method = Descents | ParticleSwarm | LeastSquares

__all__ = ["MethodChoice"]

SEARCHES = {one.name: one for one in (Descents, ParticleSwarm)}
EXPECTED = "'descents', 'swarm', pt.Descents, pt.ParticleSwarm or pt.LeastSquares"
# The descent finds the bottom: swarms that only have to find the basin can be short, and those
# that only have to tell the models apart few, as descents do.
ITERATIONS, RUNS, STARTS = 40, 2, 8


@dataclass(frozen=True, kw_only=True)
class MethodChoice:
    """A method for models that are searched, and one for those that least squares find.

    Attributes
    ----------
    search : Descents or ParticleSwarm
        What searches.
    weights : LeastSquares
        Settings of the least squares.
    """

    search: Search = field(default_factory=Descents)
    weights: LeastSquares = field(default_factory=LeastSquares)

    @classmethod
    def of(cls, method: object, info: ModelInfo | None) -> MethodChoice:
        """Check the method of a caller.

        Parameters
        ----------
        method : object
            As for `identify`.
        info : ModelInfo or None
            The model; None where the one that suits the records is chosen.

        Returns
        -------
        MethodChoice
            With defaults for what is not given.

        Raises
        ------
        ParameterError
            It is no method, does not apply to the model, or names two that search.
        """
        given = method if isinstance(method, (list, tuple)) else () if method is None else (method,)
        methods: dict[str, Any] = {}
        for entry in given:
            checked = _named(entry, any_model=info is None)
            place = "weights" if isinstance(checked, LeastSquares) else "search"
            if place in methods:
                raise ParameterError(
                    "method", quoted(method), "one that searches, and one LeastSquares"
                )
            methods[place] = checked
        if (
            methods
            and info is not None
            and ("search" if info.searched else "weights") not in methods
        ):
            how = "are searched" if info.searched else "follow by least squares"
            raise ParameterError(
                "method",
                quoted(method),
                f"another one with the model '{info.name}', whose parameters {how}",
            )
        return cls(**methods)

    def method(self, info: ModelInfo) -> Method:
        """Return the one by which a model is found."""
        return self.search if info.searched else self.weights

    def of_trials(self) -> MethodChoice:
        """Return the methods of the trials of ``model="auto"``: fewer swarms, fewer descents."""
        if self.search == Descents(seed=self.search.seed):
            return replace(self, search=replace(self.search, starts=STARTS))
        if isinstance(self.search, ParticleSwarm) and self.search.runs is None:
            return replace(self, search=replace(self.search, runs=RUNS))
        return self

    def seeded(self, seed: int) -> MethodChoice:
        """Return the methods with a seed."""
        return replace(self, search=replace(self.search, seed=seed))

    def settings(self, *, seed: bool = True) -> dict[str, Any]:
        """Return the settings by the names of the methods, without those that are the default.

        Parameters
        ----------
        seed : bool, optional
            Whether the seed of the search is among them.
        """
        search = self.search if seed else replace(self.search, seed=0)
        default = MethodChoice()
        return {
            settings.name: vars(settings)
            for settings, usual in ((search, default.search), (self.weights, default.weights))
            if settings != usual
        }


def _named(method: object, *, any_model: bool) -> Method:
    """Return a method, which may be given by its name."""
    if isinstance(method, (Descents, ParticleSwarm, LeastSquares)):
        return method
    if not isinstance(method, str) or method not in SEARCHES:
        raise ParameterError("method", quoted(method), EXPECTED)
    if any_model and method == ParticleSwarm.name:
        return ParticleSwarm(iterations=ITERATIONS)
    return SEARCHES[method]()
