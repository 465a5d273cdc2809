"""Dates in text logs."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from format_logs import T, U, Y, is_the_log, refusal

if TYPE_CHECKING:
    from pathlib import Path

# Past midnight and the end of a leap year's February.
BEGIN = datetime(2024, 2, 29, 23, 59, 59, 250_000)
FORMS = {
    "ISO": "%Y-%m-%dT%H:%M:%S.%f",
    "ISO with a blank": "%Y-%m-%d %H:%M:%S.%f",
    "ISO with a comma": "%Y-%m-%d %H:%M:%S,%f",
    "with a zone": "%Y-%m-%dT%H:%M:%S.%f+01:00",
    "in UTC": "%Y-%m-%dT%H:%M:%S.%fZ",
    "year first": "%Y/%m/%d %H:%M:%S.%f",
    "German": "%d.%m.%Y %H:%M:%S,%f",
    "German with a point": "%d.%m.%Y %H:%M:%S.%f",
}


def write(path: Path, form: str, title: str = "Time", begin: datetime = BEGIN) -> Path:
    lines = [
        f"{(begin + timedelta(seconds=round(t, 6))).strftime(form)};{u:.9f};{y:.9f}"
        for t, u, y in zip(T.tolist(), U, Y, strict=True)
    ]
    text = "\n".join([f"{title};voltage_V;displacement_um", *lines])
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("form", FORMS)
def test_a_date_is_seconds_from_the_first_sample(tmp_path: Path, form: str) -> None:
    log = pt.read(write(tmp_path / "log.csv", FORMS[form]))
    assert is_the_log(log, tolerance=1e-8)
    assert log.t[0] == 0.0


def test_decimal_commas_beside_dates(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", FORMS["German"])
    head, _, body = path.read_text(encoding="utf-8").partition("\n")
    lines = [line.split(";") for line in body.splitlines()]
    swapped = [";".join([a, b.replace(".", ","), c.replace(".", ",")]) for a, b, c in lines]
    path.write_text("\n".join([head, *swapped]), encoding="utf-8")
    assert is_the_log(pt.read(path), tolerance=1e-8)


def test_a_time_of_day_goes_up_to_midnight(tmp_path: Path) -> None:
    noon = datetime(2024, 2, 29, 12, 0, 0)
    log = pt.read(write(tmp_path / "log.csv", "%H:%M:%S.%f", begin=noon))
    assert is_the_log(log, tolerance=1e-8)
    found = refusal(write(tmp_path / "log.csv", "%H:%M:%S.%f"))
    assert found.startswith("log.csv:152: column 'Time': t goes from")


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S", "%d.%m.%y %H:%M:%S"])
def test_a_date_that_may_be_either_is_refused(tmp_path: Path, form: str) -> None:
    found = refusal(write(tmp_path / "log.csv", form, "Time (s)", datetime(2024, 3, 4)))
    assert found.startswith("log.csv:2: '")
    assert "may be day or month first: expected a date as 2024-03-12 10:00:00.5" in found


def test_a_text_among_dates_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", FORMS["ISO"])
    lines = path.read_text(encoding="utf-8").splitlines()
    for text in ("later", "2024-02-30T00:00:00", "2024-03-01T00:00:00Z"):
        broken = [*lines[:5], f"{text};1.0;2.0", *lines[6:]]
        path.write_text("\n".join(broken), encoding="utf-8")
        found = refusal(path)
        assert found.startswith(f"log.csv:6: '{text}' in column 'Time' is not a date")


def test_microseconds_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    lines = [f"2024-02-29T10:00:00.{k:06d},{k % 7},{k % 5}" for k in range(100)]
    path.write_text("\n".join(["time,voltage_V,x_um", *lines]), encoding="utf-8")
    log = pt.read(path)
    assert np.abs(log.t - 1e-6 * np.arange(100)).max() < 1e-15
