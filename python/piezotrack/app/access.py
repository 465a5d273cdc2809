"""Who may reach the page: hosts, origins, the token, and the headers of every answer."""

from __future__ import annotations

import secrets
from hmac import compare_digest
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["HEADERS", "Access"]

# Nothing is loaded from elsewhere, and no script stands in the page.
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
}
# Bytes of a token.
LENGTH = 32


class Access:
    """Rules for the requests to one port of this computer.

    Parameters
    ----------
    port : int
        The port that is listened to.

    Attributes
    ----------
    token : str
        Secret of 256 bits, without which a window gets nothing but the empty page.
    """

    def __init__(self, port: int) -> None:
        self.token = secrets.token_urlsafe(LENGTH)
        self.hosts = frozenset({f"127.0.0.1:{port}", f"localhost:{port}"})
        self.origins = frozenset(f"http://{host}" for host in self.hosts)

    def host_allowed(self, headers: Mapping[str, str]) -> bool:
        """Whether the Host of a request is this server: another name may be a rebound one."""
        return headers.get("Host", "") in self.hosts

    def origin_allowed(self, headers: Mapping[str, str]) -> bool:
        """Whether the Origin of a request is this page, of the same name as the Host."""
        return headers.get("Origin", "") == f"http://{headers.get('Host', '')}" in self.origins

    def token_allowed(self, given: object) -> bool:
        """Whether a text is the token, in a time that does not depend on it."""
        if not isinstance(given, str):
            return False
        # A lone surrogate, which JSON may have, is no text that can be encoded.
        return compare_digest(given.encode("utf-8", "surrogatepass"), self.token.encode())
