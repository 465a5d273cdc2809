"""The command given files and options that are not quite right."""

from __future__ import annotations

import json
import re
from functools import cache
from typing import Any

from hypothesis import strategies as st

import piezotrack as pt
from commands import run
from mutants import changed_document, log
from soak import LONGEST_MESSAGE, bad_message, verdict_of

NUMBERS = ["0.02", "0", "-1", "nan", "inf", "1e-9", "1e9", "1e300", "x", "", "\u0663", "1_0"]
GAINS = ["0.12", "1e5", *NUMBERS]
NAMES = ["0", "9", "time_s", "x", "9" * 30]
WHOLE = ["1", "2", "0", "-1", "x", "99999999999999999999", "1.5"]
RANGES = ["0:0.6", "1:0", ":", "0.1:", "x:y", "nan:1", "0:1e9", "0:1:2", ""]
REFERENCES = [
    *(
        "sine:0.2Hz,0..50um,2s",
        "sine:1e9Hz,0..50um",
        "reference.csv",
        "none.csv",
        "",
        "x:",
        "\x1b[31m",
    ),
    *("multisine:0.5/1.3Hz,0..9um,2s", "staircase:3,0..30um,dwell=0.2s", "triangle:1Hz,0..50um,1s"),
]
PATHS = [
    "circle:1Hz,10um,1s",
    "x",
    "raster:1Hz,20/20um,lines=3,1s",
    "path.csv",
    "spiral:1Hz,2um,pitch=2um",
]
POSITIONAL = {"REFERENCE": REFERENCES, "PATH": PATHS}
OPTIONS: dict[str, list[str]] = {
    "--dt": NUMBERS,
    "--limits": ["0:75", "75:0", "0:", ":", "nan:1", "-1e308:1e308", "0:75:80", "x"],
    **dict.fromkeys(("--kp", "--ti", "--td", "--tt", "--kq", "--tq"), GAINS),
    **dict.fromkeys(
        ("--delay", "--sensor-delay", "--jitter", "--lag", "--dt", "--duration", "--period"),
        NUMBERS,
    ),
    **dict.fromkeys(("--seed", "--runs", "--threads"), WHOLE),
    "--cross-talk": ["0.01:0.01", "x", "1e300:1", "0.01"],
    **dict.fromkeys(("--window", "--test-window"), RANGES),
    "--fix": ["mass=0.1", "mass=x", "=1", "mass=nan", "none=1", "mass=0.1=2"],
    "--bound": ["mass=0.1:0.2", "mass=0.2:0.1", "mass=x:1", "mass=:", "a=1:2"],
    "--free": ["mass", "", "mass,,x", "mass,mass"],
    "--unit": ["voltage_V=V", "x=V", "=", "time=um", "displacement=nm"],
    **dict.fromkeys(("--time", "--drive", "--displacement"), NAMES),
    "--hold": ["foh", "zoh", "x"],
    "--model": ["dahl", "bouc-wen", "prandtl-ishlinskii", "none", "model.json", ""],
    "--second-level": ["40V:50um", "40:50", "x", "0:0", "1:nan"],
    "--parts": ["pid", "pid,low-pass", "notch", "repetitive", "pid,,", "x", ""],
    "--minimise": ["rms", "largest", "x", ""],
    **{key: ["2", "1", "1.2", *NUMBERS] for key in ("--gain-margin", "--sensitivity")},
    "--phase-margin": ["30", "0", "180", *NUMBERS],
    **{key: ["10", "95", *NUMBERS] for key in ("--mode-spread", "--gain-spread")},
    "--delay-spread": ["0.002", *NUMBERS],
    "--noise": ["30nm", "30", *NUMBERS],
    "--bandwidth": ["100", *NUMBERS],
    "--controllers": ["inverse", "inverse, PID", "network", "inverse + PD", "x", "", ","],
    "--frequencies": ["0.5,1,2", "2,1", "1,1,1", "0,1,2", "x,1,2", "1e-9,1,1e9", ""],
    "--stage": ["model.json", "xu-li-2010", "none.json", ""],
    "--draws": ["1", "2", "0", "101", *WHOLE],
    "--trials": ["1", "3", "10001", *WHOLE],
    "--method": ["descents", "swarm", "spso-2011", "x"],
    "--gain": ["0.7", "2", *NUMBERS],
    "--cutoff": ["5", "24", *NUMBERS],
    "--mode-scales": ["1", "0.9,1,1.1", "1,", "x", "0", "1e300,1"],
    "--device": [
        "virtual:",
        "virtual:model.json",
        "virtual:gone.json",
        "ni:",
        "x:",
        "gcs://",
        "scpi://localhost:1",
    ],
    "--drive": ["sine:1Hz,0..75V", "decaying:2Hz,0..20V", "sine:1Hz,0..75um", "log.csv", "x", ""],
    "--rate": ["100", *NUMBERS],
    "--rest": ["10", *NUMBERS],
    "--ramp": ["0.1", *NUMBERS],
    "--to": ["c99", "json", "fmu", "x", ""],
    "--name": ["axis", "1x", "", "x" * 99, "pid", "\x1b[31m"],
    "--speed": ["100", *NUMBERS],
    "--host": ["127.0.0.1", "256.0.0.1", "", "\x1b[31m"],
    "--prefix": ["LAB:STAGE", "", "A B", "\x1b[31m"],
}
COLUMNS = ("--dt", "--unit", "--time", "--drive")
LOOP = ("--dt", "--limits", "--kp", "--ti", "--td", "--delay", "--jitter", "--seed", "--duration")
# What stands behind the command, and the options that it takes.
COMMANDS: dict[str, tuple[list[str], tuple[str, ...]]] = {
    "simulate": (["model.json", "log.csv"], (*COLUMNS, "--hold")),
    "feedforward": (["model.json", "REFERENCE"], ("--dt", "--duration", "--period")),
    "track": (["model.json", "REFERENCE"], (*LOOP, "--period", "--tq", "--kq", "--tt")),
    "tune": (
        ["model.json", "--dt", "0.02", "--limits", "0:75", "--parts", "pid"],
        ("--dt", "--limits", "--delay", "--seed", "--duration", "--period",
         "--parts", "--minimise", "--gain-margin", "--phase-margin", "--sensitivity",
         "--mode-spread", "--gain-spread", "--delay-spread", "--noise", "--bandwidth"),
    ),
    "compare-controllers": (
        ["model.json", "--dt", "0.02", "--limits", "0:75", "--frequencies", "0.5,1,2",
         "--controllers", "inverse"],
        ("--dt", "--limits", "--delay", "--seed", "--draws", "--frequencies", "--stage",
         "--controllers", "--sensitivity", "--noise", "--bandwidth"),
    ),
    "learn": (
        ["model.json", "--dt", "0.02", "--limits", "0:75", REFERENCES[0],
         "--trials", "3"],
        ("--dt", "--limits", "--kp", "--ti", "--td", "--delay", "--seed",
         "--duration", "--period", "--stage", "--trials", "--gain", "--cutoff",
         "--mode-scales", "--noise", "--bandwidth", "--device", "--rest"),
    ),
    "contour": (["model.json", "PATH"], (*LOOP, "--lag", "--cross-talk")),
    "identify": (
        ["log.csv", "--runs", "1"],
        (*COLUMNS, "--displacement", "--hold", "--window", "--threads", "--fix", "--bound",
         "--free", "--model", "--sensor-delay", "--method", "--seed"),
    ),
    "export": (["controller.json"], ("--to", "--name", "--duration", "--period")),
    "compare": (
        ["log.csv", "--runs", "1"],
        (*COLUMNS, "--window", "--test-window", "--model", "--seed"),
    ),
    "benchmark": (
        ["log.csv", "--model", "plays-nnls"],
        (*COLUMNS, "--displacement", "--hold", "--window", "--test-window", "--model"),
    ),
    "step": (["log.csv"], (*COLUMNS, "--fix", "--second-level", "--window")),
    "watch": (["model.json", "log.csv"], (*COLUMNS, "--displacement", "--hold", "--window")),
    "noise": (["log.csv"], ("--dt", "--unit", "--time", "--displacement", "--window")),
    "info": (["log.csv"], (*COLUMNS, "--displacement")),
    "measure": (
        ["sine:1Hz,0..75V", "--device", "virtual:", "--rate", "100", "--out", "out.csv"],
        ("--device", "--rate", "--duration", "--rest", "--ramp"),
    ),
    "play": (
        ["controller.json", "REFERENCE", "--device", "virtual:"],
        ("--device", "--rate", "--duration", "--period", "--rest"),
    ),
    # With a port that there is not: else it would go on until it is stopped.
    "serve": (
        ["gcs", "--port", "65536"],
        ("--limits", "--speed", "--host", "--prefix", "--device"),
    ),
}  # fmt: skip
# Their shares: those that identify take long.
MIX = (
    ["simulate", "feedforward", "track"] * 4
    + ["step", "noise", "info", "export", "serve", "measure", "play"] * 2
    + ["contour", "identify", "compare", "benchmark", "tune", "compare-controllers", "learn"]
)


