"""Contenders that are plain functions of arrays: of other people, and the simple ones here."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.messages import quoted
from ..errors import DataError, NumericalError, ParameterError
from .contender import Contender
from .discrete_backlash import identify_backlash, last_cycle
from .nonnegative_plays import nonnegative_plays

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from ..data.dataset import Dataset
    from .record import BenchmarkRecord

    Array = NDArray[np.float64]

__all__ = ["contender_of", "simple_contenders"]

# Arguments of a function that fits, and of one that only predicts.
FITS, PREDICTS = 3, 2


@dataclass(frozen=True)
class _Plain:
    """A function ``(u, dt) -> x`` as the benchmark sees it."""

    name: str
    function: Callable[[Array, float], Any]
    values: int | None
    inverse: Callable[[Array, float], Any] | None = None
    chosen: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)

    def predict(self, data: Dataset) -> Array:
        return self._called(self.function, data.full.u, data.dt)[data.warmup :]

    def invert(self, data: Dataset, y: Array) -> tuple[Array, Array] | None:
        if self.inverse is None:
            return None
        volts = self._called(self.inverse, y, data.dt)
        return volts, self._called(self.function, volts, data.dt)

    def _called(self, function: Callable[[Array, float], Any], values: Array, dt: float) -> Array:
        """Call a function, and refuse what is not as many finite numbers."""
        try:
            x = np.asarray(function(values.copy(), dt), dtype=np.float64)
        except Exception as error:
            # Code of others, which may raise anything.
            raise DataError(f"{self.name} failed: {type(error).__name__}: {error}") from error
        if x.shape != values.shape:
            raise DataError(
                f"{self.name} returned an array of shape {x.shape}: expected {values.shape}, "
                "as that of its argument"
            )
        if not np.isfinite(x).all():
            raise DataError(f"{self.name} returned values that are not finite numbers")
        return x


def contender_of(name: str, title: str, function: object) -> Contender:
    """Make a contender of a function.

    Parameters
    ----------
    name, title : str
        In files and in tables.
    function : callable
        ``fit(u, y, dt)``, which returns ``predict(u, dt) -> x``; or ``predict`` itself, of a model
        that needs no fit. `u` and `y` are the fitted part, `predict` gets the drive with its
        warm-up: V (or N, m), m and s. `predict` may have the attributes ``values``, the number of
        values fitted, and ``inverse(x, dt) -> u``.

    Returns
    -------
    Contender
        It takes part on every record.

    Raises
    ------
    ParameterError
        It is not a function of two or three arguments.
    """
    count = _arguments(function)
    if count not in (FITS, PREDICTS) or not callable(function):
        what = "no function" if count is None else f"a function of {count} arguments"
        raise ParameterError(
            name,
            f"{quoted(function)}, {what}",
            "fit(u, y, dt), which returns predict(u, dt), or predict(u, dt) itself",
        )
    fit = partial(_fitted, name, function) if count == FITS else partial(_given, name, function)
    return Contender(name=name, title=title, fit=fit, suits=lambda _: True)


def _arguments(function: object) -> int | None:
    """Count the arguments that a function has to be given by place; None where it is none."""
    if not callable(function):
        return None
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return None
    by_place = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(one.kind in by_place and one.default is one.empty for one in parameters)


def _fitted(name: str, fit: Callable[[Array, Array, float], Any], data: Dataset) -> _Plain:
    try:
        predict = fit(data.u.copy(), data.y.copy(), data.dt)
    except Exception as error:
        raise DataError(f"{name} failed: {type(error).__name__}: {error}") from error
    if _arguments(predict) != PREDICTS:
        raise DataError(f"{name} returned {quoted(predict)}: expected a function predict(u, dt)")
    return _given(name, predict, data)


def _given(name: str, predict: Any, _: Dataset) -> _Plain:
    values, inverse = getattr(predict, "values", None), getattr(predict, "inverse", None)
    return _Plain(
        name=name,
        function=predict,
        values=values if isinstance(values, int) else None,
        inverse=inverse if callable(inverse) else None,
    )


def simple_contenders() -> list[Contender]:
    """List what the package has to beat: fifteen lines of NumPy, and the authors' own method.

    Returns
    -------
    list of Contender
        The latter takes part on the record of its authors only, unless it is named.
    """

    def plays(data: Dataset) -> _Plain:
        try:
            predict = nonnegative_plays(data.full.u, data.full.y, data.warmup)
        except RuntimeError as error:
            raise NumericalError(f"plays-nnls: {error}") from None
        return _Plain("plays-nnls", predict, values=13)

    def of_volts(record: BenchmarkRecord) -> bool:
        return record.drive_unit == "V"

    def backlash(data: Dataset) -> _Plain:
        model = identify_backlash(*last_cycle(data.u, data.y))
        return _Plain(
            "discrete-backlash",
            lambda u, _: model.simulate(u),
            values=model.values,
            inverse=lambda y, _: model.inverse(y),
        )

    return [
        Contender(
            name="plays-nnls", title="fifteen lines: 12 plays, NNLS", fit=plays, suits=of_volts
        ),
        Contender(
            name="discrete-backlash",
            title="discrete backlash (2018)",
            fit=backlash,
            suits=lambda record: record.name == "measured",
        ),
    ]
