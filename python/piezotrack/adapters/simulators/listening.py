"""Ports that simulators of this room listen at."""

from __future__ import annotations

import errno
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Self

from ... import _core
from ..._support.messages import quoted
from ...errors import ParameterError
from .serving import Server

if TYPE_CHECKING:
    import socket
    from types import TracebackType

__all__ = ["Listening", "cannot_listen", "checked_port"]


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


class Listening(ABC):
    """A simulator that listens within a ``with`` block, and converses with each client.

    Parameters
    ----------
    host : str
        Address to listen at.
    port : int
        TCP port; 0 for any that is free.
    """

    def __init__(self, host: str, port: int) -> None:
        self._place = host, checked_port(port)
        self._server: Server | None = None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        if self._server is None:
            return self._place
        host, port = self._server.server_address[:2]
        return str(host), port

    def __enter__(self) -> Self:
        """Listen, in the background."""
        try:
            self._server = Server(self._place, self._converse)
        except OSError as error:
            raise cannot_listen(*self._place, error) from None
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End all connections."""
        if self._server is not None:
            self._server.end()
            self._server = None

    @abstractmethod
    def _converse(self, link: socket.socket) -> None:
        """Answer one client until it goes."""
