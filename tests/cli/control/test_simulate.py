"""`piezotrack simulate`: where the displacements count from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commands import log_text, ran, table, write_model


@pytest.mark.usefixtures("_no_pictures")
def test_zero_counts_from_the_beginning_of_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(log_text(), encoding="utf-8")
    write_model()
    ran("simulate", "dahl.json", "log.csv", "-o", "recorded")
    printed = ran("simulate", "dahl.json", "log.csv", "--zero", "-o", "zeroed")
    assert "zeroed: 1 um subtracted" in printed
    one, other = (table(f"{name}/simulated.csv") for name in ("recorded", "zeroed"))
    assert np.allclose(one["displacement_um"] - other["displacement_um"], 1.0, atol=1e-9)
