"""Model files: bit for bit there and back, whole or not at all, refused in words."""

from __future__ import annotations

import hashlib
import json
import math
import re
from dataclasses import asdict, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from folders import ROOT
from records import HELD, published, quick, quick_fit, search_of

if TYPE_CHECKING:
    from collections.abc import Callable

NAMES = ("mass", "damping", "stiffness", "piezo_coefficient", "a1", "a2", "b1", "b0", "up")


FILES = ROOT / "tests" / "files"


@cache
def fitted() -> pt.identification.Identification:
    return quick_fit(data=quick()[1.0:3.0])


def content_of(path: Path) -> dict[str, Any]:
    def refuse(text: str) -> None:
        raise AssertionError(f"{text} is not JSON")

    text = path.read_text(encoding="utf-8")
    assert text.isascii()
    assert text.endswith("}\n")
    content: dict[str, Any] = json.loads(text, parse_constant=refuse)
    return content


def in_bits(model: pt.identification.IdentifiedModel) -> list[str]:
    stage = asdict(model.model)
    return [stage[name].hex() for name in NAMES] + [model.offset.hex(), model.stroke.hex()]


# There and back.

SMALLEST, LARGEST = 5e-324, 1.7976931348623157e308
ODD = [SMALLEST, 2.2250738585072014e-308, LARGEST, 0.1, 1 / 3, 1e22, 9007199254740993.0, 5e-7]


def any_model(draw: np.random.Generator) -> pt.identification.IdentifiedModel:
    """Numbers of any size, from their bits, and some that printing gets wrong easily."""
    numbers = draw.integers(0, 2**63, 40, dtype=np.uint64).view(np.float64)
    sizes = [*numbers[np.isfinite(numbers) & (numbers > 0.0)].tolist(), *draw.choice(ODD, 10)]
    signed = [float(size * draw.choice([-1.0, 1.0])) for size in draw.permutation(sizes)]
    sizes = [abs(number) for number in signed]
    stage = pt.DahlStage(
        mass=sizes[0],
        damping=sizes[1],
        stiffness=sizes[2],
        piezo_coefficient=signed[3],
        a1=sizes[4],
        a2=sizes[5],
        b1=signed[6],
        up=signed[7],
    )
    return published(
        model=stage,
        # Offsets of a metre are refused.
        offset=next(number for number in signed[8:] if abs(number) < 1.0),
        stroke=sizes[9],
        offset_fitted=bool(draw.integers(2)),
        scale_assumed=bool(draw.integers(2)),
    )


@pytest.mark.parametrize("seed", range(100))
def test_there_and_back_bit_for_bit(tmp_path: Path, seed: int) -> None:
    model = any_model(np.random.default_rng(seed))
    path = model.save(tmp_path / "dahl.json")
    content_of(path)
    back = pt.load(path)
    assert in_bits(back) == in_bits(model)
    assert back.offset_fitted == model.offset_fitted
    assert isinstance(back, pt.identification.IdentifiedModel)
    assert back.scale_assumed == model.scale_assumed


def test_the_intervals_of_a_file_are_those_of_the_fit(tmp_path: Path) -> None:
    fit = fitted()
    back = pt.load(fit.save(tmp_path / "dahl.json"))
    assert fit.covariance is not None
    assert back.covariance is not None
    for name in fit.covariance.names:
        assert back.covariance.interval(name) == fit.covariance.interval(name)
    np.testing.assert_array_equal(back.covariance.matrix, fit.covariance.matrix)
    assert back.covariance.shares == fit.covariance.shares
    assert back.zeroed().covariance is back.covariance
    assert back.document()["covariance"] == fit.document()["covariance"]


def test_zeros_keep_their_sign(tmp_path: Path) -> None:
    stage = replace(pt.DahlStage.xu_li_2010(), damping=0.0, a1=0.0, a2=-0.0, b1=-0.0)
    model = published(model=stage, offset=-0.0)
    assert in_bits(pt.load(model.save(tmp_path / "dahl.json"))) == in_bits(model)


def test_a_loaded_model_scores_the_same(tmp_path: Path) -> None:
    fit = fitted()
    back = pt.load(str(fit.save(str(tmp_path / "dahl.json"))))
    assert type(back) is pt.identification.IdentifiedModel
    assert back.model == fit.model
    for log in (fit.data, quick(5), quick()[2.0:]):
        assert back.score(log) == fit.score(log)
        assert back.score(log, offset=fit.offset) == fit.score(log, offset=fit.offset)
        assert back.simulate(log).x.tobytes() == fit.simulate(log).x.tobytes()


