"""``piezotrack convert``: a log in another format."""

from __future__ import annotations

from ...errors import ParameterError
from ..error_messages import report_errors
from ..option_groups import LogOptions, with_groups
from ..options import LogFile, OutFile, Overwrite, Quiet, list_files

__all__ = ["convert_command"]


@report_errors
@with_groups
def convert_command(
    file: LogFile,
    out: OutFile,
    overwrite: Overwrite = False,
    *,
    reading: LogOptions,
    quiet: Quiet = False,
) -> None:
    """Write a log of any format as CSV, NPZ, MAT or Parquet.

    In s, V and m, with the units in the titles: what is read from OUT is what is read from FILE,
    to the last bit.
    """
    from ...data.log_file import format_to_write
    from ..output import print_words

    format_to_write(out)
    if out.exists() and not overwrite:
        raise ParameterError(f"{out} exists: expected --overwrite, or another name")
    log = reading.log(file)
    written = log.save(out)
    if not quiet:
        print(f"{len(log)} samples, {log.duration:.6g} s at {1.0 / log.dt:.6g} Hz")
        for note in log.notes:
            print_words(f"note  {note}")
        list_files([written])
