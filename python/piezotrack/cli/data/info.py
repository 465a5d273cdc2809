"""``piezotrack info``: what a log has in it."""

from __future__ import annotations

from ..command import command
from ..option_groups import Columns
from ..options import LogFile
from ..output import Printing

__all__ = ["info_command"]


@command()
def info_command(file: LogFile, *, columns: Columns, printing: Printing) -> None:
    """Show the contents of a log and what it can determine.

    Columns, units, ranges, rate, gaps, rests and reversals of the drive, and the models and effects
    that can be identified from it.
    """
    from ...data.checks.log_info import info

    report = info(file, **columns.arguments, missing=columns.missing)
    printing.show(report.summary(), report.document())
