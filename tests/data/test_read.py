import codecs
import math
import re
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from folders import MEASURED

needs_measured = pytest.mark.skipif(
    not MEASURED.is_dir(), reason=f"the measured logs are not in {MEASURED}"
)

HEADER = "time_s,voltage_V,displacement_um"
LINES = ("0.0,1.25,10.5", "0.1,2.5,11.5", "0.2,3.75,12.25", "0.3,5.0,13.0")
TEXT = "\n".join((HEADER, *LINES)) + "\n"
T, U, Y = [0.0, 0.1, 0.2, 0.3], [1.25, 2.5, 3.75, 5.0], [10.5e-6, 11.5e-6, 12.25e-6, 13e-6]


def write(folder: Path, content: str | bytes, name: str = "stage.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def with_line(number: int, line: str) -> str:
    """Put `line` in place of the line that an editor calls `number`."""
    lines = [HEADER, *LINES]
    lines[number - 1] = line
    return "\n".join(lines) + "\n"


def is_the_log(log: pt.Dataset) -> bool:
    same = (
        np.allclose(log.t, T, rtol=1e-15, atol=0.0),
        np.allclose(log.u, U, rtol=1e-15, atol=0.0),
        np.allclose(log.y, Y, rtol=1e-15, atol=0.0),
    )
    return all(same) and math.isclose(log.dt, 0.1)


SEMICOLONS = TEXT.replace(",", ";").replace(".", ",")
TABS = TEXT.replace(",", "\t")
BLANKS = "\n".join(f"  {line.replace(',', '   ')} " for line in TEXT.splitlines())
MICRO = "Time (s),Voltage [V],x (\N{MICRO SIGN}m)\n" + "\n".join(LINES)

GOOD: dict[str, str | bytes] = {
    "plain": TEXT,
    "no newline at the end": TEXT.rstrip(),
    "CRLF": TEXT.replace("\n", "\r\n"),
    "old Mac": TEXT.replace("\n", "\r"),
    "comments and blank lines": "# stage 7\n\n% 2024-01-01, warm\n \n" + TEXT.replace("\n", "\n\n"),
    "brackets": TEXT.replace(HEADER, "Time (s),Voltage [V],x (um)"),
    "slashes": TEXT.replace(HEADER, "t/s, u/V, displacement/um"),
    "capitals": TEXT.replace(HEADER, HEADER.upper()),
    "quoted names": TEXT.replace(HEADER, '"Time (s)", "Voltage [V]", "x (um)"'),
    "quoted numbers": re.sub(r"([^,\n]+)", r'"\1"', TEXT),
    "other units": "time_ms,voltage_mV,y_nm\n" + "0,1250,10500\n100,2500,11500\n"
    "200,3750,12250\n300,5000,13000\n",
    "semicolons and decimal commas": SEMICOLONS,
    "semicolons and decimal points": TEXT.replace(",", ";"),
    "tabs": TABS,
    "tabs and decimal commas": TABS.replace(".", ","),
    "tabs and units in brackets": TABS.replace(TABS.split("\n")[0], "Time, s\tu (V)\tx [um]"),
    "blanks": BLANKS,
    "blanks and decimal commas": BLANKS.replace(".", ","),
    "blanks and units in brackets": BLANKS.replace("time_s ", "Time (s) "),
    "blanks and quoted names": BLANKS.replace("time_s ", '"Time (s)" '),
    "BOM": codecs.BOM_UTF8 + TEXT.encode(),
    "UTF-8 micro sign": MICRO,
    "UTF-16": codecs.BOM_UTF16_LE + MICRO.encode("utf-16-le"),
    "UTF-16 the other way": codecs.BOM_UTF16_BE + MICRO.encode("utf-16-be"),
    "Latin-1 micro sign": MICRO.encode("latin-1"),
    "a delimiter at the end of each sample": TEXT.replace("\n", ",\n").replace("um,\n", "um\n"),
    "a delimiter at the end of each line": TEXT.replace("\n", ",\n"),
    "exponents": TEXT.replace("1.25", "125E-2").replace("10.5", "+1.05e+1"),
    "v as a voltage": TEXT.replace("voltage_V", "v (V)"),
    "velocity beside": "v," + TEXT.replace("\n", "\n7,").removesuffix("7,"),
    "a name that a unit decides": TEXT.replace("time_s,voltage_V", "t_s,u (V)").replace(
        "displacement_um", "y_um"
    ),
}


@pytest.mark.parametrize("name", GOOD)
def test_reads_the_usual_forms(tmp_path: Path, name: str) -> None:
    log = pt.read(write(tmp_path, GOOD[name]))
    assert is_the_log(log)
    assert (log.source, log.hold, log.drive_unit, log.warmup) == ("stage.csv", "foh", "V", 0)


def test_reads_by_text_path_and_keeps_the_hold(tmp_path: Path) -> None:
    assert pt.read(str(write(tmp_path, TEXT)), hold="zoh").hold == "zoh"


def test_reads_a_file_without_header_by_number(tmp_path: Path) -> None:
    path = write(tmp_path, "\n".join(LINES))
    numbers: dict[str, Any] = {"time": 0, "drive": 1, "displacement": np.int64(2)}
    assert is_the_log(pt.read(path, **numbers, units={0: "s", 1: "V", 2: "um"}))
    roles: dict[str | int, str] = {"time": "s", "drive": "V", "displacement": "um"}
    log = pt.read(path, **numbers, units=roles)
    assert is_the_log(log)
    assert dict(log.columns) == {}


def test_reads_named_columns(tmp_path: Path) -> None:
    text = TEXT.replace(HEADER, "clock,amp out (mV),Pos")
    units: dict[str | int, str] = {"clock": "s", "drive": "V", "pos": "um"}
    log = pt.read(
        write(tmp_path, text), time="clock", drive="amp out", displacement="Pos", units=units
    )
    assert is_the_log(log)


def test_a_column_may_be_named_with_or_without_its_unit(tmp_path: Path) -> None:
    lines = [f"{line},99" for line in LINES]
    path = write(tmp_path, "\n".join((f"{HEADER},sensor_um", *lines)))
    for name in ("displacement_um", "displacement", "DISPLACEMENT", 2):
        log = pt.read(path, displacement=name)
        assert is_the_log(log)
        assert log.columns["sensor"].tolist() == pytest.approx([99e-6] * 4)


def test_further_columns_are_kept(tmp_path: Path) -> None:
    header = f"{HEADER},reference_um,reference_V,temperature (K),state,,gain"
    tails = ("10,1,293.1,ok,,2", "11,2,,ok,,2", "12,3,nan,halt,,2", "13,4,293.4,ok,,2")
    lines = [f"{line},{tail}" for line, tail in zip(LINES, tails, strict=True)]
    log = pt.read(write(tmp_path, "\n".join((header, *lines))))
    assert is_the_log(log)
    assert dict(log.column_units) == {
        "reference_um": "m",
        "reference_V": "V",
        "temperature": "K",
        "state": "",
        "column 7": "",
        "gain": "",
    }
    assert log.columns["reference_um"].tolist() == [1e-5, 1.1e-5, 1.2e-5, 1.3e-5]
    assert np.isnan(log.columns["temperature"]).tolist() == [False, True, True, False]
    assert np.isnan(log.columns["state"]).all()


def test_dates_beside_decimal_commas_do_not_matter(tmp_path: Path) -> None:
    lines = [f"12.03.2024;{line.replace(',', ';').replace('.', ',')}" for line in LINES]
    log = pt.read(write(tmp_path, "\n".join(("Datum;" + HEADER.replace(",", ";"), *lines))))
    assert is_the_log(log)


def test_dt_takes_the_place_of_the_time_column(tmp_path: Path) -> None:
    coarse = TEXT.replace("0.1,", "0.0,").replace("time_s", "time")
    log = pt.read(write(tmp_path, coarse), dt=0.1)
    assert is_the_log(log)
    assert dict(log.columns) == {}
    assert is_the_log(pt.read(write(tmp_path, coarse.replace("0.3", "late")), dt=0.1))
    no_time = "\n".join(line.partition(",")[2] for line in TEXT.splitlines())
    assert is_the_log(pt.read(write(tmp_path, no_time), dt=0.1))


def test_read_drive_needs_no_displacement(tmp_path: Path) -> None:
    text = "\n".join(line.rpartition(",")[0] for line in TEXT.splitlines())
    t, u = pt.data.read_drive(write(tmp_path, text))
    assert t.tolist() == T
    assert u.tolist() == U
    t, u = pt.data.read_drive(write(tmp_path, TEXT.replace("11.5", "lost")), dt=0.5)
    assert t.tolist() == [0.0, 0.5, 1.0, 1.5]
    assert u.tolist() == U
    with pytest.raises(pt.DataError, match=r"stage\.csv:3: '-' in column 'voltage_V'"):
        pt.data.read_drive(write(tmp_path, TEXT.replace("2.5,", "-,")))
    with pytest.raises(pt.DataError, match=r"stage\.csv:4: column 'time_s': t goes from 0\.1 s"):
        pt.data.read_drive(write(tmp_path, TEXT.replace("0.2,", "0.05,")))


def test_numbers_round_once(tmp_path: Path) -> None:
    texts = [f"{x:.6f}" for x in np.random.default_rng(3).uniform(-130.0, 130.0, 500)]
    lines = [f"{k},{x},{x}" for k, x in enumerate(texts)]
    log = pt.read(write(tmp_path, "\n".join(("time_ms,voltage_mV,displacement_um", *lines))))
    metres = np.array([float(Decimal(x) / 10**6) for x in texts])
    assert (np.abs(log.y - metres) <= np.spacing(np.abs(metres))).all()
    assert log.u.tolist() == [float(x) / 1e3 for x in texts]


# The content of stage.csv, further arguments, the line, and pieces of the message.
BAD: dict[str, tuple[str | bytes, dict[str, Any], int | None, tuple[str, ...]]] = {
    "text": (with_line(3, "0.1,abc,11.5"), {}, 3, ("'abc' in column 'voltage_V' is not a number",)),
    "first offender": (
        TEXT.replace("12.25", "b").replace("2.5,", "a,"),
        {},
        3,
        ("'a' in column 'voltage_V'",),
    ),
    "offender after blank lines": (
        "# a\n\n" + TEXT.replace("\n", "\r\n\r\n").replace("3.75", "x"),
        {},
        9,
        ("'x' in column 'voltage_V'",),
    ),
    "text in time": (with_line(2, "noon,1,1"), {}, 2, ("'noon' in column 'time_s'",)),
    "underscore": (with_line(3, "0.1,1_0,11.5"), {}, 3, ("'1_0'", "is not a number")),
    "empty": (with_line(3, "0.1,,11.5"), {}, 3, ("column 'voltage_V' is empty", "expected")),
    "nan": (
        with_line(4, "0.2,1,NaN"),
        {},
        4,
        ("'NaN' in column 'displacement_um'", "not a finite"),
    ),
    "inf": (with_line(4, "0.2,1,-inf"), {}, 4, ("'-inf' in column 'displacement_um'",)),
    "too large": (with_line(4, "0.2,1e999,1"), {}, 4, ("'1e999'", "not a finite number")),
    "nan without header": (
        "0,1,2\n1,nan,2\n2,1,2\n",
        {"time": 0, "drive": 1, "displacement": 2, "units": {0: "s", 1: "V", 2: "m"}},
        2,
        ("'nan' in column 1",),
    ),
    "a title too many": (
        TEXT.replace("displacement_um", "temperature_C,displacement_um"),
        {},
        2,
        ("3 fields, expected 4 as in line 1",),
    ),
    "few fields": (with_line(3, "0.1,2.5"), {}, 3, ("2 fields, expected 3 as in line 1",)),
    "many fields": (with_line(3, "0.1,2.5,1,1"), {}, 3, ("4 fields, expected 3",)),
    "cut off": (with_line(5, "0.3,5"), {}, 5, ("2 fields", "may have been cut off")),
    "cut off after a delimiter": (with_line(5, "0.3,5,"), {}, 5, ("'displacement_um' is empty",)),
    "another delimiter": (with_line(3, "0.1;2.5;11.5"), {}, 3, ("1 fields, expected 3",)),
    "open quote": (with_line(3, '0.1,"2.5,11.5'), {}, 3, ("2 fields, expected 3",)),
    "quote over two lines": (
        with_line(3, '"0.1').replace("0.2,", '",2.5,11.5\n0.2,'),
        {},
        3,
        ("1 fields",),
    ),
    "note at the end": (TEXT + "done\n", {}, 6, ("1 fields, expected 3",)),
    "thousands": (
        "t_s;u_V;x_um\n0.0;1.5;2.5\n0.1;1,234;2.5\n0.2;1.5;2.5\n",
        {},
        3,
        ("'1,234' in column 'u_V'", "decimal mark of this log is a point"),
    ),
    "point among decimal commas": (
        SEMICOLONS.replace("3,75", "3.75"),
        {},
        4,
        ("'3.75' in column 'voltage_V'", "decimal mark of this log is a comma"),
    ),
    "time goes back": (
        with_line(4, "0.05,1,1"),
        {},
        4,
        ("column 'time_s'", "from 0.1 s to 0.05 s at sample 2", "expected increasing"),
    ),
    "time stands": (with_line(4, "0.1,1,1"), {}, 4, ("from 0.1 s to 0.1 s", "dt=")),
    "gap": (with_line(5, "0.4,1,1"), {}, 5, ("column 'time_s'", "0.2 s forward", "0.1 s", "dt=")),
    "gap after blank lines": (
        with_line(5, "\n\n0.4,1,1"),
        {},
        7,
        ("it goes 0.2 s forward to sample 3",),
    ),
    "two samples": ("\n".join((HEADER, *LINES[:2])), {}, None, ("2 samples: expected at least 3",)),
    "nothing": ("", {}, None, ("is empty",)),
    "blank": ("\n \n\t\n", {}, None, ("is empty",)),
    "comments only": ("# a\n% b\n", {}, None, ("is empty",)),
    "header only": ("# a\n" + HEADER + "\n\n", {}, 2, ("holds a header and no samples",)),
    "unknown unit": (
        TEXT.replace("_um", " [inch]"),
        {},
        1,
        ("column 'displacement [inch]'", "unknown unit 'inch'", "m, mm, um, nm, pm"),
    ),
    "megavolt": (TEXT.replace("_V", " (MV)"), {}, 1, ("unknown unit 'MV'", "V, mV, uV, kV")),
    "wrong unit": (
        TEXT.replace("displacement_um", "displacement_V"),
        {},
        1,
        ("column 'displacement_V'", "'V' is a unit of voltage"),
    ),
    "no unit": (TEXT.replace("voltage_V", "voltage"), {}, 1, ("column 'voltage' has no unit",)),
    "no unit of time": (TEXT.replace("time_s", "time"), {}, 1, ("column 'time' has no unit", "ms")),
    "no displacement": (
        TEXT.replace("displacement_um", "strain"),
        {},
        1,
        ("known to be the displacement", "displacement=", "'time_s', 'voltage_V', 'strain'"),
    ),
    "velocity is no drive": (TEXT.replace("voltage_V", "v"), {}, 1, ("known to be the drive",)),
    "x and y": (
        "t_s,u_V,x_um,y_um\n0,1,2,3\n1,1,2,3\n2,1,2,3\n",
        {},
        1,
        ("several columns could be the displacement: 'x_um', 'y_um'", "displacement="),
    ),
    "no header": ("\n" + "\n".join(LINES), {}, 2, ("no header line", "time=0", "units={0: 's'")),
    "part of the numbers": (
        "\n".join(LINES),
        {"drive": 1, "displacement": 2, "units": {0: "s", 1: "V", 2: "um"}},
        1,
        ("no header line",),
    ),
    "NUL": (TEXT.encode() + b"\0\0\0\0", {}, 6, ("is not a text log", "the byte 0")),
    "random bytes": (bytes(range(255, -1, -1)) * 4, {}, None, ("is not a text log",)),
    "half of UTF-16": (TEXT.encode("utf-16")[:-1], {}, None, ("is not a text log",)),
}


@pytest.mark.parametrize("name", BAD)
def test_refuses_a_bad_file(tmp_path: Path, name: str) -> None:
    content, arguments, line, pieces = BAD[name]
    with pytest.raises(pt.DataError) as caught:
        pt.read(write(tmp_path, content), **arguments)
    message = str(caught.value)
    assert message.startswith(f"stage.csv:{line}: " if line else "stage.csv:")
    assert message.count("stage.csv") == 1
    for piece in pieces:
        assert piece in message


BAD_ARGUMENTS: list[tuple[dict[str, Any], str]] = [
    ({"drive": "volts"}, "drive: 'volts' is not a column; the columns are 'time_s', 'voltage_V'"),
    ({"time": 3}, "time: 3 is not a column"),
    ({"time": -1}, "time: -1 is not a column"),
    ({"time": True}, "time: True is not a column"),
    ({"displacement": 1.0}, "displacement: 1.0 is not a column"),
    ({"displacement": ""}, "displacement: '' is not a column"),
    ({"drive": 2, "displacement": 2}, "name the same column twice"),
    ({"units": {"current": "A"}}, "units: 'current' is not a column"),
    ({"units": {7: "V"}}, "units: 7 is not a column"),
    ({"units": {"drive": "W"}}, "column 'voltage_V': unknown unit 'W': expected one of V, mV"),
    ({"units": {"voltage": "um"}}, "'um' is a unit of displacement"),
    ({"units": {"drive": 1.0}}, "units has 1.0 for 'drive'"),
    ({"units": "um"}, "units is 'um': expected a mapping"),
    ({"dt": 0.0}, "dt is 0.0: expected a finite number of seconds above 0"),
    ({"dt": "0.1"}, "dt is '0.1'"),
    ({"hold": "spline"}, "hold is 'spline'"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_ARGUMENTS, ids=[a[1] for a in BAD_ARGUMENTS])
def test_refuses_a_bad_argument(tmp_path: Path, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(pt.ParameterError, match=re.escape(message)) as caught:
        pt.read(write(tmp_path, TEXT), **arguments)
    assert str(caught.value).startswith("stage.csv: ")


def test_a_name_that_fits_two_columns_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, TEXT.replace("time_s", "voltage_mV"))
    with pytest.raises(pt.ParameterError, match="'voltage' is the name of several columns"):
        pt.read(path, drive="voltage")


def test_refuses_what_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(pt.DataError, match=r"^gone\.csv: there is no such file in '.*'"):
        pt.read(tmp_path / "gone.csv")
    with pytest.raises(pt.DataError, match="is a directory: expected a log"):
        pt.read(tmp_path)
    with pytest.raises(pt.DataError, match="cannot be read"):
        pt.read(tmp_path / "a\0b.csv")
    with pytest.raises(pt.ParameterError, match="path is None"):
        pt.read(None)  # type: ignore[arg-type]


def test_refuses_what_it_may_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, TEXT)

    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(pt.DataError, match=r"^stage\.csv: no permission"):
        pt.read(path)


@needs_measured
def test_reads_the_measured_logs() -> None:
    log = pt.read(MEASURED / "training.csv")
    assert len(log) == 8027
    assert log.dt == pytest.approx(0.005, rel=1e-12)
    assert log.u[0] == 1.8
    assert log.y[0] == pytest.approx(-123.059139e-6, rel=1e-15)
    tracking = pt.read(MEASURED / "tracking.csv")
    assert dict(tracking.column_units) == {"reference": "m"}
    assert tracking.columns["reference"][1] == pytest.approx(0.628215e-6, rel=1e-15)


@pytest.mark.parametrize("content", [TEXT, SEMICOLONS, BLANKS], ids=["plain", "commas", "blanks"])
def test_a_clean_log_is_not_read_line_by_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str
) -> None:
    # Ten times slower, and a million samples are nothing unusual.
    monkeypatch.delattr("piezotrack.data.formats.text.delimited.TextTable._table_by_line")
    assert is_the_log(pt.read(write(tmp_path, content)))


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_reads_what_numpy_saved_with_its_header(tmp_path: Path, delimiter: str) -> None:
    path = tmp_path / "saved.txt"
    table = np.column_stack([np.arange(20) / 100.0, np.arange(20.0) % 7, np.arange(20.0) % 5])
    header = delimiter.join(["time_s", "voltage_V", "displacement_um"])
    np.savetxt(path, table, delimiter=delimiter, header="stage 7\n" + header)
    log = pt.read(path)
    assert np.array_equal(log.u, table[:, 1])
    np.testing.assert_allclose(log.y, table[:, 2] * 1e-6, rtol=1e-15)


