"""Entries of a model file on the covariance of a fit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .... import _core
from ...._support.files.json_text import object_of
from ...._support.messages import quoted
from ....errors import ParameterError
from .covariance import Covariance, NoiseShares

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["covariance_entry", "covariance_of_file"]

# Lists of a covariance with an entry for each value, as a model file has them.
LISTS = (
    "values",
    "determined",
    "independent",
    "factors",
    "widening",
    "shifts",
    "to_least_cost",
    "by_held",
)
# Those of them with two entries for each value.
PAIRS = ("shifts", "by_held")


def covariance_entry(covariance: Covariance | None) -> dict[str, Any]:
    """Entries of a model file on the covariance; none where there is none.

    Parameters
    ----------
    covariance : Covariance or None
        Of the values that were fitted.

    Returns
    -------
    dict
        Of numbers, texts, lists and dicts only, SI; of the matrix the lower triangle.
    """
    if covariance is None:
        return {}
    entry: dict[str, Any] = {
        "names": list(covariance.names),
        "matrix": [row[: i + 1].tolist() for i, row in enumerate(covariance.matrix)],
        **{name: getattr(covariance, name).tolist() for name in LISTS},
        "samples": covariance.samples,
        "orders": list(covariance.orders),
        "hidden": covariance.hidden.tolist(),
        "predicted": {"value": covariance.predicted, "unit": "m"},
    }
    if covariance.shares is not None:
        parts = covariance.shares._asdict().items()
        entry["shares"] = {name: {"value": value, "unit": "m"} for name, value in parts}
    return {"covariance": entry}


def covariance_of_file(entry: Any, known: Collection[str]) -> Covariance | None:
    """Read the covariance of a model file.

    Parameters
    ----------
    entry : Any
        What `covariance_entry` wrote; None where the file has none.
    known : collection of str
        Names of the numbers that the model has.

    Returns
    -------
    Covariance or None
        The covariance, its numbers as they were saved.

    Raises
    ------
    ParameterError
        The entry has another form, or a list another length.
    """
    if entry is None:
        return None
    found = object_of("covariance", entry)
    names = tuple(str(name) for name in found["names"])
    if strange := [name for name in names if name not in known]:
        expected = "numbers of the model, as stiffness or weights[2]"
        raise ParameterError("covariance: names", quoted(strange[0]), expected, verb="has")
    count, rows = len(names), found["matrix"]
    if not names or [len(row) for row in rows] != list(range(1, count + 1)):
        expected = f"the lower triangle of {count} rows, one for each name"
        raise ParameterError("covariance: matrix", f"{len(rows)} rows", expected, verb="has")
    matrix = np.zeros((count, count))
    for i, row in enumerate(rows):
        matrix[i, : i + 1] = matrix[: i + 1, i] = _numbers("matrix", row, (i + 1,))
    if np.diag(matrix).min() < 0.0:
        raise ParameterError("covariance: matrix", "a variance below 0", "0 or above", verb="has")
    # Older files have nothing of what was held.
    given = {"by_held": [[0.0, 0.0]] * count} | found
    lists = {
        name: _numbers(name, given[name], (count, 2) if name in PAIRS else (count,))
        for name in LISTS
    }
    shares = {
        name: _core.as_number(f"covariance: {name}", part["value"])
        for name, part in object_of("covariance: shares", found.get("shares")).items()
    }
    return Covariance(
        names=names,
        matrix=matrix,
        **{**lists, "determined": lists["determined"] != 0.0},
        samples=_core.as_count("covariance: samples", found["samples"]),
        orders=tuple(_core.as_count("covariance: orders", order) for order in found["orders"]),
        hidden=_numbers("hidden", found["hidden"] or np.empty((0, count)), (None, count)),
        predicted=_core.as_number("covariance: predicted", found["predicted"]["value"]),
        shares=NoiseShares(**shares) if shares else None,
    )


def _numbers(name: str, values: Any, shape: tuple[int | None, ...]) -> Array:
    """Take a list of numbers of a file; what is not finite is null there."""
    try:
        numbers = np.array(values, dtype=np.float64)
    except ValueError:
        numbers = np.empty(())
    if numbers.ndim != len(shape) or any(
        size not in (None, found) for size, found in zip(shape, numbers.shape, strict=True)
    ):
        sizes = " x ".join("any" if size is None else f"{size}" for size in shape)
        raise ParameterError(f"covariance: {name}", "another form", f"{sizes} numbers", verb="has")
    finite = name not in ("determined", "independent", "shifts")
    if finite and not np.isfinite(numbers).all():
        raise ParameterError(f"covariance: {name}", "null", "finite numbers", verb="has")
    return numbers
