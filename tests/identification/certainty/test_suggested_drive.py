"""The drive to measure next: its limits, and the deviations that it promises and keeps."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

import piezotrack as pt
from commands import ran, refusal

if TYPE_CHECKING:
    from piezotrack.identification import SuggestedDrive

Array = NDArray[np.float64]

NOISE, SLEW, DT, SECONDS = 2e-9, 2000.0, 2e-3, 2.0
MECHANICS: dict[str, Any] = {"mass": 0.05, "damping": 30.0, "stiffness": 5e4}
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=0.8e-6,
    thresholds=(5.0, 15.0, 30.0),
    weights=(0.15e-6, 0.1e-6, 0.08e-6),
    creep_weights=(0.02, 0.02),
    creep_times=(0.2, 2.0),
    time_constant=4e-3,
)
STAGES: dict[str, Any] = {
    "prandtl-ishlinskii": PLAYS,
    "dahl": pt.DahlStage.xu_li_2010(),
    "first-order-dahl": pt.stages.FirstOrderDahlStage(
        **MECHANICS, piezo_coefficient=0.06, rest_stiffness=8e3, coulomb_force=0.15
    ),
    "bouc-wen": pt.stages.BoucWenStage(
        **MECHANICS, piezo_coefficient=1.2e-6, alpha=0.25, beta=0.03, gamma=0.01
    ),
}
ALL = [
    pytest.param(name, marks=[] if name == "prandtl-ishlinskii" else pytest.mark.slow)
    for name in STAGES
]


def suggested(stage: Any, **changes: Any) -> SuggestedDrive:
    given = {"limits": (0.0, 75.0), "slew": SLEW, "seconds": SECONDS, "dt": DT, "noise": NOISE}
    return pt.suggest_drive(stage, **{**given, **changes})


def moved(stage: Any, names: list[str], shares: Array) -> Any:
    """Return a stage with values that differ by shares."""
    changes: dict[str, Any] = {}
    for name, share in zip(names, shares, strict=True):
        parameter, _, entry = name.rstrip("]").partition("[")
        value = changes.get(parameter, getattr(stage, parameter))
        if entry:
            k = int(entry)
            changes[parameter] = (*value[:k], value[k] * (1.0 + share), *value[k + 1 :])
        else:
            changes[parameter] = value * (1.0 + share)
    return replace(stage, **changes)


def obtained(stage: Any, names: list[str], u: Array, seeds: int) -> Array:
    """Relative deviation of the values that fit records with other noise."""
    fits = []
    for seed in range(seeds):
        log = pt.VirtualStage.of(stage, noise=NOISE, seed=seed).record(u, DT)

        def residual(factors: Array, y: Array = log.y) -> Array:
            rest = moved(stage, names, factors - 1.0).simulate(u, DT).x - y
            return np.asarray((rest - rest.mean()) / NOISE)

        start = np.ones(len(names))
        fits.append(least_squares(residual, start, method="lm", diff_step=1e-4).x)
    return np.asarray(np.std(fits, axis=0, ddof=1))


def multisine(drive: SuggestedDrive) -> Array:
    """Random multisine of the same length within limits and slew rate [V]."""
    lines = np.geomspace(0.5, 25.0, 12)
    reference = pt.multisine(
        frequencies=lines, amplitudes=lines**-0.5, low=0.0, high=75e-6, duration=SECONDS, seed=1
    )
    u = np.clip(1e6 * reference.sample(DT).x, 0.0, 75.0)
    # From rest at 0 V, as the suggested one.
    way = np.arange(0.0, u[0], SLEW * DT)
    u = np.concatenate([way, u])[: drive.u.size]
    assert u.size == drive.u.size
    assert np.abs(np.diff(u)).max() <= SLEW * DT
    return u


def relative(drive: SuggestedDrive) -> Array:
    return np.array([one.deviation / abs(one.value) for one in drive.parameters.values()])


@pytest.mark.parametrize("name", ALL)
def test_the_drive_keeps_to_limits_and_slew_rate_and_begins_and_ends_at_rest(name: str) -> None:
    drive = suggested(STAGES[name], limits=(10.0, 70.0), slew=700.0, seconds=1.0)
    assert drive.u.size == round(1.0 / DT)
    assert 10.0 <= drive.u.min() < 12.0
    assert 68.0 < drive.u.max() <= 70.0
    # Of 0 V the limit nearest.
    assert drive.u[0] == drive.u[-1] == 10.0
    for u in (drive.u, drive.sine):
        assert np.abs(np.diff(u)).max() <= 700.0 * DT * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ALL)
def test_the_promised_deviations_are_obtained_and_less_than_those_of_a_multisine(
    name: str,
) -> None:
    stage = STAGES[name]
    drive = suggested(stage)
    names, promised = list(drive.parameters), relative(drive)
    kept = obtained(stage, names, drive.u, 60)
    # Of 60 fits the deviation itself is known to a tenth; one of more than a fifth of the value
    # is beyond a straight line.
    near = promised < 0.2
    assert near.sum() >= len(names) - 1
    ratio = kept[near] / promised[near]
    assert (ratio < 1.5).all(), dict(zip(names, kept / promised, strict=True))
    assert (ratio > 1.0 / 1.5).all(), dict(zip(names, kept / promised, strict=True))
    other = obtained(stage, names, multisine(drive), 60)
    gain = other[near] / kept[near]
    # As a whole it is much better, and nowhere worse by more than chance.
    assert np.exp(np.log(gain).mean()) > 1.5, dict(zip(names, other / kept, strict=True))
    assert (gain > 0.7).all(), dict(zip(names, other / kept, strict=True))


def test_deviations_are_those_of_the_sensitivities_with_the_offset_projected_out() -> None:
    drive = suggested(PLAYS, seconds=1.0)
    names = list(drive.parameters)
    # A stage at the input is linear in its weights: one difference is exact for them.
    columns = []
    for k in range(len(names)):
        share = 1e-4 * np.eye(len(names))[k]
        up, down = (moved(PLAYS, names, way * share).simulate(drive.u, DT).x for way in (1, -1))
        columns.append((up - down) / 2e-4)
    jacobian = np.column_stack(columns)
    jacobian -= jacobian.mean(axis=0)
    covariance = NOISE**2 * np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(relative(drive), np.sqrt(np.diagonal(covariance)), rtol=2e-3)


def test_the_picture_has_the_parameters_that_are_determined_best() -> None:
    shares = np.random.default_rng(5).permutation(np.geomspace(1e-3, 4.0, 36))
    parameters = {
        f"weights[{k}]": pt.identification.ExpectedDeviation(1e-6, "m/V", 1e-6 * share, np.inf)
        for k, share in enumerate(shares)
    }
    drive = pt.identification.SuggestedDrive(
        u=np.linspace(0.0, 3.0, 100), dt=DT, limits=(0.0, 3.0), slew=SLEW, blocks=("ramp",),
        sine=np.zeros(100), parameters=parameters, noise=NOISE, drive_unit="V", seed=0, notes=(),
    )  # fmt: skip
    rows = [one.get_text() for one in drive.plot().axes[1].get_yticklabels()]
    assert rows == [f"weights[{k}]" for k in sorted(np.argsort(shares)[:12])]


def test_the_same_seed_gives_the_same_bits() -> None:
    first, again = (suggested(PLAYS, seconds=0.5) for _ in range(2))
    np.testing.assert_array_equal(first.u, again.u)
    assert first.document() == again.document()


def test_only_what_a_record_of_voltage_determines_is_in_the_table() -> None:
    found = suggested(STAGES["dahl"], seconds=0.5).parameters
    # Without a force scale the stiffness is nominal; `up` is held and b0 is 0.
    assert list(found) == ["mass", "damping", "piezo_coefficient", "a1", "a2", "b1"]
    low, high = found["a1"].interval
    assert high - low == pytest.approx(2.0 * 1.959964 * found["a1"].deviation)


def test_a_fit_is_compared_with_its_record_whose_slow_sine_shows_no_lag() -> None:
    t = np.arange(2000) * DT
    log = pt.VirtualStage.of(PLAYS, noise=NOISE, seed=1).record(
        37.5 - 37.5 * np.cos(2.0 * np.pi * 0.5 * t), DT
    )
    method = pt.LeastSquares(thresholds=(5.0, 15.0, 30.0), creep=[0.2, 2.0], dynamics="first")
    fit = pt.identify(log, "prandtl-ishlinskii", method=method)
    drive = suggested(fit, noise=None, limits=(0.0, 90.0), seconds=1.0)
    assert drive.noise == pytest.approx(NOISE, rel=0.1)
    lag = drive.parameters["time_constant"]
    assert lag.of_record is not None
    # Though the record is four times as long.
    assert lag.deviation < 0.1 * lag.of_record
    # The drive is faster than what was fitted, and says so.
    assert any("were not fitted" in note for note in drive.notes)
    assert any("0 to 90 V" in note for note in drive.notes)
    assert "record fitted" in drive.summary()


def test_more_than_a_hundred_per_cent_is_no_power_of_ten() -> None:
    drive = suggested(PLAYS, noise=5e-6)
    shares = [
        100.0 * each / abs(one.value)
        for one in drive.parameters.values()
        for each in (one.deviation, one.of_sine)
        if np.isfinite(each)
    ]
    assert max(shares) > 100.0
    table = drive.summary().partition("standard deviations")[2].splitlines()[2:]
    assert not any("e+" in cell for line in table for cell in line.split()[-2:])


def test_the_table_is_played_by_a_device(tmp_path: Path) -> None:
    drive = suggested(PLAYS, seconds=1.0)
    path = drive.save(tmp_path / "next.csv")
    device = pt.hardware.VirtualDevice(pt.VirtualStage.of(PLAYS, noise=NOISE, limits=(0.0, 75.0)))
    log = pt.measure(device, str(path), rate=1.0 / DT)
    np.testing.assert_allclose(log.u, drive.u[: log.u.size], atol=1e-7)
    assert log.u.size >= drive.u.size - 1


@pytest.mark.parametrize(
    ("changes", "argument"),
    [
        ({"limits": (75.0, 0.0)}, "limits"),
        ({"slew": 0.0}, "slew"),
        ({"slew": -5.0}, "slew"),
        ({"slew": 140.0}, "slew"),
        ({"seconds": 0.1}, "seconds"),
        ({"dt": 0.0}, "dt"),
        ({"noise": None}, "noise"),
        ({"noise": -1e-9}, "noise"),
    ],
)
def test_what_cannot_be_done_is_refused_by_name(changes: dict[str, Any], argument: str) -> None:
    with pytest.raises(pt.ParameterError) as refused:
        suggested(PLAYS, **changes)
    assert refused.value.argument is not None
    assert refused.value.argument.startswith(argument)
    with pytest.raises(pt.ParameterError, match="model is"):
        suggested("dahl")


@pytest.mark.usefixtures("_no_pictures")
def test_the_command_writes_drive_figures_and_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    t = np.arange(1000) * DT
    log = pt.VirtualStage.of(PLAYS, noise=NOISE).record(37.5 - 37.5 * np.cos(6.0 * t), DT)
    pt.identify(log, "prandtl-ishlinskii", method=pt.LeastSquares(count=3)).save("model.json")
    common = ("suggest", "model.json", "--slew", "2000", "--duration", "1", "--dt", "0.002")
    printed = ran(*common, "--limits", "0:75")
    assert "piezotrack measure results/suggested.csv --device ADDRESS --rate 500Hz" in printed
    document = json.loads(Path("results/suggested.json").read_text(encoding="utf-8"))
    assert document["samples"] == 500
    assert document["parameters"]["linear"]["standard_deviation"] > 0.0
    assert pt.hardware.parse_drive("results/suggested.csv").duration == pytest.approx(0.998)
    assert "--limits" in refusal(*common, "--limits", "75:0", "--overwrite")
    assert "--noise" in refusal(*common, "--limits", "0:75", "--overwrite", "--noise", "0nm")
