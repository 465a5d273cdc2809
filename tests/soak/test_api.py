"""Public names called with what they do not expect: only their own errors, short, may come."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import strategies as st

import all_stages
import piezotrack as pt
from edge_values import (
    Slot,
    anything,
    arguments,
    count,
    finite_number,
    number,
    numbers,
    signal,
    slots_of,
    texts,
    truth,
    word,
)
from fuzzing import fuzz
from piezotrack.stages.registry import MODELS
from reference_slots import OTHER_FORMS, PATHS, REFERENCES
from soak import Script, Tally

if TYPE_CHECKING:
    from collections.abc import Callable

    Draw = Callable[[st.SearchStrategy[Any]], Any]
    Target = Callable[[Script, Draw], None]

pytestmark = [
    pytest.mark.slow,
    # A call stopped for its time may be stopped in a callback of Python's own, which says so.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

DAHL = pt.DahlStage.xu_li_2010()
VIRTUAL = pt.VirtualStage.xu_li_2010(seed=1)
SINE = pt.sine(frequency=1.0, low=0.0, high=50e-6, duration=1.0)
TINY = pt.ParticleSwarm(particles=4, iterations=3)


# Whether so many samples are work and not a mistake, and too many here.
def sizeable(samples: float) -> bool:
    return 1e6 < samples < 1e11


STAGES = {f"pt.{type(one).__name__}": one for one in all_stages.STAGES.values()}
PLAYS = STAGES["pt.PrandtlIshlinskiiStage"]
DYNAMICS = {
    "time_constant": Slot(None, number(1e-3).other),
    "frequency": Slot(None, number(160.0).other),
    "damping_ratio": Slot(None, number(0.05).other),
}
STATES = {
    "pt.DahlStage": ("pt.stages.DahlState", pt.stages.DahlState()),
    "pt.BoucWenStage": ("pt.stages.BoucWenState", pt.stages.BoucWenState()),
}
SIMULATE = {
    "u": signal(60, 30.0),
    "dt": number(1e-3),
    "hold": word("foh", "zoh"),
    "accuracy": number(1e-10),
}


def stage(script: Script, draw: Draw, *, most: int = 3) -> tuple[str, Any]:
    name = draw(st.sampled_from(list(STAGES)))
    slots = slots_of(STAGES[name])
    slots |= {k: v for k, v in DYNAMICS.items() if k in slots}
    return name, script.new(name, **arguments(draw, slots, most=most))


def simulate(script: Script, draw: Draw) -> None:
    name, made = stage(script, draw)
    if made is None:
        return
    slots = SIMULATE
    if name == "pt.DahlStage":
        slots = slots | {"method": word("exponential", "rk4", "rk45")}
    given = arguments(draw, slots, most=2)
    if draw(st.integers(0, 3)) == 0:
        state, right = STATES.get(name, ("pt.stages.ForceState", pt.stages.ForceState()))
        fields = {k: number(0.0, near=1e-6) for k in slots_of(right)}
        given["initial"] = script.new(state, **arguments(draw, fields))
    script.on(made, "simulate", **given)


def invert(script: Script, draw: Draw) -> None:
    _, made = stage(script, draw, most=1)
    if made is None:
        return
    slots = {
        "stage": Slot(made, st.just(made)),
        "offset": number(0.0, near=1e-6),
        "delay": number(0.0, near=1e-3),
        "playback": word("table", "online"),
        "settle": count(1),
    }
    inverse = script.new("pt.Inverse", **arguments(draw, slots, most=2))
    if inverse is None:
        return
    dt = number(0.02).draw(draw, odd=draw(st.integers(0, 3)) == 0)
    for method in draw(st.sets(st.sampled_from(["voltage", "table", "played"]), max_size=2)):
        script.on(inverse, method, SINE, dt)
    session = script.on(inverse, "start", dt, again=False)
    if session is None:
        return
    steps = {k: number(v, near=1e-5) for k, v in PREVIEWS.items()}
    for _ in range(draw(st.integers(1, 4))):
        given = arguments(draw, {"reference": number(1e-5), **steps}, most=2)
        script.on(session, "step", given.pop("reference"), again=False, finite=False, **given)


PREVIEWS = {"velocity": None, "acceleration": None, "preview": None}


CYCLES = {"swing": number(30.0), "rest": number(0.0, near=1.0)}
AROUND = {
    "noise": number(0.0, near=1e-8), "noise_bandwidth": number(200.0),
    "resolution": number(0.0, near=1e-8), "delay": number(None, near=1e-3),
    "bandwidth": number(500.0), "slew": number(1e5), "limits": numbers(-20.0, 120.0),
    "creep": anything(None, {}, {0.1: 0.01}, {1.0: 0.01, 10.0: -1.0}, [0.1], {"a": 0.1}),
    "mode": Slot(None, numbers(160.0, 0.065).other), "seed": count(1),
}  # fmt: skip


def virtual(script: Script, draw: Draw) -> None:
    _, model = stage(script, draw, most=1)
    amplifier = script.new("pt.stages.Amplifier", **arguments(draw, slots_of(VIRTUAL.amplifier)))
    sensor = script.new("pt.stages.Sensor", **arguments(draw, slots_of(VIRTUAL.sensor)))
    if draw(st.booleans()):
        made = script.new("pt.VirtualStage.of", model, **arguments(draw, AROUND))
    else:
        cycles = script.new("pt.stages.Preconditioning", **arguments(draw, CYCLES))
        parts = {"stage": model, "amplifier": amplifier, "sensor": sensor}
        made = script.new("pt.VirtualStage", **parts, preconditioning=cycles, step=5e-5)
    if made is not None:
        slots = {k: v for k, v in SIMULATE.items() if k != "accuracy"}
        given = arguments(draw, slots, most=1)
        script.on(made, draw(st.sampled_from(["simulate", "record"])), **given)


def two_axes(script: Script, draw: Draw) -> None:
    slots = {
        "x": anything(VIRTUAL, VIRTUAL, DAHL, PLAYS),
        "y": anything(VIRTUAL, VIRTUAL, DAHL, PLAYS),
        "cross_talk": numbers(0.01, 0.01),
        "lag": number(0.0, near=1e-3),
    }
    made = script.new("pt.XYStage", **arguments(draw, slots, most=2))
    if made is None:
        return
    ux = signal(30, 30.0).draw(draw, odd=draw(st.integers(0, 4)) == 0)
    uy = ux if draw(st.booleans()) else signal(30, 30.0).draw(draw, odd=False)
    dt = number(1e-3).draw(draw, odd=draw(st.integers(0, 4)) == 0)
    script.on(made, draw(st.sampled_from(["simulate", "record"])), ux, uy, dt)


# References.


def use_reference(script: Script, draw: Draw, made: Any) -> None:
    dt = number(0.01).draw(draw, odd=draw(st.integers(0, 2)) == 0)
    if not (isinstance(dt, float) and dt > 0 and sizeable(made.duration / dt)):
        script.on(made, "sample", dt)
    kind = draw(st.integers(0, 7))
    if kind == 0:
        script.on(made, "at", number(1.0).draw(draw, odd=True))
    elif kind == 1:
        script.on(made, "at", numbers(0.0, 1.0).draw(draw, odd=True))


def references(script: Script, draw: Draw) -> None:
    table = draw(st.sampled_from([REFERENCES, REFERENCES, OTHER_FORMS]))
    name = draw(st.sampled_from(list(table)))
    made = script.new(name, **arguments(draw, table[name]))
    if made is not None:
        use_reference(script, draw, made)


def paths(script: Script, draw: Draw) -> None:
    name = draw(st.sampled_from(list(PATHS)))
    made = script.new(name, **arguments(draw, PATHS[name]))
    if made is None:
        return
    axis = script.on(made, "x", again=False, finite=False)
    use_reference(script, draw, axis)
    kind = draw(st.integers(0, 3))
    if kind == 0:
        x = signal(20, 1e-5).draw(draw, odd=draw(st.integers(0, 3)) == 0)
        script.on(made, "errors", x, x)
    elif kind == 1:
        entry = st.one_of(finite_number(1.0), number(1.0).other)
        row = st.lists(entry, min_size=2, max_size=2)
        script.on(made, "transformed", draw(st.lists(row, min_size=2, max_size=2)), finite=False)


def written(script: Script, draw: Draw) -> None:
    name = draw(st.sampled_from(["pt.parse_reference", "pt.references.parse_path"]))
    duration = number(None, near=4.0).draw(draw, odd=draw(st.booleans()))
    made = script.new(name, draw(texts()), duration=duration)
    if isinstance(made, pt.Reference) and made.duration < 1e3:
        script.on(made, "sample", 0.02)


# Control.

FEEDBACKS: dict[str, dict[str, Slot]] = {
    "pt.Pid": {
        "kp": number(1.2e5), "ti": number(0.009), "td": number(0.044),
        "tt": number(None, near=0.02),
    },
    "pt.Pid.from_um": {"kp": number(0.12), "ti": number(0.009), "td": number(0.044)},
    "pt.control.StateSpace": {
        "a": anything([[0.5]], [[2.0]], [], [[0.5, 0.1], [0.0, 0.2]], [[1.0], [2.0]], [[1e300]]),
        "b": numbers(2000.0), "c": numbers(1.0), "d": number(0.0),
        "back": Slot(None, numbers(0.1).other),
    },
}  # fmt: skip
SMOOTHING = anything(
    pt.control.Lag(), pt.control.Lag(tq=0.02, compensated=True), pt.control.ZeroPhase(), None
)
REPETITIVE = {
    "period": number(5.0), "kq": number(1e6), "smoothing": SMOOTHING, "lead": count(0),
    "forgetting_factor": number(0.99), "pause": truth(True),
}  # fmt: skip
FILTERS: dict[str, dict[str, Slot]] = {
    "pt.LowPass": {"cutoff": number(10.0)},
    "pt.Notch": {"frequency": number(10.0), "width": number(0.5), "depth": number(0.0)},
    "pt.control.Lag": {"tq": number(0.2), "compensated": truth(False)},
    "pt.control.ZeroPhase": {"order": count(2)},
}
PLANTS = [VIRTUAL, *STAGES.values()]


def controller(script: Script, draw: Draw) -> Any:
    slots: dict[str, Slot] = {"dt": number(0.02), "limits": numbers(0.0, 75.0, most=3)}
    given = arguments(draw, slots, most=1)
    if draw(st.integers(0, 2)):
        name = draw(st.sampled_from(list(FEEDBACKS)))
        given["feedback"] = script.new(name, **arguments(draw, FEEDBACKS[name], most=2))
    if draw(st.integers(0, 2)) == 0:
        given["repetitive"] = script.new("pt.Repetitive", **arguments(draw, REPETITIVE, most=2))
    if draw(st.integers(0, 2)) == 0:
        names = draw(st.lists(st.sampled_from(list(FILTERS)), max_size=3))
        filters = [script.new(name, **arguments(draw, FILTERS[name], most=1)) for name in names]
        given["filters"] = [part for part in filters if part is not None]
    if draw(st.integers(0, 2)) == 0:
        given["feedforward"] = DAHL.inverse()
    return script.new("pt.Controller", **given)


def check(script: Script, draw: Draw) -> None:
    loop = controller(script, draw)
    if loop is None:
        return
    delay = number(0.0, near=1e-2).draw(draw, odd=draw(st.booleans()))
    plant = draw(st.sampled_from(PLANTS))
    report = script.new("pt.check_loop", plant, loop, delay=delay)
    if report is not None:
        script.on(report, "__str__")
        if draw(st.integers(0, 3)) == 0:
            script.on(report, "response", count(20).draw(draw, odd=False))


TIMING = {
    "delay": number(0.0, near=1e-2), "jitter": number(0.0, near=1e-2),
    "voltages_before": numbers(75.0, 0.0),
}  # fmt: skip
RUN = {
    "substeps": count(2), "beyond_reach": truth(True), "unstable": truth(True),
}  # fmt: skip


def run_arguments(script: Script, draw: Draw, slots: dict[str, Slot]) -> dict[str, Any]:
    given = arguments(draw, slots, most=1)
    if draw(st.booleans()):
        given["timing"] = script.new("pt.Timing", **arguments(draw, TIMING, most=1))
    return given


def track(script: Script, draw: Draw) -> None:
    loop = controller(script, draw)
    if loop is None or sizeable(100 * SINE.duration / loop.dt):
        return
    given = run_arguments(script, draw, RUN)
    run = script.new("pt.track", draw(st.sampled_from(PLANTS)), loop, SINE, **given)
    if run is not None:
        script.on(run, "summary")
        score = {"start": number(None, near=0.2), "stop": number(None, near=0.9)}
        script.on(run, "score", finite=False, **arguments(draw, score))


XY = pt.XYStage.xu_li_2010(seed=1)
CIRCLE = pt.circle(frequency=1.0, radius=1e-5, duration=0.5)


def contour(script: Script, draw: Draw) -> None:
    loop = controller(script, draw)
    if loop is None or sizeable(100 * CIRCLE.duration / loop.dt):
        return
    slots = RUN | {"decoupling": Slot(None, st.one_of(st.just(np.eye(2)), numbers(1.0, 0.0).other))}
    run = script.new("pt.contour", XY, [loop, loop], CIRCLE, **run_arguments(script, draw, slots))
    if run is not None:
        script.on(run, "summary")


# Data and identification.


def dataset(script: Script, draw: Draw, longest: int = 60) -> Any:
    u = signal(longest, 30.0).draw(draw, odd=draw(st.integers(0, 4)) == 0)
    y = signal(longest, 1e-5).draw(draw, odd=draw(st.integers(0, 4)) == 0)
    if isinstance(u, np.ndarray) and isinstance(y, np.ndarray) and draw(st.integers(0, 9)):
        shorter = min(u.shape[0], y.shape[0])
        u, y = u[:shorter], y[:shorter]
    slots = {
        "dt": number(0.01), "hold": word("foh", "zoh"), "drive_unit": word("V", "N"),
        "columns": anything(None, {"a": u}, {1: u}, {"": y}, {"a": "b"}),
        "column_units": anything(None, {"a": "V"}, {"b": 1}),
        "source": anything(None, "a.csv", "\x1b[31m", "a" * 600),
    }  # fmt: skip
    given = arguments(draw, slots, most=2)
    if draw(st.integers(0, 4)) == 0:
        even = draw(st.booleans()) and isinstance(u, np.ndarray)
        given["t"] = 0.01 * np.arange(u.size) if even else y
        given["dt"] = None
    return script.new("pt.Dataset", u=u, y=y, **given)


def records(script: Script, draw: Draw) -> None:
    made = dataset(script, draw)
    if made is None:
        return
    for name in ("__repr__", "sha256", "stroke", "t", "duration"):
        script.on(made, name)
    window = {"start": number(None, near=0.1), "stop": number(None, near=0.4)}
    part = script.on(made, "cut", **arguments(draw, window))
    for name in ("decimate", "interpolate"):
        factor = count(2).draw(draw, odd=draw(st.booleans()))
        script.on(made if part is None else part, name, factor)


def readings(script: Script, draw: Draw) -> None:
    made = dataset(script, draw)
    if made is None:
        return
    noise = script.new("pt.identification.identify_noise", made)
    if noise is not None:
        script.on(noise, "summary")
    step = script.new("pt.identify_step", made)
    if step is not None:
        script.on(step, "summary")
    script.new("pt.identification.identify_cross_talk", (made, made), (made, made))


STEP = pt.identification.StepReadings.xu_li_2010()


def step_readings(script: Script, draw: Draw) -> None:
    made = script.new("pt.identification.StepReadings", **arguments(draw, slots_of(STEP)))
    if made is None:
        return
    slots = {
        "stiffness": number(None, near=26065.0), "mass": number(None, near=0.18),
        "second_level": Slot(None, numbers(50.0, 7e-5).other),
    }  # fmt: skip
    step = script.new("pt.identify_step", made, **arguments(draw, slots, most=2))
    if step is not None:
        script.on(step, "summary")
        script.on(step, "notes")


# Models by their names: those that a swarm searches, and those of least squares.
KINDS = {model.name: all_stages.STAGES[model.name] for model in MODELS if model.searched}
WEIGHTED = [model.name for model in MODELS if not model.searched]
TIES = st.sampled_from(["1.57 * stiffness", "mass ** -2", "-(damping)", "log(mass)", "2 *", ""])


def identify(script: Script, draw: Draw) -> None:
    made = dataset(script, draw, longest=40)
    if made is None:
        return
    kind = draw(st.sampled_from(list(KINDS)))
    names = st.sampled_from([*KINDS[kind].parameter_names(), "x"])
    box = st.tuples(number(0.1).other, number(10.0).other)
    entry = st.one_of(number(1.0).other, box, names, TIES)
    slots = {
        "parameters": Slot(None, st.dictionaries(names, entry, max_size=4)),
        "constraints": Slot(None, st.lists(st.tuples(names, names).map(" < ".join), max_size=2)),
        "offset": truth(True),
        "delay": Slot(None, st.one_of(st.booleans(), number(1e-3).other, box)),
        "threads": anything(1, 2, 0, -1, 257, 2**64),
    }  # fmt: skip
    fit = script.new("pt.identify", made, kind, method=TINY, **arguments(draw, slots, most=2))
    use_fit(script, fit, made)


def use_fit(script: Script, fit: Any, data: Any) -> None:
    if fit is not None:
        for name in ("summary", "notes", "cost", "document"):
            script.on(fit, name, finite=name != "document")
        script.on(fit, "score", data)


def least_squares(script: Script, draw: Draw) -> None:
    made = dataset(script, draw)
    if made is None:
        return
    slots = {
        "count": count(4), "thresholds": Slot(None, numbers(0.0, 5.0, 10.0).other),
        "dead_zones": anything(True, False, 0, 3), "dynamics": word("first", "second", None),
        "creep": Slot(False, st.one_of(st.booleans(), numbers(0.1, 1.0).other)),
    }  # fmt: skip
    how = script.new("pt.LeastSquares", **arguments(draw, slots, most=2))
    if how is not None:
        kind = draw(st.sampled_from(WEIGHTED))
        slots = {
            "offset": truth(True), "drift": Slot(None, st.one_of(st.booleans(), number(1.0).other)),
            "delay": Slot(None, st.one_of(st.booleans(), number(1e-3).other)),
        }  # fmt: skip
        given = arguments(draw, slots, most=2)
        fit = script.new("pt.identify", made, kind, method=how, **given)
        use_fit(script, fit, made)


LOG = pt.Dataset(
    u=(volts := 30 * (1 - np.cos(2 * np.pi * np.arange(100) / 50))),
    y=DAHL.simulate(volts, 0.02).x,
    dt=0.02,
)
SWARM = slots_of(
    pt.ParticleSwarm(particles=4, iterations=3, inertia_iterations=3, stall_iterations=5),
    particles=Slot(4, st.integers(-1, 20)),
    iterations=Slot(3, st.integers(-1, 8)),
    update=word("classic", "hypersphere", "hypersphere-radial"),
    topology=word("ring", "global", "random"),
    boundary=word("absorb", "rebound", "reflect", "invisible"),
    seed=count(1),
    runs=anything(1, 2, 0, -1, 1.5, 3),
)


def swarm(script: Script, draw: Draw) -> None:
    made = script.new("pt.ParticleSwarm", **arguments(draw, SWARM))
    if made is not None:
        use_fit(script, script.new("pt.identify", LOG, "dahl", method=made), LOG)


# Name, body, and its share of the calls: what is slow has less.
TARGETS: list[tuple[str, Target, float]] = [
    ("stages: simulate", simulate, 3),
    ("stages: inverse", invert, 3),
    ("stages: virtual", virtual, 3),
    ("stages: two axes", two_axes, 2),
    ("references", references, 6),
    ("references: paths", paths, 4),
    ("references: texts", written, 6),
    ("control: check_loop", check, 2),
    ("control: track", track, 2),
    ("control: contour", contour, 2),
    ("data: Dataset", records, 6),
    ("identification: logs", readings, 3),
    ("identification: step readings", step_readings, 4),
    ("identification: identify", identify, 3),
    ("identification: least squares", least_squares, 3),
    ("identification: swarm", swarm, 2),
]
SHARES = sum(share for _, _, share in TARGETS)


@pytest.mark.parametrize(("name", "body", "share"), TARGETS, ids=[name for name, *_ in TARGETS])
def test_a_call_answers_or_refuses_in_a_sentence(
    name: str, body: Target, share: float, request: pytest.FixtureRequest, record_property: Any
) -> None:
    tally = Tally(name)
    calls = int(request.config.getoption("--soak-calls") * share / SHARES)
    fuzz(tally, body, calls=calls, start=request.config.getoption("--soak-seed"))
    record_property("tally", tally.row())
    tally.verdict()
