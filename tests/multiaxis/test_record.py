"""Records of several axes: what is refused, and in which words."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.multiaxis import MultiAxisRecord, VirtualAxes, read_axes

if TYPE_CHECKING:
    from pathlib import Path

NOISE = np.random.default_rng(3).normal(size=(64, 3, 4, 2))


def record(**changed: Any) -> MultiAxisRecord:
    return MultiAxisRecord(**{"u": NOISE, "y": 1e-6 * NOISE, "dt": 1e-3, **changed})


def holed(value: float) -> np.ndarray:
    y = NOISE.copy()
    y[7, 1, 0, 1] = value
    return y


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"y": NOISE[:60]}, pt.ShapeError, "y has 60 samples: expected 64"),
        ({"y": NOISE[:, :, :3]}, pt.ShapeError, "y has 3 realisations: expected 4"),
        ({"y": NOISE[..., :1]}, pt.ShapeError, "y has 1 periods: expected 2"),
        ({"u": NOISE[:, 0, 0, 0]}, pt.ShapeError, "u has 1 dimensions"),
        ({"y": holed(np.nan)}, pt.DataError, r"y\[7, 1, 0, 1\] is nan: expected finite"),
        ({"u": 0.0 * NOISE}, pt.DataError, "drive 0 of u .* does not move"),
        ({"dt": 0.0}, pt.ParameterError, "dt is 0.0"),
        ({"periods": 3}, pt.ParameterError, "periods is 3: expected 2"),
        ({"u": [[1.0, 2.0], [3.0]]}, pt.ShapeError, "u has rows of unequal lengths"),
        ({"u": "ramp"}, pt.ShapeError, "u is 'ramp'"),
    ],
)
def test_a_record_that_does_not_fit_is_refused_in_one_sentence(
    changed: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words) as caught:
        record(**changed)
    assert "\n" not in str(caught.value)


def test_one_realisation_for_three_drives_is_refused() -> None:
    one = record(u=NOISE[:, :, :1], y=NOISE[:, :, :1])
    words = "1 realisation for 3 drives: expected 3 or more"
    for ask in (pt.multiaxis.approximate_axes, pt.multiaxis.identify_axes):
        with pytest.raises(pt.DataError, match=words):
            ask(one)


def test_realisations_that_repeat_each_other_are_refused() -> None:
    same = np.repeat(NOISE[:, :, :1, :1], 4, axis=2)
    with pytest.raises(pt.DataError, match="depend on each other"):
        pt.multiaxis.approximate_axes(record(u=same, y=same))


def test_what_leaks_into_a_line_does_not_excite_it() -> None:
    # An amplifier's distortion, 54 dB below the lines: a response there would be noise over it.
    made = VirtualAxes.xu_li_2010(noise=1e-9, seed=1).record(realisations=2, samples=256)
    free = np.setdiff1d(np.arange(1, 128), made.lines())[-1]
    size = 2e-3 * np.abs(np.fft.rfft(made.u[:, 0, 0, 0])).max() / 128
    leak = size * np.cos(2 * np.pi * free * np.arange(256) / 256)
    leaking = replace(made, u=made.u + leak[:, np.newaxis, np.newaxis, np.newaxis])
    np.testing.assert_array_equal(leaking.lines(), made.lines())


def test_drives_that_do_not_repeat_are_refused() -> None:
    with pytest.raises(pt.DataError, match=r"periods of the drives differ by .* % of their rms"):
        pt.multiaxis.approximate_axes(record())


def test_records_of_other_axes_or_of_one_level_are_refused() -> None:
    stage = pt.multiaxis.VirtualAxes.three(noise=1e-9)
    records = [stage.record(samples=256, level=level) for level in (1.0, 1.001)]
    with pytest.raises(pt.ParameterError, match="distinct levels"):
        pt.multiaxis.identify_axes(records, states=10)
    fewer = MultiAxisRecord(u=records[1].u[:, :2], y=2.0 * records[1].y, dt=records[1].dt)
    with pytest.raises(pt.ShapeError, match="2 drives in record 1: expected 3"):
        pt.multiaxis.identify_axes([records[0], fewer], states=10)


def test_periods_in_one_row_are_split() -> None:
    flat = np.concatenate([NOISE[..., 0], NOISE[..., 1]])
    split = record(u=flat, y=1e-6 * flat, periods=2)
    assert np.array_equal(split.u, NOISE)
    assert np.array_equal(split.y, 1e-6 * NOISE)


def test_records_are_joined_as_realisations() -> None:
    parts = [record().only([k]) for k in range(4)]
    assert np.array_equal(MultiAxisRecord.joined(parts).y, record().y)
    with pytest.raises(pt.ShapeError, match="record 1 has 32 samples"):
        MultiAxisRecord.joined([record(), record(u=NOISE[:32], y=NOISE[:32])])


def test_a_file_of_arrays_is_read_in_um(tmp_path: Any) -> None:
    path = tmp_path / "axes.npz"
    np.savez(path, u_1=NOISE, y_1=NOISE)
    read = MultiAxisRecord.from_npz(path, drive="u_1", output="y_1", dt=1e-3)
    assert np.array_equal(read.y, 1e-6 * NOISE)
    with pytest.raises(pt.DataError, match=r"has no array 'y_2': expected .* u_1, y_1"):
        MultiAxisRecord.from_npz(path, drive="u_1", output="y_2", dt=1e-3)
    with pytest.raises(pt.DataError, match="cannot be read"):
        MultiAxisRecord.from_npz(tmp_path / "none.npz", drive="u", output="y", dt=1e-3)


def test_records_in_files_of_numpy_are_read_as_logs_are(tmp_path: Path) -> None:
    made = VirtualAxes.three(noise=1e-9, seed=1).record(samples=64, realisations=3)
    flat = [np.concatenate([one[..., 0], one[..., 1]]) for one in (made.u, made.y)]
    np.savez(tmp_path / "own.npz", u=made.u, y=1e6 * made.y, dt=made.dt)
    np.savez(tmp_path / "flat.npz", v=flat[0], z=1e9 * flat[1])
    (own,) = read_axes(tmp_path / "own.npz", drives=["u"], displacements=["y"])
    (other,) = read_axes(
        tmp_path / "flat.npz",
        drives=["v"],
        displacements=["z"],
        dt=made.dt,
        units={"displacement": "nm"},
        period=64 * made.dt,
    )
    for record in (own, other):
        assert record.dt == made.dt
        assert (record.u == made.u).all()
        np.testing.assert_allclose(record.y, made.y, rtol=1e-14)
    with pytest.raises(pt.ParameterError, match="are a multiple"):
        read_axes(tmp_path / "flat.npz", drives=["v"], displacements=["z"], dt=made.dt, period=0.03)
    rows = np.random.default_rng(1).standard_normal((200, 2))
    table = np.column_stack([np.arange(200) * 0.01, rows])
    np.savetxt(tmp_path / "once.csv", table, delimiter=",", header="t_s,u_V,y_um", comments="")
    with pytest.raises(pt.DataError, match="no period was found in any drive"):
        read_axes(tmp_path / "once.csv", drives=["u_V"], displacements=["y_um"])
