"""What all tests share: pictures without a screen, and what the fuzzers are given and tell."""

from __future__ import annotations

import os

# Each of the processes that run tests has a core: more threads would wait for each other. Before
# NumPy is imported, and for the processes that tests start.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import signal
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import pytest

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

mpl.use("Agg")

# Tests, and files of tests, that take more than a second and a half of a core.
LONG = Path(__file__).with_name("long_tests.txt")

# Lines that commands print stay whole, whatever terminal the tests are started from.
os.environ.pop("COLUMNS", None)

# A background job inherits SIGINT as ignored and passes that on to what it starts: without this the
# tests of Ctrl-C would wait for an interruption that never comes.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pictures out, which take longer than all the rest."""
    # Before its name is replaced, which the import would otherwise copy for good.
    import matplotlib.pyplot as plt

    modules = [
        import_module(f"piezotrack.{name}")
        for name in (
            "_support.files.writing",
            "control.tuning.tuned",
            "identification.comparison.compare",
            "identification.experiments.sensor_noise",
            "identification.experiments.step_response",
            "identification.views.files",
        )
    ]

    def none(figures: Mapping[str, Figure], folder: Path) -> list[Path]:
        del figures, folder
        plt.close("all")
        return []

    for module in modules:
        monkeypatch.setattr(module, "save_figures", none)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what the fuzzers in tests/soak are given."""
    group = parser.getgroup("soak", "fuzzers")
    group.addoption("--soak-seed", type=int, default=1, help="seed of all that is drawn")
    group.addoption("--soak-calls", type=int, default=20_000, help="calls of the API, all targets")
    group.addoption("--soak-files", type=int, default=4_000, help="files read, all formats")
    group.addoption("--soak-trace", default=None, help="folder for the calls under way")
    group.addoption("--soak-table", default=None, help="file for the table of tries and failures")
    group.addoption("--soak-loop", type=float, default=10.0, help="length of a loop on a device, s")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave to `make soak` what takes long, beside what is marked as slow in its file."""
    long = set(LONG.read_text(encoding="utf-8").splitlines())
    for item in items:
        if {item.nodeid, item.nodeid.partition("::")[0]} & long:
            item.add_marker(pytest.mark.slow)


def pytest_configure(config: pytest.Config) -> None:
    """Have the fuzzers write down what they are about to call."""
    if (folder := config.getoption("--soak-trace")) is not None:
        from soak import Script

        Script.trace = Path(folder)
        Script.trace.mkdir(parents=True, exist_ok=True)


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print the tries and failures of the fuzzers."""
    rows = [
        tuple(value)
        for reports in terminalreporter.stats.values()
        for report in reports
        for name, value in getattr(report, "user_properties", ())
        if name == "tally" and report.when == "call"
    ]
    if not rows:
        return
    from soak import table

    text = table(rows)
    terminalreporter.section("tries and failures")
    terminalreporter.write(text)
    if (path := config.getoption("--soak-table")) is not None:
        Path(path).write_text(text, encoding="utf-8")
