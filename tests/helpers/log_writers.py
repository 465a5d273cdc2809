"""Logs of every format with any columns, as the programs write them whose format it is."""

from __future__ import annotations

import struct
import zipfile
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from format_logs import DT

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    # By the name of a column: its samples, and its unit or an empty text where none is stated.
    Signals = Mapping[str, tuple[NDArray[Any], str]]

WAVEFORMS = """#Digilent WaveForms Oscilloscope Acquisition
#Device Name: Discovery2
#Serial Number: SN:000000000000
#Date Time: 2024-03-12 10:00:00.000
#Sample rate: {rate}
#Samples: {samples}
#Trigger: Source: None at 0 s, Condition: Rising

"""
GCS = {
    "VERSION": "1",
    "TYPE": "1",
    "SEPARATOR": "32",
    "DIM": "2",
    "SAMPLE_TIME": "0.005",
    "NDATA": "400",
}


def titled(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name


def text(path: Path, signals: Signals, *, above: str = "") -> Path:
    """CSV; where a column is shorter than others, its lines have a field less."""
    titles = ",".join(titled(name, unit) for name, (_, unit) in signals.items())
    rows = zip_longest(*(values.tolist() for values, _ in signals.values()))
    lines = [",".join(repr(one) for one in row if one is not None) for row in rows]
    path.write_text(above + "\n".join([titles, *lines]) + "\n", encoding="utf-8")
    return path


def waveforms(
    path: Path, signals: Signals, *, rate: str = "200Hz", samples: int | None = None
) -> Path:
    count = max(values.size for values, _ in signals.values())
    above = WAVEFORMS.format(rate=rate, samples=count if samples is None else samples)
    return text(path, signals, above=above if rate else above.replace("#Sample rate: \n", ""))


def gcs(path: Path, signals: Signals, *, separator: str = " ", **entries: str | None) -> Path:
    """GCS array; `entries` of its header take the place of the usual ones, None leaves one out."""
    names = {f"NAME{k}": titled(name, one[1]) for k, (name, one) in enumerate(signals.items())}
    samples = [values for values, _ in signals.values()]
    usual = GCS | {"DIM": str(len(samples)), "NDATA": str(samples[0].size)} | names
    header = [f"# {name} = {one}" for name, one in {**usual, **entries}.items() if one is not None]
    rows = ["".join(f"{one:.7e}{separator}" for one in row) for row in zip(*samples, strict=True)]
    lines = [*header, "# ", "# END_HEADER ", *rows]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


def lvm_header(columns: str, comma: bool = False) -> str:
    return (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        f"Decimal_Separator\t{',' if comma else '.'}\nMulti_Headings\tYes\nX_Columns\t{columns}\n"
        "Time_Pref\tRelative\nOperator\tme\nDate\t2024/03/12\nTime\t10:00:00,5\n"
        "***End_of_Header***\t\n\t\n"
    )


def lvm_segment(
    signals: Signals, columns: str = "One", *, samples: int | None = None, delta: float = DT
) -> str:
    """One segment; the times are those of ``time``, in the columns that `columns` says."""
    main = {name: one for name, one in signals.items() if name != "time"}
    count = max(values.size for values, _ in main.values())
    times = signals["time"][0] if "time" in signals else DT * np.arange(count)
    samples_stated = count if samples is None else samples

    def entry(name: str, *values: object) -> str:
        return "\t".join([name, *map(str, values), ""])

    titles = "\tX_Value\t".join(main) if columns == "Multi" else "\t".join(main)
    lines = [
        entry("Channels", len(main)),
        entry("Samples", *[samples_stated] * len(main)),
        entry("Date", *["2024/03/12"] * len(main)),
        entry("Y_Unit_Label", *(unit for _, unit in main.values())),
        entry("X_Dimension", *["Time"] * len(main)),
        entry("X0", *["0.0000000000000000E+0"] * len(main)),
        *([entry("Delta_X", *[f"{delta:.6f}"] * len(main))] if delta else []),
        entry("***End_of_Header***", "", ""),
        f"X_Value\t{titles}\tComment",
    ]
    for k, row in enumerate(zip_longest(*(values.tolist() for values, _ in main.values()))):
        x = "" if columns == "No" else f"{times[k]:.6f}"
        fields = [f"{one:.6f}" for one in row if one is not None]
        body = f"\t{x}\t".join(fields) if columns == "Multi" else "\t".join(fields)
        lines.append(f"{x}\t{body}" + ("\tbegun" if k == 0 else ""))
    return "\n".join(lines) + "\n\n"


def lvm(path: Path, signals: Signals, columns: str = "One", **options: Any) -> Path:
    content = lvm_header(columns) + lvm_segment(signals, columns, **options)
    path.write_text(content, encoding="ascii")
    return path


def npy_header(shape: str, descr: str = "<f8", size: int = 128) -> bytes:
    """The header of an array of NumPy, with the shape it is told."""
    entries = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}"
    padded = entries.ljust(size - 11) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(padded)) + padded.encode()