@cache
def controller_text() -> str:
    """A controller of many parts, as a file has it."""
    loop = pt.Controller(
        dt=0.02,
        limits=(0.0, 75.0),
        feedforward=pt.DahlStage.xu_li_2010().inverse(),
        feedback=pt.control.DisturbanceObserver(
            pid=pt.Pid.from_um(kp=0.05, ti=0.02), plant_gain=1.5e-6, cutoff=1.0
        ),
        repetitive=pt.Repetitive.from_um(period=1.0, kq=0.3, tq=0.05),
        filters=[pt.LowPass(5.0), pt.Notch(12.0)],
    )
    return json.dumps(loop.document())


@st.composite
def invocations(draw: Any, right: list[str]) -> tuple[list[str], dict[str, str]]:
    """Arguments of the command, and the files that they are about; `right` are model files."""
    command = draw(st.sampled_from(MIX))
    given, options = COMMANDS[command]
    text = draw(st.sampled_from(right))
    files = {
        "model.json": changed_document(draw, text) if draw(st.integers(0, 3)) else text,
        "controller.json": changed_document(draw, controller_text()),
        "log.csv": log(),
        "reference.csv": log(titles="time_s,voltage_V,target_um"),
        "path.csv": log(titles="time_s,x_um,y_um"),
    }
    arguments = [
        command,
        *(draw(st.sampled_from(POSITIONAL[a])) if a in POSITIONAL else a for a in given),
    ]
    chosen = draw(st.lists(st.sampled_from(options), max_size=3, unique=True))
    for option in chosen:
        arguments += [option, draw(st.sampled_from(OPTIONS[option]))]
    # These write nothing. Others would not be asked any more after they have succeeded once.
    out = "out/t.csv" if command == "learn" else "out"
    return [
        *arguments,
        *([] if command in ("info", "serve") else ["--overwrite", "--out", out]),
    ], files


def faults_of_command(arguments: list[str]) -> tuple[list[str], int | None]:
    """What a call of the command did that it may not, and its exit code."""
    # Long enough for all that is asked here, on a busy machine too.
    faults, result = verdict_of(lambda: run(*arguments), after=100.0)
    if faults:
        return faults, None
    error = result.exception
    if error is not None and not isinstance(error, SystemExit):
        return [f"{type(error).__name__}: {str(error)[:80]}"], None
    code, message = result.exit_code, result.stderr
    if code == 0:
        return [], code
    if code == 2 and message.startswith("Usage"):
        return [], code
    if code == 2 and re.fullmatch(r"piezotrack: [^\n]+\n", message) and result.stdout == "":
        # The name of the program and the file come on top.
        return bad_message(message.rstrip("\n")[: LONGEST_MESSAGE + 1]), code
    return [f"exit {code}: {message[:80]}"], code
