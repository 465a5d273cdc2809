"""Feedback law in discrete state space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.arguments import MOST_ENTRIES, finite
from ..._support.arrays import real_array
from ..._support.messages import quoted
from ...errors import DataError, ParameterError, ShapeError
from ..parts.part import FeedbackLaw, part

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

__all__ = ["StateSpace"]


@part("state-space")
@dataclass(frozen=True, eq=False)
class StateSpace(FeedbackLaw):
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
            raise ShapeError("b", "0 entries", "one for each state, 1 to 16")
        if a.size != n * n or c.size != n:
            raise ShapeError(
                "a, b and c", f"{a.size}, {n} and {c.size} entries", "n x n, n and n", verb="have"
            )
        back = None if self.back is None else _matrix("back", self.back).tolist()
        return a.tolist(), b.tolist(), c.tolist(), finite("d", _single("d", self.d), "V/m"), back

    @property
    def _values(self) -> Mapping[str, Any]:
        # As the core takes them: arrays of other libraries are not kept.
        a, b, c, d, back = self._matrices
        if back == []:
            raise ParameterError("back", "0 entries", "as many entries as b")
        return {"a": np.reshape(a, (len(b), -1)).tolist(), "b": b, "c": c, "d": d, "back": back}

    @property
    def _lengths(self) -> tuple[int, ...]:
        return (len(self._matrices[1]),)

    def _linear(self, dt: float) -> tuple[Any, ...]:  # noqa: ARG002 - it is sampled
        values = self._values
        return (
            values["a"],
            np.reshape(values["b"], (-1, 1)),
            np.reshape(values["c"], (1, -1)),
            [[values["d"]]],
        )


def _single(name: str, value: object) -> object:
    """Take a matrix of one entry as that entry, as other libraries write a gain."""
    is_array = getattr(value, "size", 0) == 1 and getattr(value, "shape", ())
    return _matrix(name, value)[0] if is_array else value  # type: ignore[arg-type]


def _matrix(name: str, value: ArrayLike) -> NDArray[np.float64]:
    try:
        entries = real_array(name, value)
    except (DataError, ShapeError):
        raise ParameterError(name, quoted(value), "an array of numbers") from None
    if entries.size > MOST_ENTRIES:
        raise ShapeError(name, f"{entries.size} entries", f"{MOST_ENTRIES} at most")
    if not np.isfinite(entries).all():
        raise ParameterError(name, entries, "finite numbers", verb="has")
    return entries.ravel()