def test_a_remark_above_the_samples_is_no_header(tmp_path: Path) -> None:
    path = tmp_path / "bare.csv"
    path.write_text("# measured on Monday, cold\n0,1,2\n1,2,3\n2,1,2\n", encoding="utf-8")
    with pytest.raises(pt.DataError, match="there is no header line"):
        pt.read(path)


def multi_rate(folder: Path) -> Path:
    """Write a log of 0.1 s of a triangle and what follows it, every 10 ms and then every 1 ms."""
    t = np.concatenate([np.arange(50) * 0.01, 0.5 + np.arange(500) * 0.001])
    u = 10.0 * (1.0 - np.abs(t - 0.5) / 0.5)
    lines = [f"{a:.3f},{b:.6f},{1.5 * b:.6f}" for a, b in zip(t, u, strict=True)]
    return write(folder, "\n".join((HEADER, *lines)))


def test_a_log_of_several_rates_is_resampled_and_not_given_an_interval(tmp_path: Path) -> None:
    file = multi_rate(tmp_path)
    with pytest.raises(pt.DataError, match=r"t is not even: .*; resample= puts it on") as caught:
        pt.read(file)
    # One interval in place of the times would stretch half of the log.
    assert "dt=" not in str(caught.value)
    log = pt.read(file, resample=0.001)
    assert log.dt == pytest.approx(0.001)
    assert len(log) == 1000
    triangle = 10.0 * (1.0 - np.abs(log.t - 0.5) / 0.5)
    assert np.abs(log.u - triangle).max() < 1e-5
    assert np.abs(log.y - 1.5e-6 * triangle).max() < 1e-11


