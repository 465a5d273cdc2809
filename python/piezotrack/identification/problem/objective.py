"""The cost that an identification minimises, for optimisers of the caller's."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Self

import numpy as np

from ... import _core
from ...errors import ParameterError
from ...stages.registry import model_named
from .problem import Problem
from .records import records_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...data.dataset import Dataset
    from ..fitted.start import History
    from .parameter import ParameterEntry
    from .records import Delay, Drift, Record

    Array = NDArray[np.float64]

__all__ = ["Objective"]


class Objective:
    """The RMS deviation of a model from a record, over the unit box of its free parameters.

    What `identify` minimises, equation (16) of Xu and Li 2010, doi 10.1115/1.4001712, for
    optimisers of your own: many candidates are simulated side by side, in the processor's SIMD
    lanes and on all cores.

    Parameters
    ----------
    data : Dataset or Record
        The record.
    model : str
        Name of a model that is searched, as for `identify`.
    parameters, constraints, creep, offset, delay, drift : optional
        As for `identify`.
    history : {"virgin", "settled", "fit"}, optional
        What the stage went through before the record; nothing where it is not given.
    threads : int, optional
        Up to 256; all cores where it is 0 or not given.

    Raises
    ------
    ParameterError, DataError
        As for `identify`.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()[3.0:5.0]
    >>> cost = pt.identification.Objective(log, "dahl")
    >>> len(cost.ranges), cost(np.full((3, len(cost.ranges)), 0.5)).shape
    (5, (3,))
    """

    def __init__(
        self,
        data: Dataset | Record,
        model: str,
        *,
        parameters: Mapping[str, ParameterEntry] | None = None,
        constraints: Iterable[str] | None = None,
        creep: bool | Iterable[float] | None = None,
        offset: bool = True,
        delay: Delay = None,
        drift: Drift = None,
        history: History | None = None,
        threads: int | None = None,
    ) -> None:
        records = records_of(data, offset=offset, delay=delay, drift=drift, history=history)
        if not model_named(model).searched:
            raise ParameterError("model", f"{model!r}", "one that is searched")
        self._enter(
            Problem.checked(model, records, parameters, constraints, creep),
            0 if threads is None else _core.as_count("threads", threads),
        )

    @classmethod
    def _of(cls, problem: Problem, threads: int = 0) -> Self:
        """Return the cost that the solution of a problem minimises.

        Parameters
        ----------
        problem : Problem
            A model that is searched, and one record.
        threads : int, optional
            All cores where it is 0.

        Returns
        -------
        Objective
            The cost.
        """
        objective = cls.__new__(cls)
        objective._enter(problem, threads)
        return objective

    def _enter(self, problem: Problem, threads: int) -> None:
        problem.check_data()
        self._core = _core.Objective(problem, threads)
        self._scalars = [one.name for one in problem.info.parameters if not one.is_list]

    @property
    def coordinates(self) -> list[tuple[str, float, float, str]]:
        """Name, bounds in SI and scale, ``"linear"`` or ``"log"``, of each coordinate."""
        return list(self._core.coordinates)

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Bounds of the free parameters, SI: 0 and 1 in the unit box, a coordinate each."""
        return {name: (low, high) for name, low, high, _ in self._core.coordinates}

    def __call__(self, places: ArrayLike) -> Array:
        """Return the costs at places of the unit box.

        Parameters
        ----------
        places : array_like, shape (n, d) or (d,)
            Coordinates from 0 to 1, in the order of `ranges`.

        Returns
        -------
        ndarray, shape (n,)
            Costs [m], of one place too; infinite where the simulation diverged.

        Raises
        ------
        ParameterError
            A place has another number of coordinates, or is outside of the box.
        """
        return np.array(self._core.costs(_rows(places)))

    def descend(self, places: ArrayLike) -> tuple[Array, Array, NDArray[np.int64]]:
        """Descend from places of the unit box, as `Descents` does.

        Parameters
        ----------
        places : array_like, shape (n, d) or (d,)
            Where the descents start.

        Returns
        -------
        places : ndarray, shape (n, d)
            Where they end.
        costs : ndarray, shape (n,)
            Costs there [m].
        nfev : ndarray, shape (n,)
            Simulations of each.

        Raises
        ------
        ParameterError
            As for a call.
        """
        descents = self._core.descend(_rows(places))
        return (
            np.array([place for place, _, _ in descents]),
            np.array([cost for _, cost, _ in descents]),
            np.array([nfev for _, _, nfev in descents]),
        )

    def _place(self, values: Mapping[str, float]) -> list[float]:
        """Return the place of values of the free parameters, SI; in the middle where none is given.

        It is the nearest one in the unit box.
        """
        return [
            _coordinate(values[name], low, high, scale) if name in values else 0.5
            for name, low, high, scale in self.coordinates
        ]

    def parameters(self, place: ArrayLike) -> dict[str, float]:
        """Return the parameters of the stage at a place of the unit box, SI.

        Parameters
        ----------
        place : array_like, shape (d,)
            Coordinates from 0 to 1.

        Returns
        -------
        dict of str to float
            All parameters of the model, those that are held too.

        Raises
        ------
        ParameterError
            As for a call.
        """
        (row,) = _rows(place)
        return dict(zip(self._scalars, self._core.parameters(row), strict=False))


def _coordinate(value: float, low: float, high: float, scale: str) -> float:
    """Return the coordinate of a value in the unit box, the nearest to one outside."""
    if scale == "log" and value > 0.0:
        low, high, value = math.log(low), math.log(high), math.log(value)
    return min(max((value - low) / (high - low), 0.0), 1.0)


def _rows(places: ArrayLike) -> list[list[float]]:
    """Return places as rows of numbers."""
    rows = np.atleast_2d(np.asarray(places, dtype=np.float64))
    if rows.ndim > 2:
        raise ParameterError(
            "places",
            f"{rows.ndim} dimensions",
            "one row of coordinates for each place",
            verb="have",
        )
    listed: list[list[float]] = rows.tolist()
    return listed
