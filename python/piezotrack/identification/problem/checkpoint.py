"""The file from which an interrupted search goes on."""

from __future__ import annotations

import os
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ... import _core
from ..._support.messages import quoted
from ...errors import ParameterError
from .fingerprint import exact_text, hash_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..methods.choice import MethodChoice
    from .problem import Problem

__all__ = ["checkpoint_of"]


@contextmanager
def checkpoint_of(
    path: object, problem: Problem, methods: MethodChoice
) -> Iterator[_core.Checkpoint | None]:
    """Open the checkpoint of an identification, and write what is left of it at the end.

    Parameters
    ----------
    path : path-like or None
        The file; None for no checkpoint.
    problem : Problem
        The problem.
    methods : MethodChoice
        How it is solved.

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
        raise ParameterError("checkpoint", quoted(path), "the name of a file")
    # All that the result depends on.
    content = [*problem.content(), methods.settings(), _core.__version__]
    identity = hash_of(exact_text(content))
    checkpoint = _core.Checkpoint(os.fspath(path), identity)
    try:
        yield checkpoint
    except BaseException:
        checkpoint.save()
        raise
    if failure := checkpoint.save():
        # The result is there, and is not lost for it.
        warnings.warn(failure, RuntimeWarning, stacklevel=4)
