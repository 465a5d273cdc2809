"""``piezotrack info``: what a log has in it."""

from __future__ import annotations

import json as json_text

from ..error_messages import report_errors
from ..option_groups import Columns, with_groups
from ..options import Json, LogFile, MissingOption

__all__ = ["info_command"]


@report_errors
@with_groups
def info_command(
    file: LogFile,
    *,
    columns: Columns,
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

    report = info(file, **columns.arguments, missing=missing)
    if json:
        print(json_text.dumps(json_ready(report.document()), indent=2, allow_nan=False))
    else:
        print_words(report.summary())
