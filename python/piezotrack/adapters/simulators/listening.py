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
    >>> cannot_listen("nowhere", 5025, OSError("Name or service not known"))
    ParameterError("host is 'nowhere': it cannot be listened at: name or service not known")
    """
    taken = error.errno in (errno.EADDRINUSE, errno.EACCES)
    name, value = ("port", port) if taken else ("host", quoted(host))
    reason = (error.strerror or str(error)).lower()
    return ParameterError(name, value, f"an address that can be listened at: {reason}")
