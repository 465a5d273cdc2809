"""``piezotrack app``: the page in the browser."""

from __future__ import annotations

from typing import Annotated

from ..command import Option, command
from ..options import OnDevice

__all__ = ["app_command"]


@command()
def app_command(
    device: OnDevice = None,
    port: Annotated[int, Option("TCP port, 0 for any free one")] = 0,
    browser: Annotated[bool, Option("Print the address only", names=("--no-browser",))] = False,
) -> None:
    """Open the page: from a log to a controller in the browser.

    It talks to this computer alone. It ends with Ctrl-C, or when no window has been open for ten
    minutes.
    """
    import webbrowser

    from ...app.server import serve

    def ready(address: str) -> None:
        print(f"the page is at {address}", flush=True)
        if not browser:
            webbrowser.open(address)

    serve(ready, port=port, device=device)