def test_a_drive_held_between_samples_stays_so_when_resampled(tmp_path: Path) -> None:
    text = "\n".join((HEADER, "0,0,0", "1,10,1", "3,20,3", "4,0,4"))
    log = pt.read(write(tmp_path, text), resample=0.5, hold="zoh")
    assert log.u.tolist() == [0, 0, 10, 10, 10, 10, 20, 20, 0]
    assert np.abs(log.y - 1e-6 * log.t).max() < 1e-18


def test_jitter_may_be_either(tmp_path: Path) -> None:
    t = 0.01 * np.arange(100) + 0.002 * np.random.default_rng(1).uniform(-1.0, 1.0, 100)
    lines = [f"{a:.6f},{10 * a:.6f},{a:.6f}" for a in t]
    file = write(tmp_path, "\n".join((HEADER, *lines)))
    with pytest.raises(pt.DataError, match=r"resample= puts it on .* can be given with dt="):
        pt.read(file)
    assert len(pt.read(file, dt=0.01)) == 100
    log = pt.read(file, resample=0.005)
    assert np.abs(log.u - 10.0 * log.t).max() < 1e-5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"resample": 0.002}, r"stage\.csv: resample is 0\.002 s: expected .* to 0\.001 s"),
        ({"resample": 1e-13}, "resample is 1e-13 s"),
        ({"resample": 0.0}, "resample is 0.0: expected a finite number"),
        ({"resample": 0.001, "dt": 0.001}, "dt and resample: expected one of them at most"),
    ],
)
def test_a_resampling_that_cannot_be_used(
    arguments: dict[str, Any], words: str, tmp_path: Path
) -> None:
    with pytest.raises(pt.ParameterError, match=words):
        pt.read(multi_rate(tmp_path), **arguments)