def test_same_result_same_file(tmp_path: Path) -> None:
    first = fitted().save(tmp_path / "first.json").read_bytes()
    assert fitted().save(tmp_path / "second.json").read_bytes() == first
    again = quick_fit(data=quick()[1.0:3.0], threads=1)
    assert again.save(tmp_path / "again.json").read_bytes() == first
    back = pt.load(tmp_path / "first.json")
    assert back.save(tmp_path / "first.json").read_bytes() == first


# Files of earlier versions.


def test_a_file_of_version_1_is_read_with_the_names_of_today(tmp_path: Path) -> None:
    file = FILES / "prandtl_ishlinskii_version_1.json"
    old = json.loads(file.read_text())["parameters"]
    known = pt.load(file)
    assert isinstance(known.model, pt.PrandtlIshlinskiiStage)
    names = {
        "dead_zone_thresholds": "corners",
        "dead_zone_weights": "bends",
        "creep_weights": "creep_shares",
    }
    for name in known.model.parameter_names():
        if name.startswith("mode_"):
            # No model had several modes then.
            assert getattr(known.model, name) == ()
            continue
        value = old[names.get(name, name)]["value"]
        assert getattr(known.model, name) == (tuple(value) if isinstance(value, list) else value)
    assert known.offset == json.loads(file.read_text())["offset"]["value"]
    assert (known.delay, known.scale_assumed) == (0.0, False)
    # w0, two weights, two dead zones, one relaxation, a lag, the offset.
    assert known.free_count == 8
    path = known.save(tmp_path / "new.json")
    content = content_of(path)
    assert content["schema_version"] == 2
    assert set(names) < set(content["parameters"])
    assert not set(names.values()) & set(content["parameters"])
    assert pt.load(path) == known


def test_a_searched_model_of_version_1_is_the_same_in_version_2(tmp_path: Path) -> None:
    known = pt.load(FILES / "dahl_version_1.json")
    assert known.model == pt.DahlStage.xu_li_2010()
    assert (known.offset, known.stroke, known.delay) == (1e-6, 119e-6, 0.002)
    assert known.free_count is None
    assert pt.load(known.save(tmp_path / "new.json")) == known


# What the file says.


def test_the_file_has_units_and_a_schema_version(tmp_path: Path) -> None:
    fit = fitted()
    content = content_of(fit.save(tmp_path / "dahl.json"))
    assert content["format"] == "piezotrack-model"
    assert content["schema_version"] == 2
    assert content["model"] == "dahl"
    assert content["scale_assumed"] is False
    assert content["offset"] == {"value": fit.offset, "unit": "m", "fitted": True}
    assert content["stroke"] == {"value": fit.data.stroke, "unit": "m"}
    units = {name: entry["unit"] for name, entry in content["parameters"].items()}
    assert units == {
        "mass": "kg",
        "damping": "N s/m",
        "stiffness": "N/m",
        "piezo_coefficient": "N/V",
        "a1": "1/m",
        "a2": "1/m^2",
        "b1": "N/m^2",
        "b0": "N/m",
        "up": "",
        "creep_weights": "",
        "creep_times": "s",
    }
    for name, estimate in fit.parameters.items():
        entry = content["parameters"][name]
        assert entry["value"] == getattr(fit.model, name)
        assert entry["free"] == estimate.free
        assert entry["standard_deviation"] == estimate.deviation
        assert entry["bounds"] == (list(estimate.bounds) if estimate.bounds else None)
    assert content["fit"]["cost"] == {"value": fit.cost, "unit": "m"}
    assert content["fit"]["stop_reason"] == fit.stop_reason
    assert content["fit"]["iterations"] == search_of(fit).nit
    assert content["fit"]["simulations"] == fit.nfev


def test_the_file_says_where_the_numbers_come_from(tmp_path: Path) -> None:
    provenance = content_of(fitted().save(tmp_path / "dahl.json"))["provenance"]
    assert provenance["package"] == "piezotrack"
    assert provenance["version"] == pt.__version__ == version("piezotrack")
    assert provenance["seed"] == 1
    assert provenance["swarm"] == fitted().method.settings()
    data = provenance["data"]
    # The hash as the documentation has it: dt, the drive and displacement kept, the warm-up.
    kept = quick()[:3.0]
    hashed = b"".join(
        np.asarray(part, dtype="<f8").tobytes() for part in (kept.dt, kept.u, kept.y, 250)
    )
    assert data["sha256"] == hashlib.sha256(hashed).hexdigest() == fitted().data.sha256
    assert (data["source"], data["samples"], data["warmup_samples"]) == ("quick.csv", 500, 250)
    assert data["window_s"] == pytest.approx([1.0, 2.996])
    assert data["dt_s"] == quick().dt
    assert data["hold"] == "foh"


