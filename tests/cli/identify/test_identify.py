"""The command: what it writes, whole or not at all."""

from __future__ import annotations

import html
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from matplotlib.figure import Figure

import piezotrack as pt
from commands import (
    COMMAND,
    PAPER,
    PICTURES,
    RESULTS,
    as_printed,
    log_text,
    names,
    ran,
    refusal,
    run,
    without_progress,
    write,
    write_model,
)
from piezotrack.cli.commands import app
from piezotrack.cli.identify.identify import identify_command
from piezotrack.data.log_file import write_log
from piezotrack.identification.views import plot as views
from records import BOX, HELD, quick


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(log_text(), encoding="utf-8")


# What it does.


@pytest.mark.parametrize(
    "remedy",
    [
        "creep=True",
        "LeastSquares(creep=True)",
        'LeastSquares(dynamics="second")',
        "delay=True",
        "drift=True",
        "'rate-dependent-prandtl-ishlinskii'",
    ],
)
def test_what_a_residual_asks_for_is_an_option_with_its_value(remedy: str) -> None:
    printed = as_printed(f"a resonance explains 30 % of the squared residual: try {remedy}")
    options = printed.partition(": try ")[2].split()
    assert len(options) == 2
    assert identify_command.make_context("identify", ["log.csv", *options]).params


def test_identify_writes_what_python_finds() -> None:
    printed = ran("identify", "log.csv", *PAPER, "--seed", "3", "-v")
    fit = pt.identify(
        pt.read("log.csv"), "dahl", parameters={**BOX, **HELD}, method=pt.Descents(seed=3)
    )
    assert names("results") == RESULTS
    model = pt.load("results/dahl.json")
    assert model.model == fit.model
    assert model.offset == fit.offset
    assert printed.startswith(as_printed(fit.summary()))
    assert "written to results/: dahl.json, dahl_loop.png .svg" in printed


