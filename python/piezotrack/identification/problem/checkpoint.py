"""The file from which an interrupted search goes on."""

from __future__ import annotations

import os
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.messages import quoted
from ...errors import ParameterError
from ..experiments.step_response import StepResult
from .fingerprint import exact, key_of, plain, record_key

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from .records import Asked

__all__ = ["checkpoint_of"]

# Arguments on which the result does not depend.
BESIDE = ("threads", "progress", "callback", "checkpoint")


@contextmanager
def checkpoint_of(
    path: object, records: Sequence[Asked], arguments: Mapping[str, object]
) -> Iterator[_core.Checkpoint | None]:
    """Open the checkpoint of an identification, and write what is left of it at the end.

    Parameters
    ----------
    path : path-like or None
        The file; None for no checkpoint.
    records : sequence of Asked
        The records, each with what is asked of it alone.
    arguments : mapping
        All other arguments of `identify`.

    Yields
    ------
    _core.Checkpoint or None
        What the search keeps its simulations in.

    Raises
    ------
    ParameterError
        `path` is no path.
    DataError
        The file is no checkpoint, or that of another search, or cannot be written.
    """
    if path is None:
        yield None
        return
    if not isinstance(path, (str, os.PathLike)) or not os.fspath(path):
        raise ParameterError(f"checkpoint is {quoted(path)}: expected the name of a file")
    checkpoint = _core.Checkpoint(os.fspath(path), _identity(records, arguments))
    try:
        yield checkpoint
    except BaseException:
        checkpoint.save()
        raise
    if failure := checkpoint.save():
        # The result is there, and is not lost for it.
        warnings.warn(failure, RuntimeWarning, stacklevel=4)


def _identity(records: Sequence[Asked], arguments: Mapping[str, object]) -> str:
    """Hash of all that the result depends on."""
    asked = [
        {
            "record": record_key(one.data),
            "offset": one.offset,
            "history": one.history,
            "delay": plain("delay", one.delay),
            "drift": plain("drift", one.drift),
            "weight": one.weight,
        }
        for one in records
    ]
    given: dict[str, Any] = {
        name: dict(value.hysteresis) if isinstance(value, StepResult) else value
        for name, value in arguments.items()
        if name not in BESIDE
    }
    said = {name: plain(name, value) for name, value in given.items() if value is not None}
    return key_of([exact(asked), exact(said), _core.__version__])