def test_what_is_not_finite_is_saved_as_null(tmp_path: Path) -> None:
    # Without a hysteresis force, a1 and a2 have no effect on the data.
    fit = quick_fit(
        fixed={"b1": 0.0, "stiffness": 26065.0},
        bounds={},
        swarm=pt.ParticleSwarm(particles=12, iterations=30, velocity_limit=math.inf),
    )
    assert fit.parameters["a2"].deviation == math.inf
    assert "no effect on the data" in fit.summary()
    path = fit.save(tmp_path / "dahl.json")
    content = content_of(path)
    assert content["parameters"]["a2"]["standard_deviation"] is None
    assert content["provenance"]["swarm"]["velocity_limit"] is None
    assert pt.load(path).model == fit.model


# Whole or not at all.


def half_written(path: Path, text: str, **_: Any) -> int:
    with path.open("w") as file:
        file.write(text[: len(text) // 2])
    raise OSError(28, "No space left on device")


def interrupted(path: Path, text: str, **_: Any) -> int:
    with path.open("w") as file:
        file.write(text[: len(text) // 2])
    raise KeyboardInterrupt


def not_renamed(path: Path, target: Path) -> Path:
    raise PermissionError(13, f"Permission denied: {path} to {target}")


@pytest.mark.parametrize(
    ("method", "failure", "error"),
    [
        ("write_text", half_written, pt.DataError),
        ("write_text", interrupted, KeyboardInterrupt),
        ("replace", not_renamed, pt.DataError),
    ],
)
def test_a_file_that_cannot_be_written_leaves_the_old_one(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    method: str,
    failure: Callable[..., Any],
    error: type[BaseException],
) -> None:
    path = published().save(tmp_path / "dahl.json")
    before = path.read_bytes()
    monkeypatch.setattr(Path, method, failure)
    with pytest.raises(error) as caught:
        fitted().save(path)
    monkeypatch.undo()
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    if isinstance(caught.value, pt.DataError):
        assert str(caught.value).startswith(f"{path} cannot be written: ")


def test_a_model_that_is_not_one_is_not_saved(tmp_path: Path) -> None:
    # A file that load refuses would be found out when the fit is gone.
    refused: list[dict[str, Any]] = [
        *({"offset": value} for value in (math.nan, "1", 5.0)),
        *({"stroke": value} for value in (math.inf, 0.0)),
        *({"delay": value} for value in (-1e-3, 1e4)),
    ]
    for changes in refused:
        with pytest.raises(pt.ParameterError):
            published(**changes).save(tmp_path / "dahl.json")
        assert not any(tmp_path.iterdir())


def test_says_where_it_cannot_write(tmp_path: Path) -> None:
    with pytest.raises(pt.DataError, match=r"gone.dahl\.json cannot be written: no such file"):
        published().save(tmp_path / "gone" / "dahl.json")
    with pytest.raises(pt.DataError, match=r"cannot be written: is a directory"):
        published().save(tmp_path)
    assert not any(tmp_path.iterdir())


# On records.


def test_a_score_wants_a_dataset() -> None:
    with pytest.raises(pt.ParameterError, match=r"data is \(.*: expected a Dataset"):
        published().score((quick().u, quick().y))  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match="offset is 'none'"):
        published().score(quick(), offset="none")  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match="offset is"):
        published().score(quick(), offset=math.nan)


def test_offsets_of_a_record_of_its_own() -> None:
    moved = pt.Dataset(u=quick().u, y=quick().y + 2e-6, dt=quick().dt)
    own = published().score(moved)
    assert own.offset == pytest.approx(2e-6, abs=2e-8)
    assert own.rms == pytest.approx(0.1e-6, rel=0.1)
    given = published().score(moved, offset=1e-6)
    assert given.offset == 1e-6
    assert given.rms == pytest.approx(1e-6, rel=0.02)
    none = published(offset_fitted=False).score(moved)
    assert none.offset == 0.0
    assert none.rms == pytest.approx(2e-6, rel=0.02)
    assert none.rms_percent == pytest.approx(100.0 * none.rms / 119e-6)
    assert none.max_percent == pytest.approx(100.0 * none.max_error / 119e-6)
    explained = 1.0 - np.linalg.norm(moved.y - published().model.simulate(moved.u, moved.dt).x) / (
        np.linalg.norm(moved.y - moved.y.mean())
    )
    assert none.fit_percent == pytest.approx(100.0 * explained, rel=1e-6)
    pattern = (
        r"rms [\d.]+ um \(1\.68 % of stroke\), max [\d.]+ um \(.* %\) at [\d.]+ s, fit 95\.\d+ %"
    )
    assert re.fullmatch(pattern, str(none))


def test_the_held_are_held(tmp_path: Path) -> None:
    content = content_of(fitted().save(tmp_path / "dahl.json"))
    assert {n: content["parameters"][n]["value"] for n in HELD} == HELD
