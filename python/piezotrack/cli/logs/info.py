"""``piezotrack info``: what a log has in it."""

from __future__ import annotations

import json as json_text

from ..error_messages import report_errors
from ..options import (
    Columns,
    DisplacementColumn,
    DriveColumn,
    Interval,
    Json,
    LogFile,
    MissingOption,
    TimeColumn,
    Units,
)

__all__ = ["info_command"]


@report_errors
def info_command(
    file: LogFile,
    time: TimeColumn = None,
    drive: DriveColumn = None,
    displacement: DisplacementColumn = None,
    unit: Units = None,
    dt: Interval = None,
    missing: MissingOption = None,
    json: Json = False,
) -> None:
    """Show what is in a log and what it can tell.

    Columns, units, ranges, rate, gaps, where the drive rests and reverses, and which models such a
    record can determine.
    """
    from ..._support.files.writing import json_ready
    from ...data.checks.log_info import info
    from ..output import print_words

    columns = Columns(time, drive, displacement, unit, dt)
    report = info(
        file,
        time=columns.time,
        drive=columns.drive,
        displacement=columns.displacement,
        units=columns.units,
        dt=columns.dt,
        missing=missing,
    )
    if json:
        print(json_text.dumps(json_ready(report.document()), indent=2, allow_nan=False))
    else:
        print_words(report.summary())
