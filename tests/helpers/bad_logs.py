"""Files that are no log, format by format, each with the one fault that its name says."""

from __future__ import annotations

import struct
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

import log_writers as write
from format_logs import DT, T, U, Y

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from log_writers import Signals

    Make = Callable[[Path], object]

# Sound: all files begin from these.
LOG: Signals = {"time": (T, "s"), "voltage": (U, "V"), "position": (Y, "um")}
CURVE = {"time": T, "height (piezo)": 1e-6 * U, "height (measured)": 1e-6 * Y}


@dataclass(frozen=True)
class Kind:
    """A format: its name, the name of a file, how a sound one is written.

    `timed` says that it has a column of times, `library` and `extra` what reads it.
    """

    name: str
    file: str
    write: Callable[..., object]
    timed: bool = True
    library: str = ""
    extra: str = ""


def _tdms(path: Path, signals: Signals, dt: float = DT, **slower: float) -> None:
    """Channels of one group; the rate is a property of each."""
    channels = []
    for name, (values, unit) in signals.items():
        properties = {"wf_increment": slower.get(name, dt)} if dt else {}
        if unit:
            properties["unit_string"] = unit  # type: ignore[assignment]
        channels.append(("run", name, values, properties))
    write.tdms(path, *channels)


KINDS = [
    Kind("Text: CSV and the like", "log.csv", write.text),
    Kind("Digilent WaveForms", "scope.csv", write.waveforms),
    Kind("LabVIEW measurement", "log.lvm", write.lvm),
    Kind("GCS array of PI", "log.gcs", write.gcs, timed=False),
    Kind("NPZ", "log.npz", write.npz),
    Kind("NPY", "log.npy", write.npy),
    Kind("MAT v5 and v7", "log.mat", write.mat),
    Kind("MAT v7.3", "log.mat", write.mat_73, library="h5py", extra="mat"),
    Kind("HDF5", "log.h5", write.hdf5, library="h5py", extra="hdf5"),
    Kind("TDMS", "log.tdms", _tdms, timed=False, library="nptdms", extra="tdms"),
    Kind("Parquet", "log.parquet", write.parquet, library="pyarrow", extra="parquet"),
    Kind("XLSX", "log.xlsx", write.xlsx, library="openpyxl", extra="xlsx"),
    Kind("MDF", "log.mf4", write.mdf, library="asammdf", extra="mdf"),
    Kind("AFM curves", "curve.tab", write.afm, library="afmformats", extra="afm"),
]


@dataclass(frozen=True)
class Case:
    """A bad file: what is wrong with it, what writes it, and what it is read with."""

    wrong: str
    make: Make
    file: str = ""
    arguments: tuple[tuple[str, Any], ...] = ()
    missing: str = ""


def cases(kind: Kind) -> list[Case]:
    """All bad files of a format, those first that most formats have."""
    common = _of_curve(kind) if kind.library == "afmformats" else _of_columns(kind)
    absent = [Case("its library is not installed", partial(_sound, kind), missing=kind.library)]
    return [*(absent if kind.library else []), *common, *_of_bytes(kind), *OWN.get(kind.name, [])]


@contextmanager
def without(library: str) -> Iterator[None]:
    """Have the import of a library fail, as where it is not installed."""
    there = {name: one for name, one in sys.modules.items() if name.partition(".")[0] == library}
    try:
        sys.modules.update(dict.fromkeys([library, *there]))  # type: ignore[arg-type]
        yield
    finally:
        for name in [library, *there]:
            sys.modules.pop(name, None)
        sys.modules.update(there)


def _sound(kind: Kind, path: Path) -> None:
    kind.write(path, CURVE if kind.library == "afmformats" else _taken(kind, LOG))


def _taken(kind: Kind, signals: Signals) -> Signals:
    """What of the columns the format has: not the times where it only states a rate."""
    return {n: one for n, one in signals.items() if kind.timed or n != "time"}


def _without(signals: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: one for name, one in signals.items() if name not in names}