def test_identify_writes_a_report_that_has_the_command() -> None:
    plays = ("identify", "log.csv", "--model", "prandtl-ishlinskii", "--report", "a report.html")
    printed = ran(*plays, "--no-offset")
    assert "written: a report.html\n" in printed
    page = Path("a report.html").read_text(encoding="utf-8")
    command = html.unescape(page.split("<pre>")[1].split("</pre>")[0])
    assert sorted(shlex.split(command)[1:]) == sorted([*plays, "--no-offset"])
    # All is refused before the computation, and nothing is lost.
    before = sorted(Path().rglob("*"))
    for options, reason in (
        ((), "a report.html exists"),
        (("--report", "r.doc"), ".html or .pdf"),
        (("--report", "none/r.pdf"), "a folder that exists"),
        (("--model", "dahl", "--report", "r.pdf"), "several models"),
    ):
        assert reason in refusal(*plays, *options, "--out", "other")
    assert sorted(Path().rglob("*")) == before
    ran(*plays, "--overwrite")
    assert "--no-offset" not in Path("a report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("_no_pictures")
def test_every_option_of_a_fit_reaches_it() -> None:
    options = (
        "--window 1:3 --model dahl --out a/b --fix a1=121.9874 --fix a2=1177300 --fix mass=0.1828 "
        "--bound damping=1000:5000 --fix stiffness=26065 --no-offset --method xu-li-2010 --seed 7 "
        "--runs 2 --threads 1 --hold zoh"
    )
    ran("identify", "log.csv", *options.split(), "--free", "damping,piezo_coefficient, b1")
    fit = pt.identify(
        pt.read("log.csv", hold="zoh")[1.0:3.0],
        "dahl",
        parameters={
            "damping": (1000.0, 5000.0),
            "a1": 121.9874,
            "a2": 1177300.0,
            "mass": 0.1828,
            "stiffness": 26065.0,
            "piezo_coefficient": pt.Parameter(),
            "b1": pt.Parameter(),
        },
        offset=False,
        method=pt.ParticleSwarm.xu_li_2010(seed=7, runs=2),
    )
    fit.save("expected.json")
    assert Path("a/b/dahl.json").read_bytes() == Path("expected.json").read_bytes()


@pytest.mark.usefixtures("_no_pictures")
def test_what_else_is_known_of_parameters_reaches_a_fit() -> None:
    options = (
        *("--model", "dahl", "--fix", "a1=121.9874", "--fix", "a2=1177300", "--runs", "1"),
        *("--bound", "damping=1000:5000", "--scale", "damping=log", "--tie", "b1=1.57 * a2"),
        *("--constrain", "damping < stiffness", "--prior", "mass=0.18:0.02"),
    )
    printed = ran("identify", "log.csv", *options, "-v")
    fit = pt.identify(
        pt.read("log.csv"),
        "dahl",
        parameters={
            "a1": 121.9874,
            "a2": 1177300.0,
            "damping": pt.Parameter(bounds=(1000.0, 5000.0), scale="log"),
            "b1": "1.57 * a2",
            "mass": pt.Parameter(prior=(0.18, 0.02)),
        },
        constraints=["damping < stiffness"],
    )
    fit.save("expected.json")
    assert Path("results/dahl.json").read_bytes() == Path("expected.json").read_bytes()
    for words in ("tied: 1.57 * a2", "prior 0.18 +- 0.02 kg", "damping < stiffness", "log scale"):
        assert words in printed


@pytest.mark.usefixtures("_no_pictures")
def test_columns_and_units_can_be_named() -> None:
    lines = log_text().splitlines()
    text = "\n".join(
        ["clock,ref (V),amp,pos", *(line.replace(",", ",0,", 1) for line in lines[1:])]
    )
    Path("odd.csv").write_text(text, encoding="utf-8")
    columns = ("--time", "clock", "--drive", "amp", "--displacement", "pos")
    units = ("--unit", "time=s", "--unit", "amp=V", "--unit", "displacement=um")
    ran("identify", "odd.csv", *columns, *units, *PAPER, "--out", "odd")
    ran("identify", "log.csv", *PAPER, "--out", "plain")
    assert pt.load("odd/dahl.json").model == pt.load("plain/dahl.json").model
    drop_time = ("--dt", "0.004", *columns[2:], *units[2:])
    ran("identify", "odd.csv", *drop_time, *PAPER, "--out", "dt")
    assert pt.load("dt/dahl.json").model == pt.load("plain/dahl.json").model


@pytest.mark.usefixtures("_no_pictures")
@pytest.mark.parametrize("window", ["1:", ":3", ":", "0.5:3.5"])
def test_a_window_may_be_open(window: str) -> None:
    ran("identify", "log.csv", *PAPER, "--window", window, "--threads", "1")
    start, stop = (float(text) if text else None for text in window.split(":"))
    fit = pt.identify(pt.read("log.csv")[start:stop], "dahl", parameters={**BOX, **HELD})
    assert pt.load("results/dahl.json").model == fit.model


def test_a_second_log_judges_the_model() -> None:
    write_log(quick(9), Path("second.csv"))
    printed = ran(*("identify", "log.csv", *PAPER, "--test", "second.csv", "--test-window", "1:3"))
    score = pt.load("results/dahl.json").score(pt.read("second.csv")[1.0:3.0])
    assert f"not fitted, with an offset of its own: {score}" in printed
    validation = [f"dahl_test_{panel}.{e}" for panel in ("loop", "time") for e in ("png", "svg")]
    assert names("results") == sorted([*RESULTS, *validation])


@pytest.mark.usefixtures("_no_pictures")
def test_several_kinds_are_identified_in_one_go() -> None:
    models = ("--model", "prandtl-ishlinskii", "--model", "dahl")
    options = ("--window", "1:", "--seed", "2", "--runs", "1", "-v")
    printed = ran("identify", "log.csv", *models, *options)
    assert names("results") == ["dahl.json", "prandtl-ishlinskii.json"]
    log = pt.read("log.csv")[1.0:]
    for fit in (
        pt.identify(log, "prandtl-ishlinskii"),
        pt.identify(log, "dahl", method=pt.Descents(seed=2)),
    ):
        assert as_printed(fit.summary()) in printed
        expected = fit.save("expected.json").read_bytes()
        assert Path("results", f"{fit.model.info.name}.json").read_bytes() == expected
    assert printed.index("Prandtl-Ishlinskii: stage") < printed.index("Dahl, second order: stage")


@pytest.mark.usefixtures("_no_pictures")
def test_by_default_the_kind_that_suits_the_log_is_found() -> None:
    printed = ran("identify", "log.csv", "--seed", "2", "--runs", "1", "-v")
    fit = pt.identify(pt.read("log.csv"), method=pt.Descents(seed=2))
    # But for the seconds that each model took.
    alike = [re.sub(r" +[0-9.]+ s(?=\n)", "", text) for text in (fit.summary(), printed)]
    assert as_printed(alike[0]) in alike[1]
    expected = fit.save("expected.json").read_bytes()
    assert names("results") == [f"{fit.model.info.name}.json"]
    assert Path("results", f"{fit.model.info.name}.json").read_bytes() == expected


@pytest.mark.slow
def test_pictures_of_several_kinds_do_not_collide() -> None:
    models = ("--model", "prandtl-ishlinskii", "--model", "dahl")
    second = ("--test", "log.csv", "--runs", "1")
    ran("identify", "log.csv", *models, *second)
    panels = ["loop", "time", "test_loop", "test_time"]
    pictures = {f"{m}_{panel}" for m in ("dahl", "prandtl-ishlinskii") for panel in panels}
    pictures.add("dahl_convergence")
    endings = {f"{name}.{ending}" for name in pictures for ending in ("png", "svg")}
    assert names("results") == sorted(endings | {"dahl.json", "prandtl-ishlinskii.json"})


def test_simulate_writes_the_displacement() -> None:
    write_model()
    lines = [line.rpartition(",")[0] for line in log_text().splitlines()]
    Path("drive.csv").write_text("\n".join(lines), encoding="utf-8")
    printed = ran("simulate", "dahl.json", "drive.csv", "--out", "run", "--hold", "zoh")
    assert names("run") == ["simulated.csv", "simulated.png", "simulated.svg"]
    assert "1001 samples" in printed
    back = pt.read("run/simulated.csv", hold="zoh")
    t, u = pt.data.read_drive("drive.csv")
    assert np.array_equal(back.u, u)
    assert np.allclose(back.t, t, atol=1e-12)
    x = pt.DahlStage.xu_li_2010().simulate(u, 0.004, hold="zoh").x + 1e-6
    assert np.allclose(back.y, x, rtol=1e-9, atol=1e-15)
    found = re.search(r"from (\S+) to (\S+) um", printed)
    assert found is not None


def test_simulate_draws_the_displacement_of_a_log_that_has_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn: list[Any] = []

    def plot(*signals: Any, measured: Any, **_: Any) -> Figure:
        drawn.append((signals[2], measured))
        return Figure()

    monkeypatch.setattr(views, "plot_response", plot)
    write_model()
    Path("log.csv").write_text(log_text(), encoding="utf-8")
    ran("simulate", "dahl.json", "log.csv", "--out", "run")
    ((x, measured),) = drawn
    y = pt.read("log.csv").y
    assert np.allclose(np.diff(measured), np.diff(y), atol=1e-15)
    assert measured.mean() == pytest.approx(x.mean())


@pytest.mark.slow
def test_the_demonstration_of_the_paper_tells_the_whole_story() -> None:
    printed = ran("demo", "--paper")
    pictures = [f"dahl_{picture}" for picture in PICTURES]
    tracked = ("feedforward", "pid", "all")
    pictures += [f"track_{name}.{ending}" for name in tracked for ending in ("png", "svg")]
    assert names("demo") == sorted(["dahl.json", "log.csv", *pictures])
    log = pt.read("demo/log.csv")
    assert len(log) == 60001
    assert log.dt == pytest.approx(1 / 5000.0)
    model = pt.load("demo/dahl.json")
    # The model does not have all that the virtual stage has: published, 5 um at most.
    for part in (log[:4.0], log[4.0:]):
        score = model.score(part)
        assert 0.098e-6 < score.rms < 2e-6
        assert score.max_error < 5e-6
    assert "test on the other 8 s: rms 1." in printed
    largest = {
        name: float(found)
        for name, found in re.findall(r"  (\S.*?) +max (\d+\.\d+) um, rms", printed)
    }
    # Published: 5.69, 4.44, within 1.5.
    assert 4.5 < largest["feedforward alone"] < 7.0
    assert 3.0 < largest["PID alone"] < 5.0
    assert largest["both, repetitive"] < 1.5
    assert "written to demo/: log.csv, dahl.json" in printed


def test_the_version_is_printed() -> None:
    assert ran("--version") == f"piezotrack {pt.__version__}\n"


CONTEXT = click.Context(app)
# The options that `ran(command, "--help")` has to name, of every command.
OPTIONS = {
    name: [
        option
        for parameter in command.params
        if parameter.param_type_name == "option"
        for option in (*parameter.opts, *parameter.secondary_opts)
    ]
    for name, command in (
        (name, app.get_command(CONTEXT, name)) for name in app.list_commands(CONTEXT)
    )
    if command is not None
}


@pytest.mark.parametrize("command", OPTIONS)
def test_help_names_every_option(command: str) -> None:
    printed = ran(command, "--help")
    assert OPTIONS[command]
    for option in OPTIONS[command]:
        assert re.search(rf"{option}\b", printed), option


NO_EFFECT = {
    "identify log.csv --model prandtl-ishlinskii --seed 1": "--seed",
    "identify log.csv --model prandtl-ishlinskii --runs 4": "--runs",
    "identify log.csv --model dahl --plays 5": "--plays",
    "identify log.csv --model dahl --model bouc-wen --asymmetry 2": "--asymmetry",
    "identify log.csv --fix stiffness=1e6 --plays 5": "--plays",
    "identify log.csv --fix mass=1": "--fix",
    "compare log.csv --model prandtl-ishlinskii --seed 1": "--seed",
    "reproduce --quick --draws 3": "--draws",
    "track m.json sine:1Hz,0..9um --no-feedforward --online": "--online",
    "track m.json sine:1Hz,0..9um --no-feedback --kp 0.1": "--kp",
    "track m.json sine:1Hz,0..9um --kq 1": "--kq",
    "track m.json sine:1Hz,0..9um --tq 0.1": "--tq",
    "track m.json sine:1Hz,0..9um --stage xu-li-2010 --noise 5nm": "--noise",
    "track m.json sine:1Hz,0..9um --seed 2": "--seed",
    "contour m.json circle:1Hz,1um --seed 2": "--seed",
    "contour circle:1Hz,1um --no-feedforward --decouple": "--decouple",
    "contour circle:1Hz,1um --no-feedback --ti 0.1": "--ti",
}


@pytest.mark.parametrize("command", NO_EFFECT)
def test_an_option_without_effect_is_refused_by_name(command: str) -> None:
    assert refusal(*command.split()).startswith(f"{NO_EFFECT[command]} has no effect with")


@pytest.mark.slow
def test_the_installed_command_works_and_repeats_itself() -> None:
    script = Path(sys.executable).with_name("piezotrack")
    command = [str(script)] if script.exists() else COMMAND
    for seed in ("1", "2"):
        # The order of sets and dicts of texts must not show.
        done = subprocess.run(
            [*command, "identify", "log.csv", *PAPER, "--out", f"out{seed}"],
            capture_output=True,
            text=True,
            timeout=60.0,
            check=False,
            env={**os.environ, "PYTHONHASHSEED": seed},
        )
        assert (done.returncode, without_progress(done.stderr)) == (0, "")
    assert names("out1") == names("out2") == RESULTS
    for name in RESULTS:
        assert Path("out1", name).read_bytes() == Path("out2", name).read_bytes(), name


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_keeps_the_best_so_far(number: signal.Signals, code: int) -> None:
    search = ["identify", "log.csv", "--model", "dahl", "--runs", "10000", "--out", "out"]
    with subprocess.Popen(
        [*COMMAND, *search], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            # The first cost takes seconds on a busy machine.
            time.sleep(5.0)
            sent = time.monotonic()
            process.send_signal(number)
            output, errors = process.communicate(timeout=30.0)
        finally:
            process.kill()
    assert time.monotonic() - sent < 3.0
    assert (process.returncode, output) == (code, "")
    assert re.fullmatch(
        r"piezotrack: interrupted after \d+ simulations[^\n]+\n", without_progress(errors)
    )
    assert str(Path("out", "dahl.partial.json")) in errors
    assert names("out") == ["dahl.partial.json"]
    assert pt.load("out/dahl.partial.json").score(quick()).rms < 20e-6


# Whole files or none.


def content(folder: str) -> dict[str, bytes]:
    return {name: Path(folder, name).read_bytes() for name in names(folder)}


def test_a_failure_while_writing_leaves_all_old_files(monkeypatch: pytest.MonkeyPatch) -> None:
    ran("identify", "log.csv", *PAPER)
    before = content("results")
    drawn: list[object] = []
    savefig = Figure.savefig

    def some(figure: Figure, path: Path, **options: Any) -> None:
        if len(drawn) == 3:
            raise OSError(28, "No space left on device")
        drawn.append(path)
        savefig(figure, path, **options)

    monkeypatch.setattr(Figure, "savefig", some)
    result = run("identify", "log.csv", *PAPER, "--seed", "5", "--overwrite")
    assert result.exit_code == 2
    assert result.stderr.endswith("cannot be written: no space left on device\n")
    assert without_progress(result.stderr).count("\n") == 1
    assert len(drawn) == 3
    assert content("results") == before


@pytest.mark.usefixtures("_no_pictures")
def test_a_log_without_a_header_can_be_named_by_number() -> None:
    write("bare.csv", log_text().partition("\n")[2])
    columns = ("--time", "0", "--drive", "1", "--displacement", "2")
    units = ("--unit", "time=s", "--unit", "drive=V", "--unit", "displacement=um")
    ran("identify", "bare.csv", *columns, *units, *PAPER)


def through(environment: dict[str, str], *arguments: str, **options: Any) -> tuple[int, str]:
    done = subprocess.run(
        [*COMMAND, *arguments],
        stderr=subprocess.PIPE,
        text=True,
        timeout=60.0,
        check=False,
        env={**os.environ, **environment},
        **options,
    )
    return done.returncode, without_progress(done.stderr)


@pytest.mark.slow
def test_a_name_that_the_terminal_cannot_show_is_no_reason_to_fail() -> None:
    write("\N{GREEK SMALL LETTER MU}.csv", log_text())
    ascii_only = {"PYTHONIOENCODING": "ascii"}
    name = "\N{GREEK SMALL LETTER MU}.csv"
    code, errors = through(ascii_only, "identify", name, *PAPER, stdout=subprocess.DEVNULL)
    assert (code, errors) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device here")
def test_results_are_written_also_where_nothing_can_be_printed() -> None:
    with Path("/dev/full").open("w") as full:
        code, errors = through(
            {"PYTHONUNBUFFERED": "1"}, "identify", "log.csv", *PAPER, stdout=full
        )
    assert "Traceback" not in errors
    assert code != 0
    assert names("results") == RESULTS