def archive(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(f"{name}.npy", content)
    return path


def npz(path: Path, signals: Signals) -> Path:
    arrays: dict[str, Any] = {titled(name, one[1]): one[0] for name, one in signals.items()}
    np.savez(path, **arrays)
    return path


def npy(path: Path, signals: Signals) -> Path:
    """An array with named columns."""
    names = [titled(name, unit) for name, (_, unit) in signals.items()]
    columns = [values for values, _ in signals.values()]
    rows = np.zeros(columns[0].size, dtype=[(name, "f8") for name in names])
    for name, values in zip(names, columns, strict=True):
        rows[name] = values
    np.save(path, rows)
    return path


def mat_variables(signals: Signals) -> dict[str, Any]:
    """Variables, with a structure of their units beside them."""
    units = {name: unit for name, (_, unit) in signals.items() if unit}
    return {**{name: values for name, (values, _) in signals.items()}, "units": units}


def mat(path: Path, signals: Signals) -> Path:
    from scipy.io import savemat

    savemat(path, mat_variables(signals))
    return path


def mat_73(path: Path, signals: Signals) -> Path:
    import hdf5storage

    hdf5storage.savemat(
        str(path),
        mat_variables(signals),
        format="7.3",
        matlab_compatible=True,
        store_python_metadata=False,
    )
    return path


MAT_HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def mat_element(kind: int, content: bytes, count: int | None = None) -> bytes:
    """An element of a MAT file of version 5, which says that it has `count` bytes."""
    size = len(content) if count is None else count
    return struct.pack("<II", kind, size) + content + bytes(-len(content) % 8)


def mat_array(
    shape: tuple[int, ...], values: bytes, kind: int = 6, count: int | None = None
) -> bytes:
    """The parts of a variable ``voltage_V``."""
    flags = mat_element(6, struct.pack("<II", kind, 0))
    dimensions = mat_element(5, struct.pack(f"<{len(shape)}i", *shape))
    return flags + dimensions + mat_element(1, b"voltage_V") + mat_element(9, values, count)


def hdf5(path: Path, signals: Signals) -> Path:
    import h5py

    with h5py.File(path, "w") as file:
        for name, (values, unit) in signals.items():
            file[name] = values
            if unit:
                file[name].attrs["units"] = unit
    return path


def tdms(path: Path, *channels: tuple[str, str, Any, dict[str, Any]]) -> Path:
    """Channels: their group, name, samples and properties."""
    import nptdms

    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject(*channel) for channel in channels])
    return path


def waveform(unit: str, dt: float = DT) -> dict[str, Any]:
    """Properties of a channel of a TDMS file."""
    return {"unit_string": unit, "wf_increment": dt, "wf_start_offset": 0.0}


def parquet(path: Path, signals: Signals) -> Path:
    import pyarrow as arrow
    from pyarrow.parquet import write_table

    fields = [
        arrow.field(name, arrow.float64(), metadata={"unit": unit} if unit else None)
        for name, (_, unit) in signals.items()
    ]
    arrays = [values for values, _ in signals.values()]
    write_table(arrow.table(arrays, schema=arrow.schema(fields)), path)
    return path


def xlsx(path: Path, signals: Signals) -> Path:
    from itertools import zip_longest

    import openpyxl

    book = openpyxl.Workbook()
    book.active.append([titled(name, unit) for name, (_, unit) in signals.items()])
    for row in zip_longest(*(values.tolist() for values, _ in signals.values())):
        book.active.append(row)
    book.save(path)
    return path


def mdf(
    path: Path,
    signals: Signals,
    conversions: Mapping[str, dict[str, Any]] | None = None,
    /,
    **slow: tuple[NDArray[Any], str, NDArray[Any]],
) -> Path:
    """MDF 4: a group of channels at the times ``time``, and one of each of `slow` at its own."""
    converted = conversions or {}
    import asammdf

    times = signals["time"][0]
    with asammdf.MDF(version="4.10") as file:
        fast = [
            asammdf.Signal(values, times, name=name, unit=unit, conversion=converted.get(name))
            for name, (values, unit) in signals.items()
            if name != "time"
        ]
        file.append(fast, acq_name="fast", comment="a run")
        for name, (values, unit, own) in slow.items():
            file.append(
                [asammdf.Signal(values, own, name=name, unit=unit)], acq_name="slow", comment="slow"
            )
        file.save(path, overwrite=True)
    return path


def afm(path: Path, columns: Mapping[str, NDArray[Any]], fmt: str = "tab") -> Path:
    """A curve as afmformats exports it: its columns are in SI."""
    import afmformats

    curve = afmformats.AFMForceDistance(
        data=dict(columns),
        metadata={
            "spring constant": 0.05,
            "imaging mode": "force-distance",
            "path": str(path),
            "enum": 0,
            "software": "none",
            "software version": "1",
        },
    )
    curve.export_data(path, fmt=fmt)
    return path
