"""What all tests share: pictures are drawn without a screen, and left out where asked for."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

import matplotlib as mpl
import pytest

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.figure import Figure

mpl.use("Agg")

# A background job inherits SIGINT as ignored and passes that on to what it starts: without this the
# tests of Ctrl-C would wait for an interruption that never comes.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pictures out, which take longer than all the rest."""
    # Before its name is replaced, which the import would otherwise copy for good.
    import matplotlib.pyplot as plt

    import piezotrack.identification.report  # noqa: F401

    def none(figures: Mapping[str, Figure], folder: Path) -> list[Path]:
        del figures, folder
        plt.close("all")
        return []

    for module in ("_support.files", "identification.report"):
        monkeypatch.setattr(f"piezotrack.{module}.save_figures", none)
