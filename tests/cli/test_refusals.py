"""The command given bad input: one sentence, exit code 2, nothing written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import piezotrack as pt
from commands import HEADER, column, lines_with, log_text, refusal, run, write, write_model

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(log_text(), encoding="utf-8")


# The file, the line that is named, and pieces of the sentence.
BAD_LOGS: dict[str, tuple[Callable[[], str | bytes], int | None, tuple[str, ...]]] = {
    "empty": (lambda: "", None, ("is empty", "is empty: expected a log")),
    "only a header": (lambda: HEADER + "\n", 1, ("no samples",)),
    "no displacement": (
        lambda: lines_with(1, "time_s,voltage_V,strain"),
        1,
        ("displacement", "'strain'"),
    ),
    "text": (lambda: lines_with(6, "0.016,high,1.0"), 6, ("'high'", "'voltage_V'", "number")),
    "nothing": (lambda: lines_with(6, "0.016,,1.0"), 6, ("'voltage_V'", "empty")),
    "NaN": (lambda: lines_with(6, "0.016,1.0,nan"), 6, ("'nan'", "'displacement_um'", "finite")),
    "infinity": (lambda: lines_with(6, "0.016,inf,1.0"), 6, ("'inf'", "'voltage_V'", "finite")),
    "a short line": (lambda: lines_with(6, "0.016,1.0"), 6, ("2 fields", "expected 3")),
    "a long line": (lambda: lines_with(6, "0.016,1.0,2.0,3.0"), 6, ("4 fields", "expected 3")),
    "cut off": (lambda: log_text()[: log_text().rfind(",")], 1002, ("2 fields", "cut off")),
    "time backwards": (
        lambda: lines_with(6, "0.008,1.0,1.0"),
        6,
        ("'time_s'", "goes from", "increasing"),
    ),
    "a gap": (lambda: lines_with(6), 6, ("'time_s'", "not even", "0.008 s")),
    "an unknown unit": (
        lambda: lines_with(1, "time_s,voltage [furlong],displacement_um"),
        1,
        ("furlong", "V, mV"),
    ),
    "no unit": (lambda: lines_with(1, "time_s,voltage,displacement_um"), 1, ("no unit",)),
    "constant drive": (lambda: column(1, "5"), None, ("drive is constant at 5 V", "expected")),
    "dead sensor": (lambda: column(2, "7"), None, ("displacement is constant", "sensor")),
    "binary": (lambda: bytes(range(256)) * 10, 1, ("is not a text log",)),
    "an archive": (lambda: b"PK\x03\x04" + bytes(100), None, ("is a zip archive", "expected")),
}


@pytest.mark.parametrize("name", BAD_LOGS)
def test_refuses_a_bad_log(name: str) -> None:
    content, line, pieces = BAD_LOGS[name]
    write("bad.csv", content())
    sentence = refusal("identify", "bad.csv")
    assert sentence.startswith(f"bad.csv:{line}: " if line else "bad.csv: ")
    assert sentence.count("bad.csv") == 1
    for piece in pieces:
        assert piece in sentence
    assert not any(Path().rglob("*.json"))
    # The same for the log that judges, and it is read before the search.
    if name not in ("constant drive", "dead sensor"):
        assert refusal("identify", "log.csv", "--test", "bad.csv") == sentence


@pytest.mark.parametrize(
    ("wrong", "option", "value"),
    [
        (("--duration", "0.01"), "--duration", "0.01 s"),
        (("--slew", "1V/s"), "--slew", "1 V/s"),
        (("--limits", "3..0V"), "--limits", "(3, 0)"),
        (("--rate", "1Hz"), "--duration", "4 s"),
        (("--limits", "0:3um"), "--limits", "in um"),
        (("--duration", "1e9s"), "--duration", "1e+09 s"),
    ],
)
def test_suggest_blames_the_option_and_not_the_model(
    wrong: tuple[str, ...], option: str, value: str
) -> None:
    write_model()
    usual = ("--limits", "0:3V", "--slew", "20V/s", "--duration", "4s", "--rate", "200Hz")
    sentence = refusal("suggest", "dahl.json", *usual, "--noise", "5nm", *wrong)
    assert sentence.startswith(f"{option} ")
    assert value in sentence
    assert "dahl.json" not in sentence


def test_a_file_is_named_once() -> None:
    for command in ("noise", "identify", "step"):
        sentence = refusal(command, "log.csv", "--window", "1000:")
        assert sentence.count("log.csv") == 1
        assert "--window" in sentence


BAD_DRIVES = ("empty", "text", "infinity", "a short line", "a gap", "an unknown unit", "binary")


@pytest.mark.parametrize("name", BAD_DRIVES)
def test_refuses_a_bad_drive(name: str) -> None:
    content, line, pieces = BAD_LOGS[name]
    write("bad.csv", content())
    write_model()
    sentence = refusal("simulate", "dahl.json", "bad.csv", "--out", "run")
    assert sentence.startswith(f"bad.csv:{line}: " if line else "bad.csv: ")
    for piece in pieces:
        assert piece in sentence
    assert not Path("run").exists()


TUNE = "tune dahl.json --dt 0.02 --limits 0:75"
COMPARE = "compare-controllers dahl.json --dt 0.02 --limits 0:75 --frequencies 0.5,1,2"
MEASURE = "measure --device virtual: --rate 100"
PLAY = "play --device virtual:"
LEARN = "learn dahl.json --dt 0.02 --limits 0:75 sine:0.5Hz,10..60um,4s"
BAD_ARGUMENTS: dict[str, tuple[str, ...]] = {
    "identify gone.csv": ("gone.csv: there is no such file",),
    "identify .": ("is a directory",),
    "identify log.csv --window 5": ("--window is '5'", "expected A:B"),
    "identify log.csv --window a:b": ("--window has 'b'", "number"),
    "identify log.csv --window 30:40": ("log.csv", "--window", "30 s to 40 s", "0 s to 4 s"),
    "identify log.csv --window 3:1": ("--window", "3 s to 1 s", "start < stop"),
    "identify log.csv --window nan:3": ("start is nan",),
    "identify log.csv --window 1:1.02": ("the window has 5 samples",),
    "identify log.csv --model dahl --bound mass=0.2:0.1": (
        "bounds of mass",
        "(0.2, 0.1)",
        "lower one first",
    ),
    "identify log.csv --model dahl --bound mass=0.2..0.1": ("(0.2, 0.1)", "lower one first"),
    "identify log.csv --bound mass=1": ("--bound", "'1'", "LOW:HIGH"),
    "identify log.csv --bound mass=a:b": ("--bound has 'a'", "number"),
    "identify log.csv --model dahl --prior mass=1": ("--prior", "'1'", "VALUE:WIDTH"),
    "identify log.csv --model dahl --prior mass=1:x": ("--prior has 'x'", "number"),
    "identify log.csv --model dahl --tie b1": ("--tie is 'b1'", "NAME="),
    "identify log.csv --model dahl --tie b1=2*": ("tie of b1", "'2*'", "at its end"),
    "identify log.csv --model dahl --tie b1=a2 --bound b1=1:2": ("tie of b1", "no bounds"),
    "identify log.csv --model dahl --scale mass=ln": ("scale of mass", "'ln'", "'log'"),
    "identify log.csv --model dahl --constrain mass": ("constraint", "'mass'", "'a < b'"),
    "identify log.csv --tie b1=a2": ("--tie", "--model dahl"),
    "identify log.csv --bound mass": ("--bound is 'mass'", "NAME="),
    "identify log.csv --model dahl --bound weight=1:2": ("'weight'", "one of mass, damping"),
    "identify log.csv --model dahl --fix mass=-1": ("mass is -1", "above 0"),
    "identify log.csv --fix mass=heavy": ("--fix has 'heavy'", "number"),
    "identify log.csv --fix mass": ("--fix is 'mass'", "NAME=VALUE"),
    "identify log.csv --model dahl --fix mass=nan": ("mass is NaN", "finite"),
    "identify log.csv --model dahl --fix weight=1": ("'weight'", "one of mass, damping"),
    "identify log.csv --model dahl --fix b0=nan": ("b0 is NaN", "finite"),
    "identify log.csv --sensor-delay -1": ("delay is -1 s", "0 s or above"),
    "identify log.csv --sensor-delay 5s:1s": ("delay is (5, 1) s", "the lower bound first"),
    "identify log.csv --sensor-delay 5s..1s": ("delay is (5, 1) s", "the lower bound first"),
    "identify log.csv --sensor-delay late": (
        "--sensor-delay has 'late'",
        "fit, a time as 2ms, or bounds",
    ),
    "identify log.csv --model dahl --free weight": ("free is 'weight'", "one of mass, damping"),
    "identify log.csv --model dahl --free b0": ("free is b0", "mass as well"),
    "identify log.csv --fix stiffness=0": ("stiffness is 0 N/m", "above 0"),
    "identify log.csv --fix stiffness=-5": ("stiffness is -5 N/m", "above 0"),
    "identify log.csv --fix stiffness=nan": ("stiffness is NaN", "above 0"),
    "identify log.csv --dt 0": ("log.csv", "dt is 0", "above 0"),
    "identify log.csv --dt -1": ("log.csv", "dt is -1", "above 0"),
    "identify log.csv --dt nan": ("log.csv", "dt is nan", "above 0"),
    "identify log.csv --model unknown": ("model is 'unknown'", "'dahl'"),
    "identify log.csv --model dahl --model dahl": ("--model names dahl twice",),
    "identify log.csv --model dahl --model unknown": ("model is 'unknown'", "'dahl', 'bouc-wen'"),
    "identify log.csv --model prandtl-ishlinskii --fix mass=1": (
        "--fix has no effect with the model prandtl-ishlinskii",
        "expected it left out",
        "least squares",
    ),
    "identify log.csv --model prandtl-ishlinskii --drift 0": ("drift is 0", "above 0"),
    "identify log.csv --model PI": ("model is 'PI'", "did you mean 'prandtl-ishlinskii'?"),
    "identify log.csv --model Bouc_Wen": ("did you mean 'bouc-wen'?",),
    "identify log.csv --plays 33": ("--plays is 33", "1 to 32 plays"),
    "identify log.csv --asymmetry 9": ("--asymmetry is 9", "up to 8"),
    "identify log.csv --model generalised-prandtl-ishlinskii --asymmetry 2": ("--asymmetry is 2",),
    "identify log.csv --creep slow": ("--creep has 'slow'", "none, fit, or time constants"),
    "identify log.csv --drift yes": ("--drift has 'yes'", "none, fit, or a time constant"),
    "identify log.csv --creep -1": ("creep", "-1"),
    "identify log.csv --json --quiet": ("--json and --quiet", "at most"),
    "identify log.csv --method fish": ("--method is 'fish'", "xu-li-2010"),
    "identify log.csv --seed -1": ("seed is -1", "0 or above"),
    "identify log.csv --model dahl --runs 0": ("runs is 0", "1 or more"),
    "identify log.csv --threads -1": ("threads is -1", "0 or above"),
    "identify log.csv --unit drive": ("--unit is 'drive'", "NAME="),
    "identify log.csv --unit drive=furlong": ("log.csv", "'furlong'", "V, mV"),
    "identify log.csv --unit drive=um": ("log.csv", "'um' is a unit of displacement"),
    "identify log.csv --drive displacement_um --displacement voltage_V": ("unit of voltage",),
    "simulate dahl.json log.csv --drive displacement_um": ("the drive is in um: expected V",),
    "identify log.csv --drive volts": ("log.csv", "drive", "'volts'", "'voltage_V'"),
    "identify log.csv --out file": ("file cannot be made a folder",),
    "identify log.csv --out file/sub": ("cannot be made a folder",),
    "identify log.csv --test gone.csv": ("gone.csv: there is no such file",),
    "identify log.csv --test log.csv --test-window 8:9": ("--test-window", "log.csv"),
    "identify log.csv log.csv --test-window 1:2": ("--test-window", "--test"),
    "simulate gone.json log.csv": ("gone.json: there is no such file",),
    "simulate log.csv log.csv": ("log.csv:1: not JSON",),
    "simulate log.csv dahl.json": ("log.csv and dahl.json are the wrong way round",),
    "watch log.csv dahl.json": ("log.csv and dahl.json are the wrong way round",),
    "feedforward sine:1Hz,0..5um dahl.json": ("are the wrong way round", "MODEL REFERENCE"),
    "feedforward dahl.json sine:1Hz,0..5um --dt 20ms --limits nan:2": (
        "--limits are (nan, 2) V",
        "finite",
    ),
    "feedforward dahl.json sine:1Hz,0..5um --dt 20ms --limits 0..inf": ("--limits are (0, inf) V",),
    "feedforward dahl.json sine:1Hz,0..5um --dt 20ms --limits 2:2": ("--limits are (2, 2) V",),
    "feedforward dahl.json sine:1Hz,0..5um --limits 0:9 --rate 1Hz": ("--rate", "0.5 s"),
    "feedforward dahl.json 0..5um,1Hz": ("'0..5um,1Hz' is neither a file", "sine:0.2Hz,0..110um"),
    "identify log.csv --unit volts=V": ("log.csv: --unit: 'volts'", "'voltage_V'"),
    "info log.csv --displacement 7": ("log.csv: --displacement: 7", "'voltage_V'"),
    "identify log.csv --model prandtl-ishlinskii --creep 0": ("--creep[0] is 0 s", "above 0"),
    "identify log.csv --rate 200V": ("--rate has '200V'", "a frequency, as 200Hz"),
    "identify log.csv --window 3um:5um": ("--window has '5um'", "a time, as 2s"),
    "identify log.csv --fix mass=1": ("--fix has no effect", "expected the model", "--model dahl"),
    "compare log.csv --window 7:3": ("log.csv: --window", "7 s to 3 s"),
    "compare log.csv --test-window 8:9": ("log.csv: --test-window", "8 s to 9 s"),
    "compare log.csv --model nope": ("--model has 'nope'", "'dahl'"),
    "campaign log.csv --every 0": ("--every is 0 s", "more than 2 samples", "4"),
    "convert gone.csv log.csv": ("gone.csv: there is no such file",),
    "identify log.csv --test moved.csv": ("moved.csv: the drive is in um: expected V", "log.csv"),
    "compare log.csv --test moved.csv": ("moved.csv: the drive is in um: expected V", "log.csv"),
    "watch . log.csv": ("is a directory: expected a file that piezotrack saved",),
    "contour log.csv": ("log.csv: there is no column x_um", "'displacement_um'"),
    "simulate other.json log.csv": ("other.json is not a piezotrack model",),
    "simulate dahl.json gone.csv": ("gone.csv: there is no such file",),
    "simulate dahl.json log.csv --dt 0": ("log.csv", "dt is 0", "above 0"),
    "simulate dahl.json log.csv --out file": ("file cannot be made a folder",),
    "simulate dahl.json huge.csv": ("huge.csv", "finite"),
    "benchmark --out file": ("file cannot be made a folder",),
    "benchmark log.csv --out file/sub": ("cannot be made a folder",),
    "benchmark log.csv --json --quiet": ("--json and --quiet", "at most"),
    "benchmark gone.csv": ("gone.csv: there is no such file",),
    "benchmark log.csv --dt 0": ("log.csv", "dt is 0", "above 0"),
    "benchmark log.csv --model unknown": ("--model has 'unknown'", "'auto', 'dahl'"),
    "benchmark --record unknown": ("records has 'unknown'", "'measured'"),
    "benchmark --list gone.txt": ("--list: gone.txt cannot be read",),
    "benchmark log.csv --window 3:1": ("log.csv: --window", "3 s to 1 s"),
    f"{TUNE} --out file": ("file cannot be made a folder",),
    f"{TUNE} --out file/sub": ("cannot be made a folder",),
    f"{TUNE} --json --quiet": ("--json and --quiet", "at most"),
    f"{TUNE} --seed -1": ("seed is -1", "0 or above"),
    f"{TUNE} --limits 75:0": ("limits", "the lower one first"),
    f"{TUNE} gone.csv": ("gone.csv: there is no such file",),
    f"{TUNE} bad.csv": ("bad.csv:3: ", "'high'"),
    f"{TUNE} --parts repetitive": ("parts has 'repetitive'", "references that repeat"),
    f"{TUNE} --noise -1nm": ("--noise is -1 nm", "0 or above"),
    f"{TUNE} --bandwidth 0": ("bandwidth is 0", "above 0"),
    f"{TUNE} --gain-margin nan": ("--gain-margin is nan", "above 0 and below 400"),
    f"{TUNE} --delay 1e9s": ("delay is 1e+09 s in all", "expected 2000 s at most"),
    "tune gone.json": ("gone.json: there is no such file",),
    "tune log.csv": ("log.csv:1: not JSON",),
    "tune dahl.json": ("--dt is missing",),
    "tune dahl.json --dt 0.02": ("--limits is missing",),
    f"{COMPARE} --out file": ("file cannot be made a folder",),
    f"{COMPARE} --json --quiet": ("--json and --quiet", "at most"),
    f"{COMPARE} --seed -1": ("seed is -1", "0 or above"),
    f"{COMPARE} --draws 0": ("--draws is 0", "1 to 100"),
    f"{COMPARE} --limits 75:0": ("limits", "the lower one first"),
    f"{COMPARE} --frequencies nan,1,2": ("--frequencies is 'nan,1,2'", "in rising order"),
    f"{COMPARE} --frequencies 1e-9,1,2": (
        "--frequencies begins with 1e-09 Hz",
        "expected 0.00015 Hz or more",
    ),
    f"{COMPARE} --frequencies 1,2,25": (
        "--frequencies ends with 25 Hz",
        "half the sampling rate, 25 Hz",
    ),
    f"{COMPARE} --controllers ,": ("controllers[0] is ''", "'inverse'"),
    f"{COMPARE} --controllers network": ("not one could be made", "network: record is missing"),
    f"{COMPARE} --delay 1e9s": ("delay is 1e+09 s in all", "expected 2000 s at most"),
    f"{COMPARE} --delay nan": ("delay is nan", "0 or above"),
    f"{COMPARE} --noise -1nm": ("--noise is -1 nm", "0 or above"),
    f"{COMPARE} --stage gone.json": ("gone.json: there is no such file",),
    f"{COMPARE} --stage other.json": ("other.json is not a piezotrack model",),
    f"{COMPARE} --stage xu-li-2010 --noise 5nm": ("--noise has no effect",),
    "compare-controllers gone.json": ("gone.json: there is no such file",),
    "compare-controllers dahl.json": ("--dt is missing",),
    f"{LEARN} --out file/t.csv": ("file cannot be made a folder",),
    f"{LEARN} --seed -1 --noise 5nm": ("seed is -1", "0 or above"),
    f"{LEARN} --limits 75:0": ("limits", "the lower one first"),
    f"{LEARN} --noise -1nm": ("--noise is -1 nm", "0 or above"),
    f"{LEARN} --device usb:1": ("device is 'usb:1'", "virtual:"),
    f"{LEARN} --device virtual: --noise 5nm": ("--noise has no effect with --device",),
    f"{LEARN} --device virtual: --rest 80": ("rest is 80 V", "0 to 75 V"),
    f"{LEARN} --rest 5": ("--rest has no effect without --device",),
    "measure sine:1Hz,0..75V --device usb:1 --rate 100": ("device is 'usb:1'", "virtual:"),
    f"{MEASURE} sine:1Hz,0..75um": ("'0..75um'", "sine:0.5Hz,0..75V"),
    f"{MEASURE} sine:1Hz,0..90V": ("drive is", "0 to 75 V, the limits of virtual"),
    f"{MEASURE} sine:1Hz,0..75V --rest -1": ("rest is -1 V", "0 to 75 V"),
    f"{MEASURE} sine:1Hz,0..75V --out log.csv": ("log.csv exists", "--overwrite"),
    f"{MEASURE} sine:1Hz,0..75V --out log.xyz": ("log.xyz",),
    f"{PLAY} loop.json sine:1Hz,10..50um": ("controller has feedback", "pt.track"),
    f"{PLAY} gone.json sine:1Hz,10..50um": ("gone.json: there is no such file",),
    f"{PLAY} dahl.json sine:1Hz,10..50um": ("dahl.json is a model file", "expected a controller"),
    f"{PLAY} dahl.json sine:1Hz,10..50um --rate 1e9": ("rate is 1e+09 Hz", "0.1 to 100000 Hz"),
    "track dahl.json sine:1Hz,0..9um --device virtual:": ("not a piezotrack contr",),
    "track loop.json sine:1Hz,0..9um --device virtual: --kp 1": ("--kp has no effect",),
    "track loop.json sine:1Hz,0..9um --device scpi://x": ("device",),
    "serve epics": ("--prefix is missing", "LAB:STAGE"),
    "serve gcs --prefix LAB:STAGE": ("--prefix has no effect with gcs",),
    "serve epics --prefix LAB:STAGE --port 1": ("--port has no effect with epics",),
    "export loop.json --out file": ("file cannot be made a folder",),
    "export loop.json --json --quiet": ("--json and --quiet", "at most"),
    "export loop.json --name 1x": ("name is '1x'", "a letter, then letters"),
    "export loop.json sine:1Hz,0..9um": ("loop.json: reference is given", "no feedf"),
    "export loop.json gone.csv": ("gone.csv: there is no such file",),
    "export loop.json --to json --float": ("--float", "expected it left out"),
    "export loop.json --period 2": ("--period has no effect without REFERENCE",),
    "export gone.json": ("gone.json: there is no such file",),
    "export log.csv": ("log.csv:1: not JSON",),
    "export dahl.json": ("dahl.json is a model file", "expected a controller"),
    "export 1.json": ("name is '1'", "--name gives one"),
    "demo --out file": ("file cannot be made a folder",),
    "demo --seed -1": ("seed is -1", "0 or above"),
}


@pytest.mark.usefixtures("_no_pictures")
@pytest.mark.parametrize("command", BAD_ARGUMENTS)
def test_refuses_a_bad_argument(command: str) -> None:
    write("file", "not a folder")
    write("other.json", "{}")
    pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010()).save("loop.json")
    write("bad.csv", "time_s,target_um\n0,1\n0.1,high\n")
    write("huge.csv", "time_s,voltage_V\n0,0\n1,-1e9\n2,0\n3,1e9\n")
    write("moved.csv", log_text().replace("voltage_V", "command_um", 1))
    write_model()
    before = {path for path in Path().rglob("*") if path.is_file()}
    sentence = refusal(*command.split())
    for piece in BAD_ARGUMENTS[command]:
        assert piece in sentence
    assert {path for path in Path().rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(
    ("command", "piece"),
    [
        ("identify log.csv --dt often", "--dt"),
        ("tune dahl.json --gain-margin much", "--gain-margin"),
        ("tune dahl.json --iterations 3", "--iterations"),
        ("tune", "MODEL"),
        ("compare-controllers dahl.json --seeds few", "--seeds"),
        ("compare-controllers", "MODEL"),
        ("learn dahl.json sine:1Hz,0..9um,2s --method both", "--method"),
        ("learn dahl.json", "REFERENCE"),
        ("benchmark log.csv --dt often", "--dt"),
        ("benchmark --colour red", "--colour"),
        ("identify log.csv --seed lucky", "--seed"),
        ("identify log.csv --threads two", "--threads"),
        ("identify log.csv --hold spline", "--hold"),
        ("identify log.csv --colour red", "--colour"),
        ("identify", "FILE"),
        ("identify log.csv --dynamics quick", "--dynamics"),
        ("simulate dahl.json", "FILE"),
        ("serve modbus", "PROTOCOL"),
        ("serve gcs --port some", "--port"),
        ("fly", "fly"),
    ],
)
def test_refuses_what_is_no_option(command: str, piece: str) -> None:
    result = run(*command.split())
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert result.stdout == ""
    assert result.stderr.startswith("piezotrack: ")
    assert result.stderr.count("\n") == 1
    assert piece in result.stderr


def test_advice_is_for_the_command_line() -> None:
    # Whoever types a command cannot write units={'drive': 'V'}.
    write("bad.csv", lines_with(1, "time_s,voltage,displacement_um"))
    assert "--unit" in refusal("identify", "bad.csv")
    write("bad.csv", log_text().partition("\n")[2])
    assert "--drive" in refusal("identify", "bad.csv")


LIMITS = ("--limits", "0:75")


@pytest.mark.parametrize(
    "command",
    [
        "track dahl.json sine:1Hz,10..60um,2s --kp 0.03 --ti 0.02",
        "tune dahl.json sine:1Hz,10..60um,2s",
        "learn dahl.json sine:1Hz,10..60um,2s",
        "compare-controllers dahl.json",
        "contour dahl.json dahl.json circle:20um",
    ],
)
@pytest.mark.parametrize("noise", ["-1nm", "nan", "inf"])
def test_a_noise_that_is_none_is_refused_in_the_unit_that_was_typed(
    command: str, noise: str
) -> None:
    write_model()
    said = refusal(*command.split(), "--dt", "0.02", *LIMITS, "--noise", noise)
    assert said.startswith(f"--noise is {noise.removesuffix('nm')} nm: expected an rms value")


def test_a_reference_beyond_reach_is_refused_without_an_option_that_tune_lacks() -> None:
    write_model()
    message = refusal("tune", "dahl.json", "sine:1Hz,10..900um,2s", "--dt", "0.02", *LIMITS)
    assert "900 um" in message
    assert "reaches from" in message
    assert "largest_saturation" not in message