def test_times_that_go_back_are_not_resampled(tmp_path: Path) -> None:
    text = with_line(4, "0.05,5.0,13.0")
    with pytest.raises(pt.DataError, match="expected increasing times"):
        pt.read(write(tmp_path, text), resample=0.01)


@pytest.mark.parametrize("form", ["{:.6f}", "{:.4e}", "{!r}"])
def test_a_log_that_is_cut_off_within_its_last_field_is_refused(tmp_path: Path, form: str) -> None:
    y = 100.0 * np.cos(0.37 * np.arange(60)) / 7.0
    rows = [f"{0.01 * k:.2f},{k % 7},{form.format(float(v))}" for k, v in enumerate(y)]
    whole = "\n".join([HEADER, *rows])
    assert pt.read(write(tmp_path, whole)).y.size == 60
    # Of numbers with their shortest digits only one without any decimals is known to be cut off.
    decimals = len(rows[-1].rpartition(".")[2])
    for lost in range(1 if ":" in form else decimals, decimals + 2):
        with pytest.raises(pt.DataError, match=r"stage\.csv:61: .*cut off"):
            pt.read(write(tmp_path, whole[:-lost]))


def test_a_whole_last_line_without_its_end_is_read(tmp_path: Path) -> None:
    """Numbers of fixed decimals may become shorter: 10.02, 9.98."""
    falling = [f"{0.01 * k:.2f},{k % 7},{10.5 - 0.05 * k:.2f}" for k in range(12)]
    # Shortest digits that end at rest.
    resting = [f"{0.01 * k:.2f},{k % 7},{(11 - k) / 7.0!r}" for k in range(11)] + ["0.11,4,0"]
    for rows in (falling, falling[:3], resting):
        assert pt.read(write(tmp_path, "\n".join([HEADER, *rows]))).y.size == len(rows)
