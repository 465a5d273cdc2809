"""Missing readings: refused, left out or filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

T = np.arange(2000) / 1000.0
U = 50.0 - 50.0 * np.cos(4.0 * np.pi * T)
Y = 1e-7 * U * (1.0 + 0.002 * U)
GAP = slice(700, 900)


def with_gap(missing: str | None = "drop", hold: str = "foh") -> pt.Dataset:
    u, y = U.copy(), Y.copy()
    y[GAP] = np.nan
    u[1200] = np.nan
    return pt.Dataset(u=u, y=y, t=T, missing=missing, hold=hold)  # type: ignore[arg-type]


def test_missing_readings_are_refused_with_what_to_do() -> None:
    with pytest.raises(pt.DataError, match="missing='drop'"):
        with_gap(None)
    with pytest.raises(pt.ParameterError, match="expected 'drop', 'fill' or None"):
        with_gap("interpolate")


def test_samples_stay_and_their_displacement_does_not_count() -> None:
    log = with_gap()
    assert len(log) == T.size
    assert log.left_out is not None
    assert np.flatnonzero(log.left_out).tolist() == [*range(700, 900), 1200]
    assert np.isnan(log.recorded).sum() == 201
    assert log.counted(log.y).size == T.size - 201
    # The drive is known on both sides.
    assert log.u[1200] == pytest.approx(U[1200], abs=0.01)
    assert with_gap(hold="zoh").u[1200] == U[1199]
    assert with_gap("fill").left_out is None
    assert with_gap("fill").sha256 != log.sha256


def test_infinite_readings_and_times_are_refused_all_the_same() -> None:
    y = Y.copy()
    y[3] = np.inf
    with pytest.raises(pt.DataError, match="inf at sample 3"):
        pt.Dataset(u=U, y=y, t=T, missing="fill")
    t = T.copy()
    t[3] = np.nan
    with pytest.raises(pt.DataError, match="t is nan"):
        pt.Dataset(u=U, y=Y, t=t, missing="fill")
    with pytest.raises(pt.DataError, match="expected less than half"):
        pt.Dataset(u=U, y=np.where(T < 1.5, np.nan, Y), t=T, missing="drop")


@pytest.mark.parametrize("ending", [".csv", ".npz", ".mat"])
def test_what_is_missing_is_missing_in_the_file_too(tmp_path: Path, ending: str) -> None:
    log = with_gap()
    path = log.save(tmp_path / f"log{ending}")
    with pytest.raises(pt.DataError, match="missing='drop'"):
        pt.read(path)
    again = pt.read(path, missing="drop")
    assert again.sha256 == log.sha256
    assert np.array_equal(again.y, log.y)
    assert np.array_equal(again.left_out, log.left_out)  # type: ignore[arg-type]


def test_empty_fields_are_missing_readings_and_words_are_not(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    lines = [
        f"{t!r},{u!r},{1e6 * y!r}"
        for t, u, y in zip(*(one.tolist() for one in (T, U, Y)), strict=True)
    ]
    for place, text in ((50, ""), (60, "N/A")):
        lines[place] = ",".join([*lines[place].split(",")[:2], text])
    path.write_text("\n".join(["t_s,u_V,x_um", *lines]) + "\n")
    log = pt.read(path, missing="fill")
    assert np.abs(log.y - Y).max() < 1e-9
    lines[70] = ",".join([*lines[70].split(",")[:2], "lost"])
    path.write_text("\n".join(["t_s,u_V,x_um", *lines]) + "\n")
    with pytest.raises(pt.DataError, match="'lost' in column"):
        pt.read(path, missing="fill")


def test_a_thinned_record_does_not_count_where_none_of_its_samples_did() -> None:
    less = with_gap().decimate(10)
    assert less.left_out is not None
    assert 18 <= less.left_out.sum() <= 20
    assert less.left_out[75]
    part = with_gap()[0.8:1.5]
    assert part.left_out is not None
    assert part.left_out.sum() == 101
