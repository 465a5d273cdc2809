"""Motion of a stage: its state at one instant, and its response to a sampled drive."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Self

from .. import _core
from .._support.arguments import as_numbers

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import NDArray

    from .model_info import Parameter

    Array = NDArray[np.float64]

__all__ = ["ForceState", "Named", "Response", "StageState", "numbers_of"]

# Names and numbers, as the core takes and gives them.
Named = list[tuple[str, list[float]]]


@dataclass(frozen=True, kw_only=True)
class StageState:
    """State of a stage at one instant; each model adds the memory of its hysteresis.

    Parameters
    ----------
    x : float
        Displacement [m].
    v : float
        Velocity [m/s].
    creep : tuple of float
        State q of each relaxation of the creep [m].
    """

    x: float = 0.0
    v: float = 0.0
    creep: tuple[float, ...] = ()

    @property
    def _named(self) -> Named:
        """Names and numbers of the state."""
        return [(one.name, numbers_of(one.name, getattr(self, one.name))) for one in fields(self)]

    @classmethod
    def _from(cls, named: Iterable[tuple[str, list[float]]], parts: Iterable[Parameter]) -> Self:
        lists = {part.name for part in parts if part.is_list}
        given: dict[str, Any] = {
            name: tuple(numbers) if name in lists else numbers[0] for name, numbers in named
        }
        return cls(**given)


@dataclass(frozen=True, kw_only=True)
class ForceState(StageState):
    """State of a stage whose hysteresis is a force in feedback on the displacement.

    Parameters
    ----------
    force : float
        Hysteresis force [N].
    """

    force: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Motion of a stage at the samples of its drive.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s], from 0 on.
    u : ndarray, shape (n,)
        Drive [V], or [N] for a model that is driven by a force.
    x : ndarray, shape (n,)
        Displacement [m].
    v : ndarray, shape (n,)
        Velocity [m/s]; 0 where the model has no mechanics.
    hysteresis : ndarray, shape (n,)
        Hysteresis force [N]; of plays and relays at the input their output, before creep and
        dynamics [m].
    final : StageState
        State of the model at the last sample; ``initial=final`` continues from there.
    substeps : int
        Steps of the integrator in each sampling interval.
    error_estimate : float
        Largest change of `x` from a simulation with half the steps [m]; the error of `x` is about
        a third of it with the scheme of second order, a fifteenth with that of fourth. With
        plays at the input 0 where the model is exact, and a bound of the error where its envelopes
        bend.
    unique : bool
        Whether the solution is unique. False if a `DahlStage` with `b0` other than 0 was at rest
        with b0 q2 < 0 and a force smaller than that term: another motion then satisfies the same
        drive.
    """

    t: Array
    u: Array
    x: Array
    v: Array
    hysteresis: Array
    final: Any
    substeps: int
    error_estimate: float
    unique: bool


def numbers_of(name: str, value: object) -> list[float]:
    """Return the numbers of a parameter as a list: one, none or several."""
    if value is None:
        return []
    if isinstance(value, (tuple, list)):
        return list(as_numbers(name, value))
    return [_core.as_number(name, value)]
