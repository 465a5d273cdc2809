"""Search along a line for the least cost: a grid, then a golden section about its best place."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

__all__ = ["least_on_line"]

Found = TypeVar("Found")

# Share of an interval that the golden section keeps.
KEPT = (5.0**0.5 - 1.0) / 2.0


def least_on_line(
    found: Callable[[float], Found],
    grid: Iterable[float],
    sections: int,
    cost: Callable[[Found], float],
) -> tuple[float, Found]:
    """Search the place of least cost.

    Parameters
    ----------
    found : callable
        What is found at a place.
    grid : iterable of float
        Places that are tried first, in order.
    sections : int
        Places of the golden section after its first two, Kiefer 1953,
        doi 10.1090/S0002-9939-1953-0055639-3.
    cost : callable
        Cost of what is found.

    Returns
    -------
    place : float
        The best of all places that were tried.
    found
        What is found there.

    Examples
    --------
    >>> place, _ = least_on_line(lambda x: (x - 0.3) ** 2, [0.0, 0.5, 1.0], 20, float)
    >>> print(f"{place:.3f}")
    0.300
    """

    def at(place: float) -> tuple[float, Found]:
        return place, found(place)

    tried = [at(float(place)) for place in grid]
    i = min(range(len(tried)), key=lambda i: cost(tried[i][1]))
    low, high = tried[max(i - 1, 0)][0], tried[min(i + 1, len(tried) - 1)][0]
    left, right = at(high - KEPT * (high - low)), at(low + KEPT * (high - low))
    for _ in range(sections):
        if cost(left[1]) < cost(right[1]):
            high, right = right[0], left
            left = at(high - KEPT * (high - low))
        else:
            low, left = left[0], right
            right = at(low + KEPT * (high - low))
    return min(tried[i], left, right, key=lambda one: cost(one[1]))
