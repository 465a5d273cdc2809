"""The list of contenders: those of the package, simple ones, and those of other packages."""

from __future__ import annotations

import re
from functools import partial
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from .._support.messages import quoted
from ..errors import DataError, ParameterError
from .contender import Contender
from .own_models import own_contenders
from .plain_models import contender_of, simple_contenders

if TYPE_CHECKING:
    from collections.abc import Iterable
    from importlib.metadata import EntryPoint

    from ..data.dataset import Dataset
    from .contender import Fitted

__all__ = ["GROUP", "contenders_named", "listed_contenders"]

# Entry points of other packages.
GROUP = "piezotrack.models"


def listed_contenders() -> dict[str, Contender]:
    """List every contender by name, those of other packages last.

    Returns
    -------
    dict of str to Contender
        A name that is taken gets that of its package too.
    """
    contenders = {one.name: one for one in (*own_contenders(), *simple_contenders())}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: (entry.name, entry.value)):
        package = entry.dist.name if entry.dist else entry.module
        name = _plain(entry.name)
        if name in contenders:
            name = _plain(f"{package}-{entry.name}")
        contenders[name] = Contender(
            name=name,
            title=f"{entry.name} ({package})",
            fit=partial(_fit, name, entry),
            suits=lambda _: True,
        )
    return contenders


def contenders_named(names: Iterable[str] | None) -> list[Contender]:
    """Find contenders by name.

    Parameters
    ----------
    names : iterable of str or None
        The names; None for all.

    Returns
    -------
    list of Contender
        In the order of the names.

    Raises
    ------
    ParameterError
        There is no such contender.
    """
    listed = listed_contenders()
    if names is None:
        return list(listed.values())
    wanted = [names] if isinstance(names, str) else list(names)
    for name in wanted:
        if name not in listed:
            raise ParameterError(
                "models", quoted(name), f"some of {', '.join(map(repr, listed))}", verb="has"
            )
    if not wanted:
        raise ParameterError("models", "empty", "one or more")
    return [listed[name] for name in dict.fromkeys(wanted)]


def _fit(name: str, entry: EntryPoint, data: Dataset) -> Fitted:
    """Load the function of an entry point, and fit it."""
    try:
        function = entry.load()
    except Exception as error:
        # Code of others, which may raise anything.
        raise DataError(
            f"{name}: {entry.value} cannot be loaded: {type(error).__name__}: {error}"
        ) from error
    return contender_of(name, name, function).fit(data)


def _plain(name: str) -> str:
    """Turn a name into one that can be that of a file."""
    return re.sub(r"[^a-z0-9._]+", "-", name.lower()).strip("-._")[:80] or "model"
