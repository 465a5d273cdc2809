"""One of each class that has a picture, and of each function that draws one by itself."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

import piezotrack as pt
from campaigns import QUICK
from piezotrack.cli.research.loop_plot import plot_before_and_after
from piezotrack.control.on_device.closed_loop import DeviceTracking
from piezotrack.control.on_device.latency import latency_of
from piezotrack.control.views.tracking_plot import plot_feedforward
from piezotrack.identification.views.plot import plot_response
from piezotrack.xu_li_2010.views.block_diagrams import plot_block_diagrams
from watched_records import model_watched, watched

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["FUNCTIONS", "OBJECTS", "SLOW"]

UM = 1e-6
LIMITS = (0.0, 75.0)
FEW = pt.TuningSearch(particles=8, iterations=4, seed=1)
PLAYS = pt.stages.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(5.0, 15.0), weights=(1e-7, 1e-7), frequency=200.0, damping_ratio=0.1
)
SINE = pt.sine(frequency=5.0, low=20e-6, high=60e-6, duration=1.2)


@cache
def stage() -> pt.VirtualStage:
    return pt.VirtualStage.xu_li_2010(seed=1)


def plays() -> pt.VirtualStage:
    return pt.VirtualStage.of(PLAYS, noise=5e-9, seed=3)


@cache
def loop(repetitive: bool = False) -> pt.Controller:
    return pt.Controller(
        dt=0.02,
        limits=LIMITS,
        feedforward=pt.DahlStage.xu_li_2010().inverse(),
        feedback=pt.Pid.xu_li_2010(),
        repetitive=pt.Repetitive.from_um(period=1.0, tq=0.2, kq=1.0) if repetitive else None,
    )


@cache
def log() -> pt.Dataset:
    return pt.datasets.dbo_training()[3.0:11.0]


@cache
def fit() -> pt.identification.Identification:
    return pt.identify(log(), "prandtl-ishlinskii", progress=False)


@cache
def searched() -> pt.identification.Identification:
    few = pt.ParticleSwarm(iterations=20, runs=3, seed=1)
    return pt.identify(log()[3.0:5.0], "dahl", method=few, progress=False)


@cache
def stepped() -> pt.identification.StepResult:
    u = np.concatenate([np.zeros(100), np.full(1500, 75.0)])
    return pt.identify_step(stage().record(u, 2e-4, hold="zoh"))


@cache
def tracked() -> pt.control.Tracking:
    reference = pt.sine(frequency=1.0, low=0.0, high=110 * UM, duration=3.0)
    return pt.track(stage(), loop(repetitive=True), reference, unstable=True)


@cache
def traced() -> pt.control.Contour:
    path = pt.circle(frequency=1.0, radius=5 * UM, duration=2.0)
    return pt.contour(pt.XYStage.xu_li_2010(seed=1), (loop(), loop()), path)


def measured_response() -> pt.FrequencyResponse:
    lines = pt.RandomPhaseMultisine(band=(4.0, 400.0), low=30.0, high=45.0)
    return pt.frequency_response(plays(), lines, rate=2000.0)


def axes_model() -> pt.multiaxis.MultiAxisModel:
    axes = pt.multiaxis.VirtualAxes.three(cubic=0.04, noise=2e-9, seed=1)
    return pt.multiaxis.identify_axes(
        [axes.record(samples=256, level=level) for level in (0.5, 1.5)]
    )


def axes_run() -> pt.multiaxis.MultiAxisTracking:
    wanted = np.zeros((400, 3))
    wanted[50:, 0] = UM
    axes = pt.multiaxis.VirtualAxes.three()
    return pt.multiaxis.track_axes(axes, wanted, pt.Pid(kp=0.005, ti=5e-4))


def verified() -> pt.control.Verification:
    lines = pt.RandomPhaseMultisine(band=(5.0, 400.0), low=-1.0, high=1.0)
    law = pt.Pid(kp=5e3, ti=5e-5, td=0.02)
    return pt.verify(
        plays(), pt.Controller(dt=1e-3, limits=LIMITS, feedback=law), lines, level=30 * UM
    )


def campaign() -> pt.identification.Campaign:
    """Four records: three seeds of a search, and least squares."""
    records = {f"record {i}": log()[3.0 : 4.5 + 0.1 * i] for i in range(4)}
    models = {"quick": QUICK, "plays": {"model": "prandtl-ishlinskii"}}
    with TemporaryDirectory() as folder:
        return pt.campaign(records, models, range(3), folder=folder)


def windows() -> pt.identification.Campaign:
    """One model of eight windows."""
    records = {f"window {i}": log()[3.0 + i : 4.0 + i] for i in range(8)}
    with TemporaryDirectory() as folder:
        return pt.campaign(records, {"plays": {"model": "prandtl-ishlinskii"}}, folder=folder)


def on_device() -> DeviceTracking:
    """As on a device that begins far from the reference, without waiting for its clock."""
    reference = pt.sine(frequency=1.0, low=20e-6, high=40e-6, duration=2.0)
    run = pt.track(stage(), loop(), reference, beyond_reach=True)
    late = np.full(run.t.size, 1e-4)
    values = {one.name: getattr(run, one.name) for one in fields(run)}
    return DeviceTracking(**values, latency=latency_of(late), lateness=late)


def tuned() -> pt.control.Tuned:
    return pt.tune(plays(), SINE, dt=1e-3, limits=LIMITS, parts=["pid"], search=FEW)


def compared() -> pt.control.ControllerComparison:
    return pt.compare_controllers(
        plays(), PLAYS, dt=1e-3, limits=LIMITS, references=[SINE], searches=1, search=FEW,
        controllers=["inverse", "inverse + PID", "inverse + PID + repetitive"],
    )  # fmt: skip


def learnt() -> pt.control.Learning:
    given = pt.Controller(dt=1e-3, limits=LIMITS, feedforward=PLAYS.inverse())
    return pt.learn(plays(), SINE, given, model=PLAYS, trials=4)


def table_2() -> Any:
    return pt.xu_li_2010.run_table_2(pt.XYStage.xu_li_2010(seed=1), (loop(), loop()))


def several() -> pt.identification.Identification:
    return pt.identify([log()[3.0:6.0], log()[6.0:9.0]], "prandtl-ishlinskii", progress=False)


def stored() -> pt.identification.IdentifiedModel:
    with TemporaryDirectory() as folder:
        return pt.load(fit().save(f"{folder}/model.json"))


def suggested() -> Any:
    return pt.suggest_drive(PLAYS, limits=LIMITS, slew=2000.0, seconds=2.0, dt=2e-3, noise=2e-9)


OBJECTS: dict[str, Callable[[], Any]] = {
    "Benchmark": lambda: pt.benchmark(
        ["asymmetry"], ["plays-nnls", "prandtl-ishlinskii", "first-order-dahl"]
    ),
    "Campaign": campaign,
    "Campaign, one model": windows,
    "Comparison": lambda: pt.compare(
        log(), ["prandtl-ishlinskii", "preisach", "duhem", "maxwell-slip"]
    ),
    "Confidence": lambda: searched().confidence(),
    "Contour": traced,
    "ControllerComparison": compared,
    "Dataset": log,
    "DeviceTracking": on_device,
    "FrequencyResponse": measured_response,
    "MultiAxisModel": axes_model,
    "MultiAxisTracking": axes_run,
    "Health": lambda: pt.watch(model_watched(), watched(31)),
    "Identification": searched,
    "Identification, plays": fit,
    "Identification, several": several,
    "IdentifiedModel": stored,
    "Learning": learnt,
    "LoopReport": lambda: pt.check_loop(stage(), loop(repetitive=True)),
    "ModalFit": lambda: pt.fit_modes(measured_response()),
    "ModelViews": stored,
    "Noise": lambda: pt.identification.identify_noise(stage().record(np.zeros(5000), 2e-4)),
    "PredictionBand": lambda: fit().prediction_band(log()),
    "Reproduction": lambda: pt.xu_li_2010.reproduce(seeds=2),
    "Residual": lambda: pt.identification.residual_of(fit()),
    "Schedule": lambda: pt.schedule(
        stage(), [10e-6, 40e-6], [0.5, 1.0], centre=60e-6, dt=0.02, limits=LIMITS, search=FEW
    ),
    "StepResult": stepped,
    "SuggestedDrive": suggested,
    "Table2": table_2,
    "Tracking": tracked,
    "Tuned": tuned,
    "Verification": verified,
}
SLOW = ("Reproduction",)


def response(**look: Any) -> Any:
    t, u = log().t, log().u
    run = fit().simulate(log())
    return plot_response(t, u, run.x, title="Response", measured=log().y, **look)


def feedforward(**look: Any) -> Any:
    run = tracked()
    return plot_feedforward(run.t, run.feedforward, run.desired, limits=LIMITS, **look)


def before_and_after(**look: Any) -> Any:
    runs = {"voltage alone": tracked(), "feedforward": tracked(), "feedforward and PID": tracked()}
    return plot_before_and_after(runs, **look)


# Pictures that are no method of a class, by the functions that draw them.
def amplitudes(**look: Any) -> Any:
    sizes = (1.0, 10.0)
    lines = [pt.RandomPhaseMultisine(band=(4.0, 40.0), low=30.0 - a, high=30.0 + a) for a in sizes]
    responses = [pt.frequency_response(PLAYS, one, rate=1000.0) for one in lines]
    return pt.response.plot_amplitudes(responses, 4.0, model=PLAYS, **look)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "plot_amplitudes": amplitudes,
    "plot_response": response,
    "plot_feedforward": feedforward,
    "plot_before_and_after": before_and_after,
    "plot_block_diagrams": plot_block_diagrams,
}
