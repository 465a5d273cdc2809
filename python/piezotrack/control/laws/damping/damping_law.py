"""Base class of the laws that damp a mode by a filter of the measurement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .... import _core
from ...._support.arguments import expect
from ...parts.part import FeedbackLaw, in_powers_of_z
from ..pid import Pid

__all__ = ["DampingLaw"]


@dataclass(frozen=True, kw_only=True)
class DampingLaw(FeedbackLaw):
    """Base class of the laws of a PID and a damping filter of the measurement.

    Parameters
    ----------
    pid : Pid
        The controller that tracks; ``pt.Pid(kp=0.0, ti=math.inf)`` for damping alone.
    """

    pid: Pid

    def __post_init__(self) -> None:
        expect("pid", self.pid, Pid, "pt.Pid")
        super().__post_init__()

    def _linear(self, dt: float) -> tuple[Any, ...]:
        """Matrices A, B, C and D, from error and measurement, in observer form."""
        above, below = super()._linear(dt)
        powers = _core.law_reference_numerator(self._settings, dt)
        assert powers is not None
        tracking = in_powers_of_z(powers)
        n = len(below) - 1
        both = np.column_stack([_of_length(one, n + 1) for one in (tracking, tracking - above)])
        a = np.column_stack([-below[1:], np.eye(n)[:, : n - 1]])
        b = both[1:] - np.outer(below[1:], both[0])
        return a, b, np.eye(1, n), both[:1]


def _of_length(polynomial: Any, length: int) -> Any:
    return np.concatenate([np.zeros(length - len(polynomial)), polynomial])
