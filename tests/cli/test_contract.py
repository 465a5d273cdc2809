"""One table of all options: no option with two meanings or two names, none beside the table."""

from __future__ import annotations

import math
from typing import Any

import click
import pytest

import piezotrack as pt
from piezotrack.cli.commands import COMMANDS, app
from piezotrack.cli.values import Quantity, Ranged

# Option, metavar, and a piece of what each command says of it.
TABLE = """
--abandoned       runs|stops|rests                          whose client has gone
--asymmetry       N                                         Dead-zone operators
--bandwidth       FREQUENCY                                 Bandwidth of the simulated amplifier
--beyond-reach    -                                         cannot reach
--bound           NAME=LOW:HIGH                             Bounds
--checkpoint      FILE                                      to continue after an interruption
--clip            -                                         Clip a drive
--clock           FREQUENCY                                 Clock of the processor
--constrain       'A < B'                                   Inequality of two parameters
--controllers     NAMES                                     Controllers
--creep           none|fit|TIME,...                         Creep
--cross-talk      XY:YX                                     Share of y in x and of x in y
--cutoff          FREQUENCY                                 Highest frequency learnt
--dask            HOST:PORT                                 Scheduler
--dbo             FOLDER                                    DBO log
--decimate        N|auto                                    Every Nth sample
--decouple        -                                         decouple the feedforward
--delay           TIME                                      Delay of the loop
--browser         -                                         Open the browser
--delay-spread    TIME                                      Largest delay in addition
--device          ADDRESS                                   Device
--displacement    COLUMN                                    Column of the displacement
--draws           N                                         Draws of the sensor noise
--drift           none|fit|TIME                             Sensor drift
--drive           COLUMN                                    Column of the drive
--dt              TIME                                      Sampling interval
--duration        TIME                                      Length of the
--dynamics        auto|none|lag|mode                        dynamics
--every           TIME                                      records of this length
--feedback        -                                         PID feedback
--feedforward     -                                         Feedforward by the inverse of the model
--fix             NAME=VALUE                                Known value
--fixed           -                                         constants, not settings
--float           -                                         Numbers of 4 bytes
--format          png|svg|pdf                               Format of pictures
--free            A,B,...                                   Parameters to identify
--frequencies     A,B,C                                     Frequencies of the references
--from-rest       -                                         whole motion from rest
--gain            NUMBER                                    Learning gain
--gain-margin     DECIBELS                                  Least gain margin
--effort          LENGTH                                    change of the command
--gain-spread     PERCENT                                   Range of the stage's gain
--history         virgin|settled|fit|rest                   State at the beginning
--hold            foh|zoh                                   Drive between samples
--host            HOST                                      Address to listen at
--jitter          TIME                                      Mean sampling jitter
--json            -                                         one JSON document
--kp              GAIN                                      Proportional gain of the PID
--kq              GAIN                                      Learning gain of the repetitive control
--lag             TIME                                      from sampling x to sampling y
--largest-error   LENGTH                                    Largest rms error
--level           LENGTH                                    Displacement that the loop holds
--limits          LOW:HIGH                                  Lowest and highest drive
--list            FILE                                      List of logs
--method          descents|swarm|xu-li-2010|spso-2011       Search
--minimise        rms|largest|effort                        Error to minimise
--missing         drop|fill                                 Missing readings
--mode-scales     A,B,...                                   Factors on the model's resonances
--mode-spread     PERCENT                                   slower and faster
--model           NAME                                      Name of a model
--name            NAME                                      Name of files and functions
--noise           LENGTH                                    Noise of the
--offset          -                                         constant sensor offset
--online          -                                         computed at each sample
--out             PATH                                      Folder for the results
--overwrite       -                                         Replace results that exist
--paper           -                                         Xu and Li 2010
--parquet         -                                         campaign.parquet
--parts           NAMES                                     pid,low-pass,notch,repetitive
--period          TIME                                      repeats
--phase-margin    ANGLE                                     Least phase margin
--plays           N                                         Play operators
--port            N                                         TCP port
--prefix          NAME                                      epics records
--prior           NAME=VALUE:WIDTH                          standard deviation
--quick           -                                         Two draws
--quiet           -                                         errors only
--ramp            TIME                                      ramp from rest and back
--rate            FREQUENCY                                 Sampling rate
--record          NAME                                      Record of the package
--refit           FILE                                      Identify the model again
--repetitive      -                                         Repetitive control
--report          FILE                                      Report for other readers
--resample        TIME                                      Interpolate to this interval
--resolution      FREQUENCY                                 Distance of the frequencies
--response        FILE                                      Response of which
--rest            VOLTAGE                                   Drive before and after
--runs            N                                         Independent searches
--scale           NAME=linear|log                           Scale of the search
--second-level    VOLTAGE:LENGTH                            another step
--seed            N                                         Seed of the random numbers
--seeds           N|A:B                                     Seeds of the random numbers
--sensitivity     NUMBER                                    Largest sensitivity Ms
--sensor-delay    none|fit|TIME|LOW:HIGH                    Delay of the sensor
--skip            N                                         Lines above the titles
--slew            SLEW                                      Largest rate of the drive
--speed           NUMBER                                    relative to real time
--stage           FILE|xu-li-2010                           Stage to simulate
--table           FILE                                      One period of a feedforward
--td              TIME                                      Derivative time of the PID
--test            FILE                                      Log for the test only
--test-window     A:B                                       for the test
--threads         N                                         Threads
--ti              TIME                                      Integral time of the PID
--tie             NAME=EXPRESSION                           Dependent parameter
--time            COLUMN                                    Column of the time
--to              c99|firmware|library|json|fmu             co-simulation unit
--tq              TIME                                      Filter time of the repetitive control
--trials          N                                         Trials at most
--tt              TIME                                      anti-windup
--unit            NAME=UNIT                                 Unit of a column
--unstable        -                                         loop is unstable
--verbose         -                                         Print all lines
--weight          NUMBER                                    Weight of a sample
--width           WIDTH                                     Pictures for a paper
--window          A:B                                       Part of
--zero            -                                         isplacements
"""
# Metavar, and names of what each argument is.
ARGUMENTS = {
    "FILE",
    "OUT",
    "MODEL",
    "MODEL|CONTROLLER",
    "MODEL|RESPONSE",
    "CONTROLLER",
    "REFERENCE",
    "DRIVE",
    "EXCITATION",
    "EXCITATION|FILE",
    "PROTOCOL",
    "[MODEL_X|CONTROLLER_X [MODEL_Y|CONTROLLER_Y]] PATH",
}
ROWS = {line[:18].strip(): (line[18:60].strip(), line[60:]) for line in TABLE.splitlines() if line}
CONTEXT = click.Context(app)
# A text for each quantity, its value, and one of another quantity.
VALUES = {
    "TIME": ("2ms", 2e-3, "2V"),
    "LENGTH": ("20nm", 20e-9, "20ms"),
    "VOLTAGE": ("500mV", 0.5, "5um"),
    "FREQUENCY": ("1.5kHz", 1500.0, "2s"),
    "GAIN": ("0.03V/um", 0.03, "0.03V"),
    "SLEW": ("2V/ms", 2000.0, "2V"),
    "DECIBELS": ("6dB", 6.0, "6deg"),
    "ANGLE": ("0.5rad", math.degrees(0.5), "30dB"),
    "PERCENT": ("5%", 5.0, "5dB"),
    "NUMBER": ("0.5", 0.5, "0.5s"),
}


