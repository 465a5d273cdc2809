"""MDF4 and MDF3, written by asammdf."""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from children import child
from format_logs import DT, TEMPERATURE, T, U, Y, is_the_log, refusal, survives

if TYPE_CHECKING:
    from pathlib import Path

asammdf: Any = pytest.importorskip("asammdf", reason="asammdf, of the extra mdf, is not installed")

FORMULA = {"formula": "pow(X, 2)"}
LINEAR = {"a": 2.0, "b": 1.0}
# What numexpr refuses or does not know, and what takes it for ever; asammdf reads X for X1, too.
FORMULAS = (
    *("__import__('os').system('true')", "pow(X,2)", "X^2", "ln(X+1)", "if(X>0,X*2,X)"),
    *("(X", "X*2;", "9**9**9**9", "2*X"),
)


def write(
    path: Path, version: str = "4.10", compression: int = 0, times: Any = None, author: str = ""
) -> Path:
    """A log of two rates; `times` is how all times are converted."""
    signal = asammdf.Signal
    with asammdf.MDF(version=version) as file:
        file.append(
            [signal(U, T, name="Voltage", unit="V"), signal(Y, T, name="Position", unit="um")],
            acq_name="fast",
            comment="a run",
        )
        slow = signal(TEMPERATURE, 10 * DT * np.arange(40), name="Temperature", unit="K")
        file.append([slow], acq_name="slow", comment="the room")
        if author:
            file.header.author = author
        for group in file.groups if times is not None else ():
            group.channels[0].conversion = times
        file.save(path, overwrite=True, compression=compression)
    return path


@pytest.mark.parametrize(("version", "ending"), [("4.10", ".mf4"), ("3.30", ".mdf")])
def test_channels_units_and_times(tmp_path: Path, version: str, ending: str) -> None:
    log = pt.read(write(tmp_path / f"log{ending}", version))
    assert is_the_log(log)
    assert log.notes == ()


def test_compressed_blocks(tmp_path: Path) -> None:
    assert is_the_log(pt.read(write(tmp_path / "log.mf4", compression=2)))