def _late(t: Any) -> Any:
    """The same times with half a second in the middle in which nothing was written."""
    return t + 0.5 * (np.arange(t.size) >= 200)


def _two_rates() -> Any:
    """Times of 200 Hz, and from sample 300 on of 2 kHz."""
    return np.concatenate([T[:300], T[299] + 0.1 * DT * np.arange(1, 101)])


def _of_columns(kind: Kind) -> list[Case]:
    """Columns, units, times and samples, of any format that has columns with names."""

    def case(wrong: str, signals: Signals, **options: Any) -> Case:
        taken = _taken(kind, signals)
        return Case(wrong, lambda path: kind.write(path, taken, **options))

    def lost(values: Any) -> Any:
        return np.where(np.arange(values.size) == 7, np.nan, values)

    cases = [
        case("a column without a unit", {**LOG, "voltage": (U, "")}),
        case("a unit that is not known", {**LOG, "position": (Y, "inch")}),
        case("a unit of another quantity", {**LOG, "position": (Y, "mV")}),
        case("no column of the displacement", {**_without(LOG, "position"), "strain": (Y, "")}),
        case("two columns that may be the drive", {**LOG, "command": (U, "V")}),
        case("a sample that is no number", {**LOG, "voltage": (lost(U), "V")}),
        case("two samples", {name: (one[:2], unit) for name, (one, unit) in LOG.items()}),
    ]
    if kind.name in TIMELESS:
        cases.insert(5, case("no time and no rate", _without(LOG, "time"), **TIMELESS[kind.name]))
    if kind.timed:
        cases += [
            case("a gap in the times", {**LOG, "time": (_late(T), "s")}),
            case("two rates in one column of times", {**LOG, "time": (_two_rates(), "s")}),
            case("times that go back", {**LOG, "time": (T % 1.0, "s")}),
        ]
    if kind.name in ("NPZ", "MAT v5 and v7", "MAT v7.3", "HDF5"):
        cases.append(case("columns of two rates", {**LOG, "position": (Y[::2], "um")}))
    return cases


# How a format is written without time and rate.
TIMELESS: dict[str, dict[str, Any]] = {
    "Text: CSV and the like": {},
    "Digilent WaveForms": {"rate": ""},
    "LabVIEW measurement": {"columns": "No", "delta": 0.0},
    "GCS array of PI": {"SAMPLE_TIME": None},
    "NPZ": {},
    "NPY": {},
    "MAT v5 and v7": {},
    "MAT v7.3": {},
    "HDF5": {},
    "TDMS": {"dt": 0.0},
    "Parquet": {},
}


def _of_curve(kind: Kind) -> list[Case]:
    """Faults of curves: names and units are those of the library, in SI."""

    def case(wrong: str, columns: Mapping[str, Any]) -> Case:
        return Case(wrong, lambda path: kind.write(path, columns))

    height = "height (measured)"
    lost = np.where(np.arange(Y.size) == 7, np.nan, 1e-6 * Y)
    return [
        case("no column of the displacement", {**_without(CURVE, height), "force": 1e-9 * U}),
        case("no time", _without(CURVE, "time")),
        case("a sample that is no number", {**CURVE, height: lost}),
        case("two samples", {name: one[:2] for name, one in CURVE.items()}),
        case("a gap in the times", {**CURVE, "time": _late(T)}),
        case("two rates in one column of times", {**CURVE, "time": _two_rates()}),
        case("times that go back", {**CURVE, "time": T % 1.0}),
    ]


def _of_bytes(kind: Kind) -> list[Case]:
    """What may happen to any file: cut off, empty, or of another program."""

    def cut(path: Path) -> None:
        _sound(kind, path)
        content = path.read_bytes()
        path.write_bytes(content[: int(0.6 * len(content))])

    def other(path: Path) -> None:
        path.write_bytes(b"time_s,voltage_V,x_um\n0,1,2\n1,2,3\n2,1,2\n")

    file = "curve.jpk-force" if kind.library == "afmformats" else kind.file
    cases = [Case("an empty file", lambda path: path.write_bytes(b""), file)]
    if kind.library != "afmformats":
        cases.insert(0, Case("a file that is cut off", cut))
    if kind.file.endswith((".csv", ".tab")):
        return cases
    return [*cases, Case("a text with the ending of the format", other, file)]


