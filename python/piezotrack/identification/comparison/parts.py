"""The parts of records that a comparison fits and tests."""

from __future__ import annotations

import numpy as np

from ...data.dataset import Dataset
from ...errors import ParameterError

__all__ = ["parts_of"]

Window = tuple[float | None, float | None]


def parts_of(log: Dataset, train: object, test: object) -> tuple[Dataset, Dataset, bool]:
    """Return the parts to fit and to test, and whether both are of the same record.

    Parameters
    ----------
    log : Dataset
        The record.
    train, test : object
        Arguments of `compare`.

    Returns
    -------
    train, test : Dataset
        The parts.
    carried : bool
        Whether both are of the same record.

    Raises
    ------
    ParameterError
        As of `compare`.
    """
    first = _bounds("train", train)
    if isinstance(test, Dataset):
        fitted = _windowed("train", log, first)
        _check_apart(fitted, test)
        return fitted, test, False
    second = _bounds("test", test)
    if train is None and test is None:
        middle = float(log.t[len(log) // 2])
        first, second = (None, middle), (middle, None)
    elif train is None:
        if second[0] is None:
            raise ParameterError(
                "test",
                "the record, which leaves nothing to fit",
                "a later beginning, or train=",
                verb="begins with",
            )
        first = (None, second[0])
    elif test is None:
        if first[1] is None:
            raise ParameterError(
                "train",
                "to the end of the record, which leaves nothing to validate on",
                "an end, or test=",
                verb="goes",
            )
        second = (first[1], None)
    if train is None:
        # What is given is refused before what follows from it.
        _windowed("test", log, second)
    fitted, two = _windowed("train", log, first), _windowed("test", log, second)
    _check_apart(fitted, two)
    return fitted, two, True


def _check_apart(train: Dataset, test: Dataset) -> None:
    """Refuse two windows that share a part of one record."""
    begin, end = max(train.t[0], test.t[0]), min(train.t[-1], test.t[-1])
    shared = [(part.t >= begin) & (part.t <= end) for part in (train, test)]
    if not shared[0].any() or not np.array_equal(train.y[shared[0]], test.y[shared[1]]):
        return
    raise ParameterError(
        "test",
        f"from {test.t[0]:.6g} to {test.t[-1]:.6g} s and train from {train.t[0]:.6g} to "
        f"{train.t[-1]:.6g} s",
        "windows that do not overlap",
        verb="goes",
    )


def _bounds(name: str, window: object) -> Window:
    """Check that a window has two ends, which may be open; the log checks their values."""
    if window is None:
        return None, None
    ends = list(window) if isinstance(window, (tuple, list)) else []
    if len(ends) != 2:
        what = f"{window!r}" if isinstance(window, (tuple, list, str)) else type(window).__name__
        other = " or a Dataset" if name == "test" else ""
        raise ParameterError(name, what, f"(start, stop) in seconds{other}")
    return ends[0], ends[1]


def _windowed(name: str, log: Dataset, window: Window) -> Dataset:
    try:
        return log if window == (None, None) else log[window[0] : window[1]]
    except ParameterError as error:
        raise error.of(name, argument=name) from None
