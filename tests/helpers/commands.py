"""The command called inside this process, and the files that it is given."""

from __future__ import annotations

import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from click import testing

import piezotrack as pt
from piezotrack.cli.advice import as_options, command_at_work
from piezotrack.cli.commands import app
from piezotrack.cli.identify.identify import identify_command
from piezotrack.data.log_file import write_log
from records import BOX, HELD, quick

HEADER = "time_s,voltage_V,displacement_um"
PICTURES = [
    f"{name}.{ending}" for name in ("loop", "time", "convergence") for ending in ("png", "svg")
]
RESULTS = sorted(["dahl.json", *(f"dahl_{picture}" for picture in PICTURES)])
PAPER = [
    *("--model", "dahl"),
    *(part for name, value in HELD.items() for part in ("--fix", f"{name}={value}")),
    *(part for name, (low, high) in BOX.items() for part in ("--bound", f"{name}={low}:{high}")),
]
# SIGINT may be ignored where the tests are started, and a child would inherit that.
HEADING = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from piezotrack.cli import main"
)
COMMAND = [sys.executable, "-c", f"{HEADING}; main()"]


@cache
def log_text() -> str:
    path = write_log(quick(), Path("made.csv"))
    text = path.read_text(encoding="utf-8")
    path.unlink()
    return text


def run(*arguments: str) -> Any:
    """Call the command inside this process."""
    return testing.CliRunner().invoke(app, arguments)


def without_progress(errors: str) -> str:
    """What was said on stderr beside the lines of progress, which a busy machine brings about."""
    return re.sub(r"(?m)^(identify|compare|campaign|benchmark|reproduce)[:,] .*\d+ s\n", "", errors)


def as_printed(text: str) -> str:
    """A table as `identify` prints it: --runs 4 where Python says runs=4."""
    command_at_work.set(identify_command)
    return as_options(text)


def ran(*arguments: str) -> str:
    """Call the command, which has to work, and return what it printed."""
    result = run(*arguments)
    assert (result.exit_code, without_progress(result.stderr)) == (0, "")
    return str(result.stdout)


def refusal(*arguments: str) -> str:
    """Call the command, which has to refuse, and return its one sentence."""
    result = run(*arguments)
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit)
    assert result.stdout == ""
    said = without_progress(result.stderr)
    assert re.fullmatch(r"piezotrack: [^\n]+\n", said), said
    return said.removeprefix("piezotrack: ").rstrip("\n")


def write_model() -> None:
    pt.identification.IdentifiedModel(
        model=pt.DahlStage.xu_li_2010(),
        offset=1e-6,
        offset_fitted=True,
        scale_assumed=False,
        stroke=119e-6,
    ).save("dahl.json")


def names(folder: str) -> list[str]:
    return sorted(path.name for path in Path(folder).iterdir())


def write(name: str, content: str | bytes) -> None:
    Path(name).write_bytes(content.encode() if isinstance(content, str) else content)


def lines_with(number: int, *lines: str) -> str:
    """Put other lines in place of the one that an editor calls `number`."""
    text = log_text().splitlines()
    return "\n".join([*text[: number - 1], *lines, *text[number:]]) + "\n"


def column(index: int, value: str) -> str:
    """The log with a column that never changes."""
    rows = [line.split(",") for line in log_text().splitlines()[1:]]
    for row in rows:
        row[index] = value
    return "\n".join([HEADER, *(",".join(row) for row in rows)])


def table(path: str) -> Any:
    """The columns of a file that the command wrote, by their titles."""
    return np.genfromtxt(path, delimiter=",", names=True)