def test_the_time_is_that_of_the_group(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mf4")
    found = refusal(path, displacement="Temperature", units={"Temperature": "um"})
    assert "expected equally many" in found
    assert "'fast/Voltage' [V] (400 samples)" in refusal(path, drive="amplifier")


def test_more_cycles_than_the_file_has_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mf4")
    content = path.read_bytes()
    # A channel group: its cycles are 400, in records of 24 bytes.
    place = content.index(b"##CG") + 24 + 6 * 8 + 8
    assert struct.unpack_from("<Q", content, place) == (400,)
    for count in (10**12, 2**63):
        changed = bytearray(content)
        struct.pack_into("<Q", changed, place, count)
        path.write_bytes(changed)
        refusal(path)


def test_a_channel_beyond_its_record_is_refused(tmp_path: Path) -> None:
    """asammdf would read beyond its memory there, and end the process."""
    path = write(tmp_path / "log.mf4")
    content = path.read_bytes()
    # A channel: its kind, data type and bit offset, then the place of its first byte and its bits.
    for found in re.finditer(b"##CN", content):
        place = found.start() + 24 + 8 * 8 + 4
        assert struct.unpack_from("<I", content, place + 4) == (64,)
        for offset, value in ((0, 1000), (0, 2**32 - 1), (4, 2**31)):
            changed = bytearray(content)
            struct.pack_into("<I", changed, place + offset, value)
            path.write_bytes(changed)
            refusal(path)


def test_an_unfinished_file_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mf4")
    content = path.read_bytes()
    # By its name, or by its flags for what is left to do.
    for unfinished in (b"UnFinMF " + content[8:], content[:60] + b"\x01" + content[61:]):
        path.write_bytes(unfinished)
        assert "was not finished by the program that wrote it" in refusal(path)


def test_damaged_files_are_refused_in_a_sentence(tmp_path: Path) -> None:
    assert survives(write(tmp_path / "log.mf4")) > 20


def converted(path: Path, conversion: dict[str, Any], version: str = "4.10") -> Path:
    """A log whose drive is stored as it is and converted when read, beside a column of states."""
    signal = asammdf.Signal
    with asammdf.MDF(version=version) as file:
        state = np.arange(T.size) // 300
        texts = {"val_0": 0, "text_0": "rest", "val_1": 1, "text_1": "run", "default_addr": "?"}
        file.append(
            [
                signal(U, T, name="Voltage", unit="V", conversion=dict(conversion)),
                signal(Y, T, name="Position", unit="um"),
                signal(state, T, name="State", conversion=texts if version >= "4" else None),
            ]
        )
        file.save(path, overwrite=True)
    return path


def nested(conversion: dict[str, Any], depth: int = 1) -> dict[str, Any]:
    """A table of ranges whose parts refer to further conversions."""
    inner = nested(conversion, depth - 1) if depth > 1 else dict(conversion)
    return {"lower_0": -2.0, "upper_0": -1.0, "text_0": "low", "default_addr": inner}


@pytest.fixture
def evaluated(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The formulas that asammdf evaluates, where sympy is installed: by `eval`, in the end."""
    formulas: list[str] = []

    def lambdify(_: object, formula: str, **__: object) -> Any:
        formulas.append(formula)
        return lambda values: values

    for module in (asammdf.blocks.v4_blocks, asammdf.blocks.v2_v3_blocks):
        real = module.evaluate

        def evaluate(formula: str, real: Any = real) -> Any:
            formulas.append(formula)
            # The last one does not end.
            return real("unknown" if "9**9" in formula else formula)

        # The text of a rational conversion is not of the file.
        monkeypatch.setattr(module, "evaluate", evaluate)
        monkeypatch.setattr(module, "lambdify", lambdify)
        monkeypatch.setattr(module, "symbols", str)
    return formulas


@pytest.mark.parametrize(("version", "ending"), [("4.10", ".mf4"), ("3.30", ".mdf")])
@pytest.mark.parametrize("formula", FORMULAS)
def test_a_formula_is_not_evaluated_nor_left_out(
    tmp_path: Path, evaluated: list[str], formula: str, version: str, ending: str
) -> None:
    conversion = {"formula": formula.replace("X", "X1") if version < "4" else formula}
    path = converted(tmp_path / f"log{ending}", conversion, version)
    found = refusal(path)
    assert "'Voltage'" in found
    assert "formula" in found
    # The others are read.
    assert np.array_equal(pt.data.read_drive(path, drive="Position", units={"drive": "V"}).u, Y)
    assert pt.data.info(path).problem
    assert evaluated == []


@pytest.mark.parametrize("depth", [1, 3])
def test_nor_is_one_that_a_table_refers_to(
    tmp_path: Path, evaluated: list[str], depth: int
) -> None:
    path = converted(tmp_path / "log.mf4", nested(FORMULA, depth))
    assert "formula" in refusal(path)
    assert evaluated == []
    log = pt.read(converted(path, nested(LINEAR, depth)))
    assert np.array_equal(log.u, 2.0 * U + 1.0)


@pytest.mark.parametrize(("version", "ending"), [("4.10", ".mf4"), ("3.30", ".mdf")])
def test_nor_is_one_of_the_times(
    tmp_path: Path, evaluated: list[str], version: str, ending: str
) -> None:
    """The times are converted with whatever channel of the group is read."""
    of = asammdf.blocks.v4_blocks if version >= "4" else asammdf.blocks.v2_v3_blocks
    times = of.ChannelConversion(
        conversion_type=3 if version >= "4" else 10, formula="2*X", unit="s"
    )
    path = write(tmp_path / f"log{ending}", version, times=times)
    assert "'time'" in refusal(path)
    assert np.array_equal(pt.read(path, dt=DT).u, U)
    assert evaluated == []


@pytest.mark.parametrize(("version", "ending"), [("4.10", ".mf4"), ("3.30", ".mdf")])
def test_linear_and_rational_conversions_and_tables_are_carried_out(
    tmp_path: Path, version: str, ending: str
) -> None:
    path = tmp_path / f"log{ending}"
    rational = {f"P{k}": float(k == 2 or k == 6) for k in range(1, 7)} | {"P3": 5.0, "P6": 2.0}
    table = {"raw_0": 0.0, "phys_0": 0.0, "raw_1": 50.0, "phys_1": 100.0, "interpolation": True}
    for conversion, expected in (
        (LINEAR, 2.0 * U + 1.0),
        (rational, 0.5 * (U + 5.0)),
        (table, 2 * U),
    ):
        log = pt.read(converted(path, conversion, version))
        assert np.abs(log.u - expected).max() < 1e-12
        assert log.notes == ()


def test_a_conversion_that_cannot_be_read_is_not_left_out(tmp_path: Path) -> None:
    """asammdf goes on without it, as with one that refers to itself."""
    path = converted(tmp_path / "log.mf4", nested(LINEAR))
    content = path.read_bytes()
    with asammdf.MDF(path) as file:
        channel = file.groups[0].channels[1]
        place, conversion = channel.address + 24 + 4 * 8, channel.conversion_addr
    assert struct.unpack_from("<Q", content, place) == (conversion,)
    # Beyond the file; not at a conversion; the default of the table is the table itself.
    default = conversion + 24 + 5 * 8
    for where, value in ((place, len(content) + 8), (place, 64), (default, conversion)):
        changed = bytearray(content)
        struct.pack_into("<Q", changed, where, value)
        path.write_bytes(changed)
        assert "conversion" in refusal(path)


def test_what_asammdf_prints_is_not_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "log.mf4", author="me")
    content = path.read_bytes()
    assert b'name="author"' in content
    path.write_bytes(content.replace(b'name="author"', b'nbme="author"'))
    capsys.readouterr()
    assert is_the_log(pt.read(path))
    assert capsys.readouterr().out == ""


def test_a_block_that_claims_terabytes_does_not_ask_for_them(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mf4", compression=2)
    content = bytearray(path.read_bytes())
    # A compressed block: kinds, a parameter, the size of its samples, and its own.
    place = content.index(b"##DZ") + 24 + 8 + 8
    assert 0 < struct.unpack_from("<Q", content, place)[0] < len(content)
    struct.pack_into("<Q", content, place, 2**42)
    path.write_bytes(content)
    code = f"try: print(pt.read({str(path)!r}))\nexcept pt.DataError as error: print(error)"
    done = child("import asammdf\n" + code, room=1_000_000_000)
    # What follows the compressed samples does not matter.
    assert done.stdout.startswith(("Dataset(", "log.mf4: ")), done.stderr[-500:]


@pytest.mark.parametrize("block", [b"##CN", b"##CG", b"##DG"])
def test_blocks_that_refer_to_themselves_are_refused(tmp_path: Path, block: bytes) -> None:
    """asammdf follows them without end."""
    path = write(tmp_path / "log.mf4")
    content = bytearray(path.read_bytes())
    place = content.index(block)
    struct.pack_into("<Q", content, place + 24, place)
    path.write_bytes(content)
    refusal(path)