def command(name: str) -> click.Command:
    found = app.get_command(CONTEXT, name)
    assert found is not None
    return found


OPTIONS = [
    (name, one)
    for name in COMMANDS
    for one in command(name).params
    if isinstance(one, click.Option)
]


def metavar(option: Any) -> str:
    if option.is_flag:
        return "-"
    return str(option.metavar or option.type.get_metavar(option, CONTEXT) or option.type.name)


def test_each_option_of_each_command_is_in_the_table_and_means_what_it_says() -> None:
    for name, option in OPTIONS:
        assert option.opts[0] in ROWS, name
        expected, meaning = ROWS[option.opts[0]]
        assert metavar(option) == expected, (name, option.opts[0])
        assert meaning in (option.help or ""), (name, option.opts[0])
    # No row of what is no more, and no other spelling but the short ones.
    assert {option.opts[0] for _, option in OPTIONS} == set(ROWS)
    others = {other for _, option in OPTIONS for other in option.opts[1:]}
    assert others == {"-v", "-o"}
    assert all("-o" in option.opts for _, option in OPTIONS if option.opts[0] == "--out")


def test_no_meaning_has_two_names() -> None:
    names: dict[str, set[str]] = {}
    for _, option in OPTIONS:
        meaning = (option.help or "").partition("; default")[0]
        names.setdefault(meaning, set()).add(option.opts[0])
    assert [found for found in names.values() if len(found) > 1] == []


