"""Names that are going away."""

from __future__ import annotations

import functools
import warnings
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["deprecated"]

Named = TypeVar("Named", bound="Callable[..., Any]")


def deprecated(instead: str, *, since: str) -> Callable[[Named], Named]:
    """Mark a public function or class that is going away: a call warns and works.

    Parameters
    ----------
    instead : str
        What to type in its place, as ``"pt.tune"``.
    since : str
        The first version that warns.

    Returns
    -------
    callable
        A decorator. A class warns where it is made itself, not where a subclass of it is.

    Examples
    --------
    >>> @deprecated("pt.identify", since="0.2.0")
    ... def fit(log): ...
    """

    def decorate(named: Named) -> Named:
        told = f"{named.__qualname__} is deprecated since {since}: type {instead}"
        if not isinstance(named, type):

            @functools.wraps(named)
            def warned(*values: Any, **named_values: Any) -> Any:
                warnings.warn(told, DeprecationWarning, stacklevel=2)
                return named(*values, **named_values)

            return warned  # type: ignore[return-value]
        build = named.__init__  # type: ignore[misc]

        @functools.wraps(build)
        def made(self: Any, *values: Any, **named_values: Any) -> None:
            if type(self) is named:
                warnings.warn(told, DeprecationWarning, stacklevel=2)
            build(self, *values, **named_values)

        named.__init__ = made  # type: ignore[misc]
        return named

    return decorate
