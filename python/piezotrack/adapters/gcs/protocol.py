"""Protocol of the line: commands, answers of one or more lines, errors, arrays of data."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "CONTROL_VALUE",
    "ENCODING",
    "ERRORS",
    "GENERATOR",
    "MOVING",
    "POSITION",
    "READY",
    "RECORD_POINTS",
    "RECORD_RATE",
    "RECORD_TABLES",
    "SERVO_CYCLE",
    "STOP",
    "TARGET",
    "VOLTAGE",
    "WAVE_POINTS",
    "array_answer",
    "is_last",
    "one_answer",
    "words_of",
]

ENCODING = "cp1252"
# Commands of one byte, without an end of line.
MOVING, READY, GENERATOR, STOP = "\x05", "\x07", "\x09", "\x18"
# Parameters, as SPA and SPA? take them.
SERVO_CYCLE = 0x0E000200
WAVE_POINTS = 0x13000004
RECORD_RATE, RECORD_POINTS, RECORD_TABLES = 0x16000000, 0x16000200, 0x16000300
# What a table of the data recorder records: options of DRC.
TARGET, POSITION, VOLTAGE, CONTROL_VALUE = 1, 2, 7, 14

# Codes that ERR? answers with.
ERRORS = {
    0: "no error",
    1: "parameter syntax error",
    2: "unknown command",
    3: "command too long, or command buffer overrun",
    5: "move attempted with the servo off",
    7: "position out of limits",
    8: "velocity out of limits",
    10: "controller was stopped by command",
    15: "invalid axis identifier",
    17: "parameter out of range",
    22: "axis identifier specified more than once",
    23: "illegal axis",
    24: "incorrect number of parameters",
    25: "invalid floating point number",
    26: "parameter missing",
    27: "soft limit out of range",
    34: "command not allowed for this stage",
    52: "controller detected a communication error",
    54: "unknown parameter",
    56: "password invalid",
    57: "data recorder table does not exist",
    58: "record source does not exist",
    59: "source record table out of range",
    60: "protected parameter: command level too low",
    61: "not possible while autozero is running",
    63: "initialisation still in progress",
    64: "parameter is read-only",
    66: "voltage out of limits",
    67: "not enough memory for the wave",
    70: "arrays have different lengths: ask for them separately",
    72: "not allowed while the analog target is active",
    73: "not allowed while the wave generator is active",
    75: "generator started without a wave table selected",
    76: "interface buffer overrun",
    77: "data recorder table does not hold enough data",
    78: "data recorder table is not configured",
    79: "open-loop command while the servo is on",
    89: "not allowed in the current motion mode",
    93: "not allowed while the axis is in motion",
    200: "no stage connected to the axis",
    555: "unknown controller error",
}  # fmt: skip


def words_of(code: int) -> str:
    """Return an error code with its words.

    Examples
    --------
    >>> words_of(7), words_of(-1024)
    ('error 7 (position out of limits)', 'error -1024')
    """
    return f"error {code} ({ERRORS[code]})" if code in ERRORS else f"error {code}"


def is_last(line: str) -> bool:
    """Return whether a line ends an answer: all others have a space before their end."""
    return not line.endswith(" ")


def one_answer(lines: Sequence[str]) -> str:
    r"""Write the lines of an answer.

    Examples
    --------
    >>> one_answer(["1=0.5", "2=0.7"])
    '1=0.5 \n2=0.7\n'
    """
    return " \n".join(lines) + "\n"


def array_answer(
    names: Iterable[str], columns: Sequence[NDArray[np.float64]], interval: float
) -> list[str]:
    """Write an array of data: a header with the sampling interval [s], then a line per sample."""
    titles = [f"# NAME{k}={name}" for k, name in enumerate(names)]
    header = [
        "# REM virtual controller",
        "#",
        "# VERSION=1",
        "# TYPE=1",
        "# SEPARATOR=32",
        f"# DIM={len(columns)}",
        f"# SAMPLE_TIME={interval:.9f}",
        f"# NDATA={columns[0].size}",
        "#",
        *titles,
        "#",
        "# END_HEADER",
    ]
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return [*header, *(" ".join(f"{value:.9g}" for value in row) for row in rows)]
