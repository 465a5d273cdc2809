"""Answers of a virtual controller to HLP?, HDR? and HPA?."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...gcs.protocol import CONTROL_VALUE, POSITION, TARGET, VOLTAGE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["NOW", "ON_COMMAND", "ON_GENERATOR", "ON_MOTION", "OPTIONS", "TRIGGERS", "commands",
           "parameters", "recorder"]  # fmt: skip

END = "end of help"
OPTIONS = {
    0: "nothing is recorded",
    TARGET: "target position of axis",
    POSITION: "current position of axis",
    VOLTAGE: "voltage of output channel",
    CONTROL_VALUE: "open-loop control value of axis",
}
# What starts the recorder besides the generator.
ON_GENERATOR, ON_MOTION, ON_COMMAND, NOW = 0, 1, 2, 4
TRIGGERS = {
    ON_GENERATOR: "wave generator starts (WGO), or recording again (WGR)",
    ON_MOTION: "motion command (MOV, MVR, SVA, SVR)",
    ON_COMMAND: "next command, then back to 0",
    NOW: "at once, then back to 0",
}
# Arguments and meaning; those of a query are in the word without its question mark.
WORDS = {
    "#5": "which axes move",
    "#7": "whether the controller is ready",
    "#9": "which wave generators run",
    "#24": "stop",
    "*IDN": "name of the controller",
    "CST": "[{axis}] name of the stage",
    "CSV": "version of the syntax",
    "DRC": "{table source option} what is recorded",
    "DRL": "[{table}] number of samples recorded",
    "DRR": "[start count [{table}]] what was recorded",
    "DRT": "table trigger value: what starts the recorder",
    "ERR": "code of the last error, which is forgotten",
    "GWD": "[start count [{table}]] points of wave tables",
    "HDR": "what can be recorded",
    "HLP": "commands",
    "HLT": "[{axis}] stop",
    "HPA": "parameters",
    "IDN": "name of the controller",
    "MOV": "{axis target} move with the servo on",
    "MVR": "{axis distance} move on with the servo on",
    "ONT": "[{axis}] whether the target is reached",
    "OVF": "[{axis}] whether the output is at a limit",
    "POS": "[{axis}] position",
    "PUN": "[{axis}] unit of positions",
    "RBT": "restart",
    "RTR": "servo cycles from sample to sample of the recorder",
    "SAI": "[ALL] axes",
    "SPA": "{item parameter value} parameter",
    "SSN": "serial number",
    "STP": "stop",
    "SVA": "{axis value} open-loop control value",
    "SVO": "{axis state} servo on or off",
    "SVR": "{axis change} change of the open-loop control value",
    "TMN": "[{axis}] lowest position",
    "TMX": "[{axis}] highest position",
    "TNR": "number of tables of the recorder",
    "TSP": "[{channel}] reading of a sensor",
    "TWC": "forget the triggers of the wave generator",
    "TWG": "number of wave generators",
    "VER": "versions",
    "VMA": "[{channel}] highest voltage",
    "VMI": "[{channel}] lowest voltage",
    "VOL": "[{channel}] voltage",
    "WAV": "table append type ... segment of a wave table",
    "WCL": "{table} forget the points of wave tables",
    "WGC": "{generator cycles} number of repetitions, 0 for ever",
    "WGO": "{generator mode} start with 1, stop with 0",
    "WGR": "record again while the generator runs",
    "WOS": "{generator offset} offset of the output",
    "WSL": "{generator table} wave table of a generator",
    "WTR": "{generator rate interpolation} servo cycles for which a point lasts",
}


def commands(names: Iterable[str]) -> list[str]:
    """Answer HLP?."""
    listed = [f"{name} {WORDS[name.removesuffix('?')]}" for name in sorted(names)]
    return ["the following commands are known:", *listed, END]


def recorder(tables: int, points: int) -> list[str]:
    """Answer HDR?."""
    return [
        "#RecordOptions",
        *(f"{number}={text}" for number, text in OPTIONS.items()),
        "#TriggerOptions",
        *(f"{number}={text}" for number, text in TRIGGERS.items()),
        "#Additional information",
        f"{tables} record tables",
        f"{points} datapoints per table",
        END,
    ]


def parameters(known: Mapping[int, tuple[str, str, str]]) -> list[str]:
    """Answer HPA? for parameters with their type, value and description."""
    lines = [
        f"0x{number:08X}= 0\t1\t{kind}\tsystem\t{text}" for number, (kind, _, text) in known.items()
    ]
    return ["the following parameters are known:", *lines, END]
