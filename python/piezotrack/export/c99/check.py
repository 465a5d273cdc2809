"""The program that runs the test vectors of an export."""

from __future__ import annotations

from typing import NamedTuple

from .tree import choices_of, filled, joined

__all__ = ["FORWARD", "Loop", "check_code"]

# Choices of the tree, by where the feedforward comes from.
FORWARD = {"given": (), "table": ("FORWARD_TABLE",), "online": ("FORWARD_ONLINE",)}


class Loop(NamedTuple):
    """The loop around the stage of the vectors.

    Attributes
    ----------
    gain, fresh : float
        Rise of the stage with the drive [m/V], and share of the way that is gone in a sample.
    low, high : float
        Limits of the drive.
    """

    gain: float
    fresh: float
    low: float
    high: float


def check_code(
    forward: str, bound: float, flags: int, link: str = "", closed: Loop | None = None
) -> str:
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
    closed : Loop, optional
        Closes the loop in place of a replay of the readings.

    Returns
    -------
    str
        The program, with the names of its files open.
    """
    bounds = (
        f"#define BOUND {bound!r} /* largest difference allowed; 0: all bits are the same */\n"
        f"#define FLAGS {flags} /* flags that may differ */\n"
    )
    chosen = FORWARD[forward]
    if closed is not None:
        chosen = *chosen, "CLOSED"
        bounds += (
            f"#define STAGE_GAIN {closed.gain!r} /* of the lag, m for one unit of the drive */\n"
            f"#define STAGE_FRESH {closed.fresh!r} /* share of the way gone in a sample */\n"
            f"#define STAGE_LOW {closed.low!r} /* lowest drive that it gets */\n"
            f"#define STAGE_HIGH {closed.high!r} /* highest one */\n"
        )
    code = joined("check.c", choices_of(chosen), {"bounds.h": bounds})
    return filled(code, {"@flags": str(flags), "@link": link})
