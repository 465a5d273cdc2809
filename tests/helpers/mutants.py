"""Files that the readers are given: good ones, and what becomes of them by accident or intent."""

from __future__ import annotations

import gzip
import json
import math
import re
import tempfile
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from hypothesis import strategies as st

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

    Draw = Callable[[st.SearchStrategy[Any]], Any]

TIMES = np.arange(40) / 50.0
VOLTS = 30 * (1 - np.cos(6 * TIMES))
TITLES = "time_s,voltage_V,displacement_um"


def log(
    delimiter: str = ",",
    titles: str = TITLES,
    ending: str = "\n",
    after: str = "",
    point: str = ".",
) -> str:
    """A log of 40 samples in one of the forms that are read."""
    rows = (
        delimiter.join(f"{v:.6f}".replace(".", point) for v in (t, u, 1.2 * u)) + after
        for t, u in zip(TIMES, VOLTS, strict=True)
    )
    return ending.join([titles.replace(",", delimiter), *rows]) + ending


LOGS = [
    *(log(), log(";"), log(";", point=","), log("\t"), log(" "), log("\t", point=",")),
    *(log(ending="\r\n"), log(titles="t (s),u [V],x/um"), log(after=",")),
    *(
        "# a comment\n% another\n" + log(),
        log(titles='"time (s)","voltage (V)","displacement (um)"'),
    ),
    log(titles="time [ms],U [mV],x [\u00b5m]"),
]
DATES = "\n".join(
    ["Time;voltage_V;displacement_um"]
    + [
        f"12.03.2024 10:00:{t:09.6f};{u:.6f};{1.2 * u:.6f}"
        for t, u in zip(TIMES, VOLTS, strict=True)
    ]
)
LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nX_Columns\tOne\n"
    "***End_of_Header***\n\n"
    "Channels\t2\nSamples\t40\t40\nY_Unit_Label\tV\tum\nX_Dimension\tTime\tTime\nDelta_X\t0.02\t0.02\n"
    "***End_of_Header***\n" + log("\t", "X_Value,voltage,displacement")
)
GCS = (
    "# TYPE = 1\n# SEPARATOR = 44\n# DIM = 3\n# NDATA = 40\n# SAMPLE_TIME = 0.02\n"
    "# NAME0 = time_s\n# NAME1 = voltage_V\n# NAME2 = x_um\n# END_HEADER\n"
    + log().partition("\n")[2]
)
WAVEFORMS = "#Digilent WaveForms Oscilloscope Acquisition\n#Sample rate: 50Hz\n\n" + log()
POINTS = (f"{t},{10 * math.cos(t)},{10 * math.sin(t)}" for t in TIMES)
TABLES = {
    "log": [*LOGS, DATES, LVM, GCS, WAVEFORMS],
    "drive": LOGS,
    "reference": [
        log(titles="time_s,voltage_V,target_um"),
        log(";", "time_s,u_V,target_um"),
        *LOGS,
    ],
    "path": ["\n".join(["time_s,x_um,y_um", *POINTS]), log(titles="time_s,x_um,y_um")],
}
FIELDS = [
    *("nan", "inf", "-inf", "1e400", "-1e400", "1e-400", "", " ", '"', "'", ",", ";", "\t", "\n"),
    *("\r", "\r\n", "\x00", "\ufeff", "\u00b5", "\u03bc", "\u2028", "\x0b", "\x85", "\x1f", "1_0"),
    *("0x1f", "1e5", "-0", "+1", "1,5", "1.5.5", "\u0663", "1d5", "True", "None", "=1+1", "%", "#"),
    *("//", "\\", "9" * 400, "a" * 5000, "1e308", "5e-324", "\U0001f600", "--", "[", "(", "_V"),
    *("_um", "/nm", "MV", "volts", "_" * 300, "\x1b[31m", "1e300", "-1e300"),
]
VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1, 2, 0.5, -0.0, 1e300, -1e300, 1e-300, 1e308, 5e-324, 10**400),
    *(math.nan, math.inf, -math.inf, "", "x", "V", "m", "$\\foo$", "<script>", "a" * 5000, "\x1b["),
    *([], [1], [None], [None, None], ["a", "b"], [1, 2, 3], [2.0, 1.0], [1e300], {}, {"value": 1}),
    *({"value": "x", "unit": "V"}, {"value": 1, "unit": 7}),
]


