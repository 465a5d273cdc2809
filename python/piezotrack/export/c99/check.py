"""The program that runs the test vectors of an export."""

from __future__ import annotations

from .tree import choices_of, joined

__all__ = ["check_code"]

FORWARD = {"given": (), "table": ("FORWARD_TABLE",), "online": ("FORWARD_ONLINE",)}


def check_code(forward: str, bound: float, flags: int, link: str = "") -> str:
    """Write the program.

    Parameters
    ----------
    forward : {"given", "table", "online"}
        Where the feedforward comes from.
    bound : float
        Largest difference that is accepted, in the unit of the drive.
    flags : int
        Flags that may differ.
    link : str, optional
        What the compiler is told besides, after a space.

    Returns
    -------
    str
        The program, with the names of its files open.
    """
    bounds = (
        f"#define BOUND {bound!r} /* largest difference allowed; 0: all bits are the same */\n"
        f"#define FLAGS {flags} /* flags that may differ */\n"
    )
    code = joined("check.c", choices_of(FORWARD[forward]), {"bounds.h": bounds})
    return code.replace("@flags", str(flags)).replace("@link", link)
