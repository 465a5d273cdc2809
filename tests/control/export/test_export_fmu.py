"""Units of FMI 2.0: valid, run by FMPy without Python inside, with the commands of Rust."""

from __future__ import annotations

import subprocess
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

import piezotrack as pt
from c_exports import loop, needs_linux

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = needs_linux
DT = 0.02


def unit_of(controller: pt.Controller, folder: Path, **options: Any) -> Path:
    (path,) = pt.control.export_controller(
        controller, folder, to="fmu", name="axis", **options
    ).files
    return path


def inputs(names: list[str], steps: int = 200) -> Any:
    rng = np.random.default_rng(1)
    signals = np.zeros(steps, dtype=[("time", float), *((name, float) for name in names)])
    signals["time"] = DT * np.arange(steps)
    signals["reference"] = 5e-5 + 3e-5 * np.sin(0.1 * np.arange(steps))
    signals["measured"] = 0.8 * signals["reference"] + 1e-7 * rng.standard_normal(steps)
    signals["measured"][50:53] = np.nan
    return signals


@pytest.mark.parametrize("name", ["PID", "repetitive", "Dahl", "all"])
def test_the_description_is_valid(name: str, tmp_path: Path) -> None:
    path = unit_of(loop(name), tmp_path)
    assert validate_fmu(str(path)) == []
    description = read_model_description(str(path))
    assert description.coSimulation.modelIdentifier == "axis"
    assert float(description.defaultExperiment.stepSize) == DT
    with zipfile.ZipFile(path) as archive:
        assert {one.filename for one in archive.infolist()} == {
            "modelDescription.xml",
            "sources/axis.c",
            "sources/axis.h",
            "sources/fmu.c",
            "binaries/linux64/axis.so",
        }
    # The same controller gives the same archive.
    before = path.read_bytes()
    assert unit_of(loop(name), tmp_path).read_bytes() == before


@pytest.mark.parametrize("name", ["PID", "Dahl"])
def test_its_commands_are_those_of_the_controller(name: str, tmp_path: Path) -> None:
    controller = loop(name)
    path = unit_of(controller, tmp_path)
    third = "next" if name == "Dahl" else "feedforward"
    unit, variables = slave(path)
    session = controller.start()
    signals = inputs([*("reference", "measured"), third])
    try:
        for k in range(200):
            desired, measured = (float(signals[key][k]) for key in ("reference", "measured"))
            ahead = float(signals["reference"][min(k + 1, 199)])
            given = {"preview": ahead} if name == "Dahl" else {"feedforward": 2.0}
            values = [desired, measured, ahead if name == "Dahl" else 2.0]
            unit.setReal([variables[key] for key in ("reference", "measured", third)], values)
            if k == 120:
                unit.setReal([variables["applied"]], [10.0])
                session.applied(10.0)
            unit.doStep(k * DT, DT)
            unit.setReal([variables["applied"]], [1e300])
            volts = session.step(desired, measured, **given)
            assert unit.getReal([variables["command"]]) == [volts]
            assert unit.getReal([variables["error"]]) == [session.last.error]
            flags = [variables[key] for key in ("saturated", "measurement_ok", "reference_ok")]
            last = session.last
            assert unit.getBoolean(flags) == [
                last.saturated,
                last.measurement_valid,
                last.reference_valid,
            ]
    finally:
        unit.terminate()
        unit.freeInstance()


def slave(path: Path) -> tuple[Any, dict[str, int]]:
    description = read_model_description(str(path))
    unit = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(str(path), str(path.parent / "unpacked")),
        modelIdentifier="axis",
        instanceName="one",
    )
    unit.instantiate()
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    return unit, {one.name: one.valueReference for one in description.modelVariables}


def test_a_table_needs_no_third_input(tmp_path: Path) -> None:
    plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
    one = pt.Controller(dt=DT, limits=(0.0, 75.0), feedforward=plays.inverse())
    motion = pt.sine(frequency=0.5, low=5e-6, high=40e-6, duration=4.0)
    path = unit_of(one, tmp_path, reference=motion)
    assert validate_fmu(str(path)) == []
    unit, variables = slave(path)
    assert sorted(variables)[0] == "applied"
    assert not {"feedforward", "next"} & set(variables)
    played = []
    for k in range(150):
        unit.doStep(k * DT, DT)
        played += unit.getReal([variables["command"]])
    table = plays.inverse().table(motion, DT)
    assert played == [*table, *table[:50]]
    unit.freeInstance()


def test_a_simulator_runs_it(tmp_path: Path) -> None:
    controller = loop("repetitive")
    path = unit_of(controller, tmp_path)
    signals = inputs(["reference", "measured", "feedforward"])
    run = simulate_fmu(
        str(path), stop_time=3.0, step_size=DT, output_interval=DT, input=signals,
        output=["command"],
    )  # fmt: skip
    session = controller.start()
    volts = [
        session.step(float(signals["reference"][k]), float(signals["measured"][k]))
        for k in range(150)
    ]
    # What a step gives is seen at its end.
    assert np.array_equal(run["command"][1:151], volts)


def test_other_steps_are_refused(tmp_path: Path) -> None:
    unit, _ = slave(unit_of(loop("PID"), tmp_path))
    with pytest.raises(Exception, match=r"fmi2Error|error"):
        unit.doStep(0.0, 0.3 * DT)
    unit.doStep(0.0, 3.0 * DT)
    unit.freeInstance()


def test_it_needs_no_python(tmp_path: Path) -> None:
    path = unit_of(loop("all"), tmp_path)
    library = f"{extract(str(path), str(tmp_path / 'unpacked'))}/binaries/linux64/axis.so"
    done = subprocess.run(["ldd", library], capture_output=True, text=True, check=True)
    needed = {line.split()[0].split(".so")[0].split("/")[-1] for line in done.stdout.splitlines()}
    assert needed <= {"linux-vdso", "libc", "ld-linux-x86-64", "ld-linux-aarch64"}


def test_without_a_compiler_it_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(pt.ParameterError, match="no C compiler was found"):
        unit_of(loop("PID"), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_compiler_that_is_asked_for_and_not_there_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "/nonexistent -O3")
    with pytest.raises(pt.ParameterError, match="CC is '/nonexistent', which cannot be run"):
        unit_of(loop("PID"), tmp_path / "out")
    assert not (tmp_path / "out").exists()
    monkeypatch.setenv("CC", "gcc -g0")
    assert unit_of(loop("PID"), tmp_path / "out").exists()


def test_on_another_machine_it_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    with pytest.raises(pt.ParameterError, match="not compiled on Linux, aarch64: expected to="):
        unit_of(loop("PID"), tmp_path / "out")
    assert not (tmp_path / "out").exists()