@cache
def models() -> list[str]:
    """Model files of every kind, as saved."""
    data = pt.Dataset(
        u=VOLTS, y=pt.DahlStage.xu_li_2010().simulate(VOLTS, 0.02).x, dt=0.02, source="a.csv"
    )
    small = pt.ParticleSwarm(particles=8, iterations=4)
    kinds = ("dahl", "bouc-wen", "first-order-dahl", "parallel-dahl", "bouc-wen-oscillator")
    fits = [
        *(
            pt.identify(data, k, method=replace(small, runs=1), threads=1, delay=k == "dahl")
            for k in kinds
        ),
        *(pt.identify(data, k) for k in ("prandtl-ishlinskii", "generalised-prandtl-ishlinskii")),
    ]
    older = sorted((Path(__file__).parents[1] / "files").glob("*.json"))
    return [
        *(json.dumps(fit.document(), indent=2) for fit in fits),
        *(path.read_text(encoding="utf-8") for path in older),
    ]


@cache
def binary_logs() -> dict[str, list[bytes]]:
    """The same log in the formats that are not text, by their endings."""
    data = pt.Dataset(u=VOLTS, y=1.2e-6 * VOLTS, t=TIMES)
    logs = {}
    with tempfile.TemporaryDirectory() as folder:
        for ending in (".npz", ".mat", ".parquet"):
            logs[ending] = [data.save(Path(folder, f"log{ending}")).read_bytes()]
        for ending, write, ways in (
            (".mat", _write_matlab, ({},)),
            (".parquet", _write_parquet, ({}, {"compression": "zstd", "row_group_size": 16})),
            (".h5", _write_hdf5, ({}, {"libver": "latest"})),
            (".h5", _write_rows, ({}, {"libver": "latest"})),
            (".tdms", _write_tdms, ({}, {"version": 4713})),
            (".mf4", _write_mdf, ({"version": "4.10"}, {"version": "3.30"})),
        ):
            for options in ways:
                path = Path(folder, f"log{ending}")
                write(path, options)
                logs.setdefault(ending, []).append(path.read_bytes())
    return logs


def _write_hdf5(path: Path, options: dict[str, Any]) -> None:
    """Datasets with texts of variable length, references and links."""
    import h5py

    with h5py.File(path, "w", **options) as file:
        for name, values, unit in (("time", TIMES, "s"), ("u", VOLTS, "V"), ("x", VOLTS, "um")):
            dataset = file.create_dataset(
                f"run/{name}", data=values, chunks=(16,), compression="gzip"
            )
            # A damaged text of variable length can hang libhdf5: in one file of three.
            dataset.attrs["units"] = unit if name == "x" else np.bytes_(unit)
            dataset.attrs["of"] = np.array([dataset.ref], dtype=h5py.ref_dtype)
        file["again"] = h5py.SoftLink("/run/u")
        file["outside"] = h5py.ExternalLink("other.h5", "/u")


def _write_rows(path: Path, options: dict[str, Any]) -> None:
    """A table of rows, and many small datasets."""
    import h5py

    kinds = [("time_s", "f8"), ("voltage_V", "f4"), ("x_um", "f8"), ("note", "S4")]
    rows = np.zeros(TIMES.size, dtype=kinds)
    rows["time_s"], rows["voltage_V"], rows["x_um"] = TIMES, VOLTS, VOLTS
    with h5py.File(path, "w", **options) as file:
        file["log"] = rows
        file["log"].attrs["sample_rate_Hz"] = 50.0
        for number in range(20):
            file[f"many/{number}"] = np.arange(4)


