"""A drive that is a position, as the height (piezo) of an AFM, is a drive like any other."""

from __future__ import annotations

import json
import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import piezotrack as pt
from commands import names, ran, refusal, run
from piezotrack.identification.views.plot import plot_loop

GAIN = 0.9
THRESHOLDS, WEIGHTS = (2e-6, 6e-6), (0.2, 0.1)
PLAYS = pt.identification.LeastSquares(
    thresholds=THRESHOLDS, dead_zones=False, creep=False, dynamics=None
)


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def height(drive_unit: str = "m", scale: float = 1.0) -> pt.Dataset:
    """A piezo of 40 um whose sensor shows 50 um, as in the curves of an AFM."""
    t = np.arange(3000) / 500.0
    u = 20e-6 * (1.0 - np.cos(np.pi * t)) * np.where(t < 4.0, 1.0, 0.6)
    stage = pt.PrandtlIshlinskiiStage(linear=GAIN, thresholds=THRESHOLDS, weights=WEIGHTS)
    y = stage.simulate(u, 1 / 500.0).x
    return pt.Dataset(u=scale * u, y=y, t=t, drive_unit=drive_unit)


def write_log(header: str = "time [s],height (piezo) [um],height (measured) [um]") -> None:
    log = height()
    table = np.column_stack([log.t, 1e6 * log.u, 1e6 * log.y])
    np.savetxt("curve.csv", table, delimiter=",", header=header, comments="", fmt="%.12g")


@pytest.mark.parametrize(
    "header",
    [
        "time [s],height (piezo) [um],height (measured) [um]",
        "time_s,setpoint_um,x_um",
        "time_s,command (um),measured (um)",
        "time_s,Drive [um],Position [um]",
    ],
)
def test_a_log_with_two_displacements_is_read(header: str) -> None:
    write_log(header)
    log = pt.read("curve.csv")
    assert log.drive_unit == "m"
    assert np.allclose(log.u, height().u, rtol=1e-9, atol=1e-15)
    assert np.allclose(log.y, height().y, rtol=1e-9, atol=1e-15)


def test_units_of_heights_can_be_given() -> None:
    write_log("time_s,height (piezo),height (measured)")
    with pytest.raises(pt.DataError, match=r"'height \(piezo\)' has no unit"):
        pt.read("curve.csv")
    log = pt.read("curve.csv", units={"drive": "um", "displacement": "um"})
    assert log.drive_unit == "m"
    assert log.stroke == pytest.approx(height().stroke)
    # A number that is called nm is a thousandth of one in um.
    log = pt.read("curve.csv", units={"height (piezo)": "nm", "displacement": "um"})
    assert log.u.max() == pytest.approx(1e-3 * height().u.max())


def test_which_column_is_the_drive_stays_clear() -> None:
    write_log("time_s,x_um,y_um")
    with pytest.raises(pt.DataError, match="no column is known to be the drive"):
        pt.read("curve.csv")
    write_log("time_s,setpoint_um,command_um")
    with pytest.raises(pt.DataError, match="several columns could be the drive"):
        pt.read("curve.csv")
    # A voltage is the drive, and the position that was asked for is not.
    Path("closed.csv").write_text(
        "time_s,setpoint_um,voltage_V,x_um\n0,0,1,0\n1,5,2,4\n2,9,3,8\n", encoding="utf-8"
    )
    log = pt.read("closed.csv")
    assert (log.drive_unit, list(log.u)) == ("V", [1.0, 2.0, 3.0])


def test_the_fit_is_that_of_the_same_numbers_in_volts() -> None:
    fit = pt.identify(height(), "prandtl-ishlinskii", method=PLAYS)
    assert fit.model.linear == pytest.approx(GAIN, rel=1e-6)
    assert fit.model.weights == pytest.approx(WEIGHTS, rel=1e-6)
    for kind, known in (("dahl", {}), ("bouc-wen", {"exponent": 1.0})):
        here, volts = (
            pt.identify(log, kind, parameters=known, method=pt.Descents(seed=1))
            for log in (height(), height("V", 1e6))
        )
        assert here.cost == pytest.approx(volts.cost, rel=0.01)


@pytest.mark.parametrize("kind", ["prandtl-ishlinskii", "dahl", "bouc-wen"])
def test_no_volt_is_spoken_of(kind: str) -> None:
    fit = pt.identify(height(), kind, method=[pt.Descents(seed=1), pt.LeastSquares()])
    words = [fit.summary(), *fit.extrapolation_notes(3.0 * height().u, 1e-4)]
    assert len(words) == 3
    assert height().plot().axes[0].get_ylabel() == "drive [\N{MICRO SIGN}m]"
    axes = plot_loop(height(), fit.simulate(height()))
    words += [axes.get_xlabel()]
    assert axes.get_xlabel() == "drive [\N{MICRO SIGN}m]"
    assert np.max(axes.lines[0].get_xdata()) == pytest.approx(40.0, rel=1e-3)
    plt.close("all")
    for text in words:
        assert "V" not in text.replace("Voltage", ""), text
    assert "um/um" in fit.summary()
    assert "from 0 to 120 um, that of the record identified from 0 to 40 um" in words[1]


