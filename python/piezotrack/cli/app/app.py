"""``piezotrack app``: the page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..command import Argument, Option, command

__all__ = ["app_command"]


@command()
def app_command(
    log: Annotated[Path | None, Argument("Log that the page begins with", "FILE")] = None,
    device: Annotated[
        str | None,
        Option("Device to record, play and learn on, as of `measure`", metavar="ADDRESS"),
    ] = None,
    port: Annotated[int, Option("TCP port, 0 for any free one")] = 0,
    browser: Annotated[bool, Option("Open the browser; default yes")] = True,
) -> None:
    """Open the page: from a log to a controller in the browser.

    It talks to this computer alone. It ends with Ctrl-C, or when no window has been open for ten
    minutes.
    """
    import webbrowser

    from ...app.server import serve

    def ready(address: str) -> None:
        print(f"the page is at {address}", flush=True)
        if browser:
            webbrowser.open(address)

    serve(ready, log=log, port=port, device=device)
