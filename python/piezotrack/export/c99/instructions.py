"""Instructions of a step on a Cortex-M with a floating-point unit for its numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ...errors import ParameterError

if TYPE_CHECKING:
    from .sources import Sources

__all__ = ["Instructions", "check_clock", "instructions_of"]

# Counted under QEMU for a Cortex-M4F with floats and an M7 with floats and doubles, gcc -O2: a step
# without parts, an operation with its loads and stores, a repetitive part; and an evaluation of the
# online inverse over some pieces of its path.
STEP, OPERATION, REPETITIVE, EVALUATION = 130, 4, 140, 1250
# Evaluations of the online inverse in a step beyond the limits, and in a report of the amplifier.
EVALUATIONS = 42


class Instructions(NamedTuple):
    """Instructions of a step.

    Attributes
    ----------
    usual : int
        Bound of a step within the limits.
    most : int
        Bound of any step; for a report of the amplifier the online inverse takes as many again.
    """

    usual: int
    most: int


def instructions_of(sources: Sources, *, repeats: bool) -> Instructions:
    """Bound the instructions of a step.

    Parameters
    ----------
    sources : Sources
        The controller in C.
    repeats : bool
        Whether it has a repetitive part.

    Returns
    -------
    Instructions
        The bounds.
    """
    usual = STEP + OPERATION * sum(sources.operations) + REPETITIVE * repeats
    online = sources.forward == "online"
    return Instructions(usual, usual + online * EVALUATIONS * EVALUATION)


def check_clock(instructions: Instructions, dt: float, clock: float, remedy: str) -> None:
    """Refuse a step that does not fit its interval, at an instruction a cycle.

    Parameters
    ----------
    instructions : Instructions
        Bounds of a step.
    dt : float
        Interval [s].
    clock : float
        Clock of the processor [Hz].
    remedy : str
        What this form accepts in place of an online inverse.

    Raises
    ------
    ParameterError
        It does not; the message has both times.

    Examples
    --------
    >>> check_clock(Instructions(200, 200), dt=1e-5, clock=168e6, remedy="")
    """
    taken = instructions.most / clock
    if taken > dt:
        online = instructions.most > instructions.usual
        raise ParameterError(
            "clock",
            f"{1e-6 * clock:g} MHz, at which {instructions.most} instructions take "
            f"{1e6 * taken:.3g} us",
            f"a step within {1e6 * dt:.3g} us{remedy * online}",
        )