def _write_matlab(path: Path, options: dict[str, Any]) -> None:
    """MAT v7.3 as MATLAB writes it: a block before HDF5, classes, a cell array, units."""
    import h5py

    with h5py.File(path, "w", userblock_size=512, **options) as file:
        for name, values in (("time", TIMES), ("u", VOLTS), ("x", VOLTS), ("#refs#/a", VOLTS)):
            file[name] = values[None]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["cells"] = np.array([file["#refs#/a"].ref], dtype=h5py.ref_dtype)
        file["cells"].attrs["MATLAB_class"] = np.bytes_("cell")
        for name, unit in (("time", "s"), ("u", "V"), ("x", "um")):
            file[f"units/{name}"] = np.array([[ord(letter)] for letter in unit], dtype="u2")
            file[f"units/{name}"].attrs["MATLAB_class"] = np.bytes_("char")
    content = bytearray(path.read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(content)


def _write_parquet(path: Path, options: dict[str, Any]) -> None:
    """Columns of numbers beside texts, lists and structures."""
    import pyarrow
    import pyarrow.parquet

    columns = {"time_s": TIMES, "voltage_V": VOLTS.astype("f4"), "x_um": VOLTS}
    two: dict[str, list[Any]] = {"note": ["a", "b"], "list": [[1.0], []]}
    two["both"] = [{"a": 1}, {"a": 2}]
    others = {name: values * (TIMES.size // 2) for name, values in two.items()}
    pyarrow.parquet.write_table(pyarrow.table({**columns, **others}), path, **options)


def _write_tdms(path: Path, options: dict[str, Any]) -> None:
    """Two segments, with texts beside the numbers."""
    import nptdms

    with nptdms.TdmsWriter(str(path), **options) as writer:
        about = {"wf_increment": 0.02}
        for part in (slice(0, 20), slice(20, 40)):
            channels = [
                nptdms.ChannelObject("run", name, VOLTS[part], {**about, "unit_string": unit})
                for name, unit in (("u", "V"), ("x", "um"))
            ]
            writer.write_segment([*channels, nptdms.ChannelObject("run", "note", ["ab", "cde"])])


def _write_mdf(path: Path, options: dict[str, Any]) -> None:
    """Groups of numbers, of converted numbers and of texts."""
    from asammdf import MDF, Signal

    with MDF(**options) as file:
        file.append([Signal(VOLTS, TIMES, name=n, unit=u) for n, u in (("u", "V"), ("x", "um"))])
        counts = np.arange(TIMES.size)
        file.append([Signal(counts, TIMES, name="k", conversion={"a": 2.0, "b": 1.0})])
        texts = np.array([b"a", b"bc"] * (TIMES.size // 2))
        file.append([Signal(texts, TIMES, name="note", encoding="utf-8")])
        saved = file.save(path.with_suffix(".mf4" if options["version"] >= "4" else ".mdf"))
    Path(saved).replace(path)


@st.composite
def binaries(draw: Draw, right: list[bytes]) -> bytes:
    """A file that is not text with something changed: cut off, bytes, or a number of its sizes."""
    content = bytearray(draw(st.sampled_from(right)))
    if draw(st.integers(0, 7)) == 0:
        del content[draw(st.integers(0, len(content))) :]
    for _ in range(draw(st.integers(1, 3))):
        if len(content) < 16:
            break
        place = draw(st.integers(0, len(content) - 9))
        size = draw(st.sampled_from([1, 1, 2, 4, 8]))
        number = draw(st.sampled_from([0, 1, 2**7, 2 ** (8 * size) - 1, 2 ** (8 * size - 1), 41]))
        content[place : place + size] = number.to_bytes(size, "little")
    return bytes(content)


@st.composite
def tables(draw: Draw, right: list[str]) -> bytes:
    """A file of columns with something changed."""
    return encoded(draw, changed_text(draw, draw(st.sampled_from(right)), FIELDS))


@st.composite
def documents(draw: Draw, right: list[str]) -> bytes:
    """A model file with something changed: mostly a value, sometimes its text."""
    text = draw(st.sampled_from(right))
    if draw(st.integers(0, 4)) == 0:
        pieces = [json.dumps(value) for value in VALUES] + ["[" * 200, "9" * 5000, '"\\ud800"']
        return encoded(draw, changed_text(draw, text, pieces))
    return changed_document(draw, text).encode("utf-8", "surrogatepass")


def changed_document(draw: Draw, text: str) -> str:
    document = json.loads(text)
    for _ in range(draw(st.sampled_from([1, 1, 1, 2, 3]))):
        node, parent, key = document, None, None
        for _ in range(draw(st.integers(1, 5))):
            keys = (
                list(node)
                if isinstance(node, dict)
                else range(len(node))
                if isinstance(node, list)
                else []
            )
            if not keys:
                break
            parent, key = node, draw(st.sampled_from(list(keys)))
            node = node[key]
        change_entry(draw, parent, key)
    return json.dumps(document)


def change_entry(draw: Draw, parent: Any, key: Any) -> None:
    old, how = parent[key], draw(st.integers(0, 7))
    if how == 0 and isinstance(parent, dict):
        del parent[key]
    elif how == 1 and isinstance(parent, dict):
        parent["x" * draw(st.integers(0, 3))] = old
    elif how == 2 and isinstance(old, (int, float)) and not isinstance(old, bool):
        # An integer beyond all floats stays.
        with suppress(OverflowError):
            parent[key] = old * draw(st.sampled_from([-1, 0, 1e300, 1e-300, 2, 10**30]))
    elif how == 3 and isinstance(old, list):
        parent[key] = old * draw(st.sampled_from([2, 50])) + [None]
    elif how == 4:
        parent[key] = [old]
    else:
        parent[key] = deepcopy(VALUES[draw(st.integers(0, len(VALUES) - 1))])


def changed_text(draw: Draw, text: str, pieces: list[str]) -> str:
    for _ in range(draw(st.sampled_from([1, 1, 1, 1, 2, 3]))):
        if draw(st.integers(0, 2)) == 0:
            text = changed_number(draw, text)
            continue
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.sampled_from([0, 1, 2, 5, 20, 200])))
        how = draw(st.integers(0, 7))
        if how <= 2:
            text = text[:start] + draw(st.sampled_from(pieces)) + text[end:]
        elif how == 3:
            text = text[:start] + text[end:]
        elif how == 4:
            text = text[:start] + text[start:end] * draw(st.sampled_from([2, 3, 50])) + text[end:]
        elif how == 5:
            text = changed_line(draw, text, pieces)
        elif how == 6:
            old = draw(st.sampled_from(list(",;.\n\t 0123456789_eVum")))
            new = draw(st.sampled_from([*",;.\n\t 0e-", ""]))
            text = text.replace(old, new, draw(st.sampled_from([1, 1, -1])))
        else:
            text = text[:start] + draw(st.characters()) + text[end:]
    return text


def changed_number(draw: Draw, text: str) -> str:
    """Another number in place of one of the first or any: what is still a file."""
    numbers = list(re.finditer(r"\d+\.\d+", text))
    if not numbers:
        return text
    old = numbers[draw(st.integers(0, len(numbers) - 1))]
    new = draw(st.one_of(st.floats(-100, 100), st.floats(allow_nan=False))) + 0.0
    return text[: old.start()] + f"{new:.6g}" + text[old.end() :]


def changed_line(draw: Draw, text: str, pieces: list[str]) -> str:
    lines = text.split("\n")
    k = draw(st.integers(0, len(lines) - 1))
    how = draw(st.integers(0, 4))
    if how == 0:
        del lines[k]
    elif how == 1:
        lines.insert(draw(st.integers(0, len(lines))), lines[k])
    elif how == 2:
        lines[k] += draw(st.sampled_from([",", ",1", ";", " ", ",,", "\t1"]))
    elif how == 3:
        fields = lines[k].split(",")
        fields[draw(st.integers(0, len(fields) - 1))] = draw(st.sampled_from(pieces))
        lines[k] = ",".join(fields)
    else:
        del lines[k:]
    return "\n".join(lines)


def encoded(draw: Draw, text: str) -> bytes:
    how = draw(st.integers(0, 24))
    others = ["utf-16", "utf-16-le", "utf-32", "latin-1", "utf-8-sig"]
    name = others[how] if how < len(others) else "utf-8"
    written = text.encode(name, "replace" if name in ("latin-1", "utf-8-sig") else "surrogatepass")
    if how == 5:
        return gzip.compress(written, mtime=0)
    if how in (6, 7):
        changed = bytearray(written or b"x")
        for _ in range(draw(st.sampled_from([1, 3, 20]))):
            changed[draw(st.integers(0, len(changed) - 1))] = draw(st.integers(0, 255))
        return bytes(changed)
    return written
