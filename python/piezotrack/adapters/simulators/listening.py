"""Ports that servers of this room listen at."""

from __future__ import annotations

import errno

from ... import _core
from ..._support.messages import quoted
from ...errors import ParameterError

__all__ = ["cannot_listen", "checked_port"]


def checked_port(port: int) -> int:
    """Return a TCP port; ParameterError where it is none.

    Examples
    --------
    >>> checked_port(5025)
    5025
    """
    port = _core.as_count("port", port)
    if port > 65535:
        raise ParameterError("port", port, "0 to 65535")
    return port


def cannot_listen(host: str, port: int, error: OSError) -> ParameterError:
    """Return the refusal of an address that cannot be listened at.

    Examples
    --------
    >>> print(cannot_listen("::2", 5025, OSError("No such host")))
    host is '::2': expected an address that can be listened at: no such host
    """
    taken = error.errno in (errno.EADDRINUSE, errno.EACCES)
    name, value = ("port", port) if taken else ("host", quoted(host))
    reason = (error.strerror or str(error)).lower()
    return ParameterError(name, value, f"an address that can be listened at: {reason}")