def _changed(kind: str, change: Callable[[bytes], bytes]) -> Make:
    """A sound file with some of its bytes changed."""
    (described,) = [kind_of_log for kind_of_log in KINDS if kind_of_log.name == kind]

    def make(path: Path) -> None:
        _sound(described, path)
        content = path.read_bytes()
        changed = change(content)
        assert changed != content
        path.write_bytes(changed)

    return make


def _text(content: str | bytes) -> Make:
    data = content if isinstance(content, bytes) else content.encode()
    return lambda path: path.write_bytes(data)


def _of_mat(content: bytes) -> Make:
    return _text(write.MAT_HEADER + content)


def _channel_group(content: bytes) -> int:
    """Where a file of MDF 4 says how many cycles its first group has."""
    return content.index(b"##CG") + 24 + 6 * 8 + 8


def _put(content: bytes, place: int, form: str, value: int) -> bytes:
    changed = bytearray(content)
    struct.pack_into(form, changed, place, value)
    return bytes(changed)


def _unwritten(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("voltage_V", shape=(10**12,), dtype="f8", chunks=(1000,))


def _elsewhere(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["voltage_V"] = h5py.ExternalLink("other.h5", "/voltage_V")


def _two_units(path: Path) -> None:
    write.hdf5(path, {"time_s": (T, ""), "voltage_V": (U, ""), "x_um": (Y, "nm")})


def _repeated(path: Path) -> None:
    from pyarrow import table
    from pyarrow.parquet import write_table

    write_table(table({"time_s": np.zeros(14_000_000)}), path, compression="zstd")


def _together(path: Path) -> None:
    """Three columns, of which none is beyond measure."""
    zeros = write.npy_header("(5000000,)") + bytes(40_000_000)
    write.archive(path, time_s=zeros, voltage_V=zeros, x_um=zeros)


def _zeros(path: Path) -> None:
    """An archive of a hundred kilobytes that is 112 MB of zeros."""
    path.write_bytes(b"")
    write.archive(path, time_s=write.npy_header("(14000000,)") + bytes(112_000_000))


CURVE_BOMB = b"segments/0/channels/vDeflection.dat"


def _curve_of_zeros(path: Path) -> None:
    import zipfile

    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(CURVE_BOMB.decode(), bytes(110_000_000))


def _old_mat(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"time_s": T, "voltage_V": U, "x_um": Y}, format="4")


def _two_groups(path: Path) -> None:
    channels = [
        (f"run {k}", name, values, write.waveform(unit))
        for k in (1, 2)
        for name, values, unit in (("Voltage", U, "V"), ("Position", Y, "um"))
    ]
    write.tdms(path, *channels)


def _slow_channel(path: Path) -> None:
    slow = {"Position": (Y[::2], "um", T[::2])}
    write.mdf(path, {"time": (T, "s"), "Voltage": (U, "V")}, **slow)


def _formula(path: Path) -> None:
    write.mdf(path, LOG, {"voltage": {"formula": "pow(X, 2)"}})


def _gcs(entry: str, value: str, path: Path) -> None:
    write.gcs(path, _without(LOG, "time"), **{entry: value})


def _endless(content: bytes) -> bytes:
    return content.replace(b"# END_HEADER", b"#")


CSV = "time_s,voltage_V,x_um\n0,1.25,2\n1,2.5,3\n2,1.25,2\n"
ROWS = write.npy_header("(10000000000,)") + T[:100].tobytes()
# What a format has besides, by its name.
OWN: dict[str, list[Case]] = {
    "Text: CSV and the like": [
        Case("a field that is no number", _text(CSV.replace("2.5", "abc"))),
        Case("an empty field", _text(CSV.replace("2.5", ""))),
        Case("NaN, as some programs write a gap", _text(CSV.replace("2.5", "NaN"))),
        Case("a line with a field more", _text(CSV.replace("1,2.5,3", "1,2.5,3,4"))),
        Case("thousands divided", _text(CSV.replace(",", ";").replace("2.5", "1,234"))),
        Case("no line of titles", _text(CSV.partition("\n")[2])),
        Case("titles and no samples", _text(CSV.partition("\n")[0] + "\n")),
        Case(
            "a date that may be either",
            _text("Time,voltage_V,x_um\n" + "".join(f"03/04/2024 10:0{k},1,2\n" for k in range(3))),
        ),
        Case("bytes that are no text", _text(CSV.encode() + b"\0\0\0\0")),
        Case("a spreadsheet", _text(b"PK\x03\x04 sheet"), "log.xlsx"),
        Case("a column that is not there", _text(CSV), arguments=(("drive", "volts"),)),
        Case("an interval that is none", _text(CSV), arguments=(("dt", 0.0),)),
    ],
    "Digilent WaveForms": [
        Case(
            "a rate of 0",
            lambda path: write.waveforms(path, _without(LOG, "time"), rate="0Hz"),
        ),
    ],
    "LabVIEW measurement": [
        Case("more samples said than there", lambda path: write.lvm(path, LOG, samples=1000)),
        Case("no header of a segment", _text(write.lvm_header("One"))),
        Case(
            "two segments",
            _text(write.lvm_header("One") + write.lvm_segment(LOG) + write.lvm_segment(LOG)),
        ),
    ],
    "GCS array of PI": [
        Case(f"{name} that is not true", partial(_gcs, name, value))
        for name, value in (("NDATA", "1000000000000"), ("DIM", "3"), ("SAMPLE_TIME", "-1"))
    ]
    + [
        Case("a header without its end", _changed("GCS array of PI", _endless)),
    ],
    "NPZ": [
        Case("a shape that is not true", lambda path: write.archive(path, time_s=ROWS)),
        Case("an archive that expands beyond measure", _zeros),
        Case("columns that expand beyond measure together", _together),
        Case("a member that is no array", lambda path: write.archive(path, time_s=b"no array")),
        Case("no member", write.archive),
    ],
    "NPY": [Case("a shape that is not true", _text(ROWS))],
    "MAT v5 and v7": [
        Case(
            "a length that is not true",
            _of_mat(write.mat_element(14, write.mat_array((1, 3), bytes(24)), 4_000_000_000)),
        ),
        Case(
            "a shape that is not true",
            _of_mat(write.mat_element(14, write.mat_array((100_000, 100_000), bytes(24)))),
        ),
        Case("a file of version 4", _old_mat),
    ],
    "HDF5": [
        Case("a dataset that was never written", _unwritten),
        Case("samples in another file", _elsewhere),
        Case("a unit in the title and another beside it", _two_units),
    ],
    "TDMS": [
        Case(
            "channels of two rates",
            lambda path: _tdms(path, _without(LOG, "time"), position=2 * DT),
        ),
        Case("two groups with the same channels", _two_groups),
        Case(
            "a number of samples that is not true",
            _changed(
                "TDMS",
                lambda content: content.replace(
                    struct.pack("<IIQ", 10, 1, 400), struct.pack("<IIQ", 10, 1, 4 * 10**12), 1
                ),
            ),
        ),
    ],
    "Parquet": [Case("more rows than the file can hold", _repeated)],
    "MDF": [
        Case("channels of two rates", _slow_channel),
        Case("a channel that is converted by a formula", _formula),
        Case("a file that was not finished", _changed("MDF", lambda one: b"UnFinMF " + one[8:])),
        Case(
            "more cycles than the file has",
            _changed("MDF", lambda one: _put(one, _channel_group(one), "<Q", 10**12)),
        ),
    ],
    "AFM curves": [
        Case("an archive that expands beyond measure", _curve_of_zeros, "curve.jpk-force"),
        Case("an archive that is cut off", _text(b"PK\x03\x04" + bytes(300)), "curve.jpk-force"),
    ],
}
