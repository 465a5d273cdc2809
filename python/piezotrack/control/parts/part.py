"""Base classes of the parts of a controller: their numbers for the core and for linear systems."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from itertools import chain
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from ... import _core
from .part_info import LISTED, PartInfo

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from .part_info import Number

__all__ = ["FeedbackLaw", "Part", "flat", "in_powers_of_z", "part", "part_class"]

# The classes of the parts by their names, filled by the decorator.
REGISTERED: dict[str, type[Part]] = {}
# Modules with several parts, by their role; a law has a module of its own.
MODULES = {"filter": ".filters", "repetitive": ".repetitive", "smoothing": ".repetitive"}
# Laws that share a folder.
DAMPING = ("integral-resonant", "positive-position", "positive-velocity-position")
FOLDERS = dict.fromkeys(DAMPING, "damping.")


@dataclass(frozen=True, eq=False)
class Part:
    """Base class of the parts of a controller.

    A part is a frozen dataclass with a field for each number that the core lists for it, registered
    with the decorator `part`. The core checks the numbers.
    """

    info: ClassVar[PartInfo]

    def __post_init__(self) -> None:
        _core.check_part(self.info.role, self._settings)
        for name, value in list(vars(self).items()):
            if isinstance(value, np.generic):
                # Numbers of NumPy may have single precision.
                object.__setattr__(self, name, value.item())

    @property
    def _values(self) -> Mapping[str, Any]:
        """The numbers by their names."""
        return vars(self)

    @property
    def _lengths(self) -> tuple[int, ...]:
        """Lengths of lists, which come before the numbers."""
        return ()

    @property
    def _numbers(self) -> list[float]:
        """All numbers in the order of the core."""
        values = self._values
        numbers = (flat(of, values[of.name]) for of in self.info.numbers)
        return [float(number) for number in chain(self._lengths, *numbers)]

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them."""
        return self.info.name, self._numbers


@dataclass(frozen=True, eq=False)
class FeedbackLaw(Part):
    """Base class of the feedback laws."""

    @property
    def _pid(self) -> Any:
        """The PID that the law is or has inside; None without one."""
        return getattr(self, "pid", None)

    def _linear(self, dt: float) -> tuple[Any, ...]:
        """Numerator and denominator in z, highest power first; or the matrices A, B, C and D."""
        powers = _core.law_transfer_function(self._settings, dt)
        return tuple(in_powers_of_z(one) for one in powers)


P = TypeVar("P", bound=Part)


def part(name: str) -> Callable[[type[P]], type[P]]:
    """Register the class of a part that the core lists under a name.

    Parameters
    ----------
    name : str
        Name of the part. The module of a law has the same name in `laws`, with underscores.

    Returns
    -------
    callable
        Decorator of the class.
    """

    def register(cls: type[P]) -> type[P]:
        cls.info = LISTED[name]
        REGISTERED[name] = cls
        return cls

    return register


def part_class(name: str) -> type[Part]:
    """Find the class of a part that the core lists.

    Parameters
    ----------
    name : str
        Name of the part.

    Returns
    -------
    type
        The class.
    """
    if name not in REGISTERED:
        module = f"..laws.{FOLDERS.get(name, '')}{name.replace('-', '_')}"
        import_module(MODULES.get(LISTED[name].role, module), __package__)
    return REGISTERED[name]


def flat(of: Number, value: Any) -> list[Any]:
    """Return the numbers of an entry; NaN, or none of a list, where it is left out."""
    match of.form:
        case "numbers" | "matrix":
            return [] if value is None else list(np.ravel(value))
        case "part":
            return list(value._numbers)
        case "parts":
            return [number for one in value for number in one._numbers]
        case "word":
            return [of.choices.index(value)]
        case "truth":
            return [_core.as_truth(of.name, value)]
        case "count":
            return [_core.as_count(of.name, value)]
    return [math.nan if value is None and of.is_optional else _core.as_number(of.name, value)]


def in_powers_of_z(coefficients: list[float]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Take powers of z - 1, constant term first, to powers of z, highest first.

    Parameters
    ----------
    coefficients : list of float
        Those of the powers of z - 1.

    Returns
    -------
    ndarray
        Those of the powers of z.
    """
    powers = np.polynomial.Polynomial(coefficients)(np.polynomial.Polynomial([-1.0, 1.0]))
    return np.asarray(powers.coef[::-1], dtype=np.float64)
