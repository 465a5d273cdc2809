"""Data frames in and out."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pandas as pd
import pytest

import piezotrack as pt
from loops import STAGE, loop, sine

T = np.arange(200) * 5.0
U = 50.0 + 40.0 * np.sin(T / 100.0)
FRAME = pd.DataFrame({"t [ms]": T, "voltage_V": U, "x (um)": 0.5 * U, "note": ["a"] * 200})


def test_a_frame_is_a_record_in_si() -> None:
    log = pt.Dataset.from_frame(FRAME)
    assert np.allclose(log.t, 1e-3 * T)
    assert np.array_equal(log.u, U)
    assert np.allclose(log.y, 0.5e-6 * U)
    named = pt.Dataset.from_frame(FRAME.rename(columns={"x (um)": "a"}), displacement="a",
                                  units={"displacement": "nm"}, dt=0.01)  # fmt: skip
    assert named.dt == 0.01
    assert np.allclose(named.y, 0.5e-9 * U)


def test_a_record_and_a_run_come_out_as_frames() -> None:
    log = pt.Dataset.from_frame(FRAME)
    frame = log[0.1:0.5].to_frame()
    assert list(frame.columns) == ["time_s", "drive_V", "displacement_um"]
    assert frame["time_s"].iloc[0] == pytest.approx(0.1)
    again = pt.Dataset.from_frame(frame)
    assert np.allclose(again.y, log[0.1:0.5].y)
    run = pt.track(STAGE, loop(feedback=pt.Pid.xu_li_2010()), sine(0.5, 4.0))
    table = run.to_frame()
    assert np.allclose(table["measured_um"], 1e6 * run.measured)
    assert list(table.columns)[:4] == ["time_s", "desired_um", "measured_um", "voltage_V"]
    one = loop(feedback=pt.Pid.xu_li_2010())
    path = pt.circle(frequency=0.5, radius=5e-6)
    both = pt.contour(pt.XYStage.xu_li_2010(seed=1), (one, one), path)
    assert np.allclose(both.to_frame()["contour_error_um"], 1e6 * both.error)


@pytest.mark.parametrize(
    ("frame", "options", "kind", "message"),
    [
        (3, {}, pt.ParameterError, "frame is 'int': expected a data frame"),
        (FRAME[["t [ms]", "voltage_V"]], {}, pt.DataError, "no column is known to be the displ"),
        (FRAME, {"displacement": "note"}, pt.DataError, "'note' has no unit"),
        (
            FRAME,
            {"displacement": "note", "units": {"note": "um"}},
            pt.DataError,
            "column 'note' has entries that are no numbers",
        ),
        (FRAME, {"drive": "none"}, pt.ParameterError, "'none' is not a column"),
        (FRAME.iloc[:2], {}, pt.DataError, "u has 2 samples"),
    ],
)
def test_what_is_no_log_is_refused(
    frame: Any, options: dict[str, Any], kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        pt.Dataset.from_frame(frame, **options)


def test_without_pandas_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(pt.ParameterError, match="to_frame needs pandas"):
        pt.datasets.dbo_training().to_frame()