def test_a_model_file_keeps_the_unit() -> None:
    fit = pt.identify(height(), "prandtl-ishlinskii", method=PLAYS)
    fit.save("piezo.json")
    document = json.loads(Path("piezo.json").read_text())
    units = {name: entry["unit"] for name, entry in document["parameters"].items()}
    assert (units["thresholds"], units["weights"]) == ("m", "m/m")
    model = pt.load("piezo.json")
    assert (model.drive_unit, model.model) == ("m", fit.model)
    assert model.score(height()).rms < 1e-9
    with pytest.raises(pt.ParameterError, match="data has a drive in V: expected m"):
        model.score(height("V", 1e6))


@pytest.mark.usefixtures("_no_pictures")
def test_the_commands_take_it() -> None:
    write_log()
    printed = ran("identify", "curve.csv", "--model", "prandtl-ishlinskii", "--test", "curve.csv")
    assert "V" not in printed
    assert names("results") == ["prandtl-ishlinskii.json"]
    table = np.column_stack([height().t, 1e9 * height().u])
    np.savetxt("drive.csv", table, delimiter=",", header="time_s,setpoint_nm", comments="")
    printed = ran("simulate", "results/prandtl-ishlinskii.json", "drive.csv")
    assert "drive from 0 to 40 um: displacement" in printed
    back = pt.read("results/simulated.csv")
    assert np.allclose(back.u, height().u, atol=1e-14)
    assert np.allclose(back.y, height().y, atol=20e-9)
    model = "results/prandtl-ishlinskii.json"
    printed = ran("feedforward", model, "sine:1Hz,5..40um", "--dt", "0.002")
    assert " V" not in printed
    assert re.search(r"samples, drive from [\d.]+ to [\d.]+ um\n", printed)
    drive = pt.read("results/feedforward.csv")
    # What the piezo is asked for brings about what was wanted.
    assert np.ptp(pt.load(model).simulate(drive).x[500:]) == pytest.approx(35e-6, rel=0.01)
    paper = ("--stage", "xu-li-2010")
    message = refusal("track", model, "sine:1Hz,5..40um", *paper)
    assert message.startswith("prandtl-ishlinskii.json: the drive of this model is a position")
    Path("volts.csv").write_text("time_s,voltage_V\n0,0\n1,1\n2,0\n3,1\n", encoding="utf-8")
    message = refusal("simulate", "results/prandtl-ishlinskii.json", "volts.csv")
    assert message.startswith("volts.csv: the drive is in V: expected um")


@pytest.mark.usefixtures("_no_pictures")
def test_auto_takes_it() -> None:
    write_log()
    result = run("identify", "curve.csv", "--runs", "1", "--seed", "1")
    assert result.exit_code == 0
    assert "prandtl-ishlinskii.json" in names("results")
    assert "V" not in result.stdout


@pytest.mark.slow
def test_closed_loops_take_it() -> None:
    """Limits in um, gains in um/um: the same loop as with the same numbers in volts."""
    write_log()
    ran("identify", "curve.csv", "--model", "prandtl-ishlinskii")
    course = ("sine:1Hz,5..40um,4s", "--dt", "0.002", "--kp", "0.1", "--ti", "0.02")
    model = "results/prandtl-ishlinskii.json"
    printed = ran("track", model, *course, "--limits", "0:45", "--repetitive")
    assert not re.search(r"\bV\b", printed)
    assert re.search(r"loop at [\d.]+ um/um: stable", printed)
    rows = np.genfromtxt("results/tracking.csv", delimiter=",", names=True)
    assert {"drive_um", "feedforward_um", "feedback_um"} <= set(rows.dtype.names or ())
    assert 0.0 <= rows["drive_um"].min() < 20.0 < rows["drive_um"].max() <= 45.0
    late = rows["time_s"] > 2.0
    assert np.abs(rows["desired_um"] - rows["measured_um"])[late].max() < 0.5
    match = refusal("track", model, *course[:3], "--kp", "900", "--ti", "0.02", "--overwrite")
    assert re.search(r"on this stage, [\d.]+ um/um; at the limit kp would be [\d.]+ um/um", match)
    match = refusal("track", model, "sine:1Hz,5..400um", "--overwrite")
    assert re.search(r"which this stage reaches from [\d.]+ to [\d.]+ um", match)
    two = ("contour", model, "circle:1Hz,5um", "--kp", "0.1", "--ti", "0.02")
    assert not re.search(r"\bV\b", ran(*two, "--dt", "0.002"))


def test_a_session_in_python_has_its_unit() -> None:
    fit = pt.identify(height(), "prandtl-ishlinskii")
    loop = pt.Controller.of(fit, feedback=pt.Pid(kp=0.1, ti=0.02))
    assert loop.drive_unit == "m"
    assert " V" not in repr(loop) + repr(loop.start()) + str(pt.check_loop(fit, loop))
    volts = pt.Controller(dt=loop.dt, limits=loop.limits)
    with pytest.raises(pt.ParameterError, match="controller has the drive_unit 'V': expected that"):
        pt.track(fit, volts, pt.sine(frequency=1.0, low=5e-6, high=40e-6, duration=2.0))
    with pytest.raises(pt.ParameterError, match="drive_unit is 'um': expected 'V', 'm' or 'N'"):
        pt.Controller(dt=0.01, limits=(0.0, 1.0), drive_unit="um")