def test_arguments_have_one_name_too() -> None:
    found = {
        one.metavar for name in COMMANDS for one in command(name).params
        if isinstance(one, click.Argument)
    }  # fmt: skip
    assert found == ARGUMENTS
    for name in ("feedforward", "track", "tune", "learn", "play", "export"):
        arguments = [one for one in command(name).params if isinstance(one, click.Argument)]
        assert arguments[1].metavar == "REFERENCE", name


def test_where_there_is_an_interval_there_is_a_rate() -> None:
    names = {name: {one.opts[0] for n, one in OPTIONS if n == name} for name in COMMANDS}
    for options in names.values():
        assert ("--dt" in options) == ("--rate" in options)
        assert "--test-window" not in options or "--window" in options


@pytest.mark.parametrize("name", VALUES)
def test_a_value_has_its_unit_and_no_other(name: str) -> None:
    text, value, wrong = VALUES[name]
    found = [one for _, one in OPTIONS if metavar(one) == name]
    assert found
    for option in found:
        assert isinstance(option.type, Quantity)
        assert option.type.convert(text, option, None) == pytest.approx(value, rel=1e-15)
        with pytest.raises(pt.ParameterError) as refused:
            option.type.convert(wrong, option, None)
        assert str(refused.value).startswith(f"{option.opts[0]} has '{wrong}': expected ")


def test_what_may_be_meant_in_another_unit_needs_its_own() -> None:
    by_name = {one.opts[0]: one for _, one in OPTIONS}
    for option in ("--ti", "--td", "--tt", "--dt", "--delay", "--tq", "--jitter"):
        assert by_name[option].type.convert("0.02", by_name[option], None) == 0.02
        with pytest.raises(pt.ParameterError, match=r"its unit, as 20ms or 20s"):
            by_name[option].type.convert("20", by_name[option], None)
    for option in ("--noise", "--largest-error"):
        with pytest.raises(pt.ParameterError, match="its unit, as 20nm"):
            by_name[option].type.convert("20", by_name[option], None)
    phase = by_name["--phase-margin"]
    for text, degrees in (("30", 30.0), ("30deg", 30.0), ("0.5deg", 0.5), ("0", 0.0)):
        assert phase.type.convert(text, phase, None) == degrees
    for text in ("0.5", "3.14"):
        with pytest.raises(pt.ParameterError, match=r"its unit, as 30deg or 0\.5rad"):
            phase.type.convert(text, phase, None)
    assert by_name["--noise"].type.convert("0", by_name["--noise"], None) == 0.0


def test_the_second_unit_of_a_range_is_that_of_the_first() -> None:
    by_name = {one.opts[0]: one for _, one in OPTIONS}
    for option, text, pair in (
        ("--window", "3:15s", (3.0, 15.0)),
        ("--window", "300:1500ms", (0.3, 1.5)),
        ("--window", "1s:", (1.0, None)),
        ("--limits", "0:75V", (0.0, 75.0)),
        ("--limits", "0:75000mV", (0.0, 75.0)),
        ("--limits", "-.5:1.5V", (-0.5, 1.5)),
    ):
        kind = by_name[option].type
        assert isinstance(kind, Ranged)
        for written in (text, text.replace(":", "..")):
            assert kind.convert(written, by_name[option], None) == pytest.approx(pair)
    with pytest.raises(pt.ParameterError, match=r"--limits is '0\.\.\.5V'"):
        by_name["--limits"].type.convert("0...5V", by_name["--limits"], None)


def test_the_help_fits_two_screens() -> None:
    for name in COMMANDS:
        one = command(name)
        context = click.Context(one, parent=CONTEXT, info_name=name)
        lines = one.get_help(context).splitlines()
        assert len(lines) <= 80, name
        assert max(map(len, lines)) <= 80, name
