from collections.abc import Callable, Sequence
from typing import Any, Literal, Protocol, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .identification.problem.problem import Problem
from .identification.solve.weights import Structure

__all__ = [
    "INSTRUCTION_SET",
    "INTERVALS",
    "LARGEST",
    "MOST_SAMPLES",
    "Checkpoint",
    "Controller",
    "Conventional",
    "DescentSettings",
    "DistortedModes",
    "Inverse",
    "LeastSquaresFit",
    "LocalFit",
    "LoopPlant",
    "ModalFit",
    "ModalSystem",
    "Objective",
    "PathTask",
    "Regressors",
    "Response",
    "Search",
    "Session",
    "SoughtController",
    "Stage",
    "StepResponse",
    "Swarm",
    "SwarmSettings",
    "Task",
    "TrackingRun",
    "VirtualRun",
    "VirtualStage",
    "XYStage",
    "__version__",
    "aligned_terms",
    "as_count",
    "as_number",
    "as_truth",
    "autoregression",
    "balanced_terms",
    "bounded_least_squares",
    "check_loop",
    "check_margins",
    "check_part",
    "choose_distortion",
    "circle_errors",
    "cross_talk_share",
    "delayed",
    "identify",
    "identify_weights",
    "law_reference_numerator",
    "law_transfer_function",
    "linearised_covariance",
    "loop_response",
    "models",
    "nnls",
    "parts",
    "path_errors",
    "period_metrics",
    "published",
    "read_step",
    "resampled_noises",
    "residual",
    "resonances",
    "sensor_noise",
    "spread",
    "tied_values",
    "tracking_metrics",
    "tune",
    "tuning_costs",
    "turns",
    "turns_often",
    "voltages_before",
]

__version__: str
INSTRUCTION_SET: str
INTERVALS: tuple[float, float]
LARGEST: float
MOST_SAMPLES: int

def as_number(name: str, value: object) -> float: ...
def as_count(name: str, value: object) -> int: ...
def as_truth(name: str, value: object) -> bool: ...
def check_part(role: str, part: tuple[str, list[float]]) -> None: ...
def check_margins(gain: float, phase: float, sensitivity: float, learning: float) -> None: ...
def models() -> list[dict[str, Any]]: ...
def parts() -> list[dict[str, Any]]: ...
def published(model: str, name: str) -> _Named: ...
def delayed(x: ArrayLike, v: ArrayLike, dt: float, delay: float) -> NDArray[np.float64]: ...
def voltages_before(
    u: ArrayLike, dt: float, hold_name: str, history: str, before: float
) -> NDArray[np.float64]: ...
def identify(
    problem: Problem,
    *,
    method: SwarmSettings | DescentSettings,
    seed: int,
    runs: int,
    start: Sequence[float] | None,
    threads: int,
    callback: Callable[[int, int, int, float, list[float], float], bool] | None,
    progress: Callable[[int, int, int, float, list[float], float], None] | None,
    checkpoint: Checkpoint | None,
) -> Search | None: ...

@final
class Checkpoint:
    def __new__(cls, path: str, identity: str) -> Checkpoint: ...
    def save(self) -> str | None: ...
    @property
    def known(self) -> int: ...

# Names and numbers: a scalar as a list of one, an optional one as a list of none or one.
_Named = list[tuple[str, list[float]]]

@final
class Stage:
    def __new__(cls, model: str, parameters: _Named) -> Stage: ...
    def simulate(
        self,
        u: ArrayLike,
        dt: float,
        hold_name: str,
        *,
        initial: _Named | None,
        method: str,
        accuracy: float,
    ) -> Response: ...
    def equilibrium(self, voltages: ArrayLike) -> _Named: ...
    def loop_plants(self, low: float, high: float, delay: float) -> list[LoopPlant]: ...
    def inverse(
        self, dt: float, *, offset: float, delay: float, initial: _Named | None
    ) -> Inverse: ...

@final
class Response:
    @property
    def x(self) -> NDArray[np.float64]: ...
    @property
    def v(self) -> NDArray[np.float64]: ...
    @property
    def hysteresis(self) -> NDArray[np.float64]: ...
    @property
    def last(self) -> _Named: ...
    @property
    def substeps(self) -> int: ...
    @property
    def error_estimate(self) -> float: ...
    @property
    def unique(self) -> bool: ...

@final
class Inverse:
    @staticmethod
    def network(
        numbers: tuple[
            float,
            tuple[float, float, float],
            list[float],
            list[float],
            list[float],
            list[float],
            list[float],
            float,
        ],
        dt: float,
        offset: float,
        delay: float,
    ) -> Inverse: ...
    def step(
        self,
        reference: float,
        velocity: float | None,
        acceleration: float | None,
        preview: float | None,
    ) -> float: ...
    def coefficients(self) -> list[float] | None: ...
    def limit(self, low: float, high: float) -> None: ...
    def applied(self, volts: float) -> None: ...
    def along(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> NDArray[np.float64]: ...
    def save(self) -> bytes: ...
    def load(self, bytes: bytes) -> None: ...
    def reset(self) -> None: ...

@final
class Swarm:
    def __new__(cls, settings: SwarmSettings, coordinates: int, seed: int) -> Swarm: ...
    def ask(self) -> list[list[float] | None]: ...
    def tell(self, costs: Sequence[float]) -> None: ...
    @property
    def best(self) -> tuple[list[float], float]: ...
    @property
    def done(self) -> bool: ...

@final
class Objective:
    def __new__(cls, problem: Problem, threads: int) -> Objective: ...
    @property
    def coordinates(self) -> list[tuple[str, float, float, str]]: ...
    def costs(self, places: list[list[float]]) -> list[float]: ...
    def descend(self, places: list[list[float]]) -> list[tuple[list[float], float, int]]: ...
    def parameters(self, place: list[float]) -> list[float]: ...

@final
class LocalFit:
    def __new__(cls, problem: Problem) -> LocalFit: ...
    @property
    def coordinates(self) -> list[tuple[int, str, float, float]]: ...
    @property
    def tied(self) -> list[str]: ...
    def cost(self, values: Sequence[float]) -> float: ...
    def profiles(
        self, values: Sequence[float], wanted: Sequence[tuple[int, float]]
    ) -> tuple[
        tuple[list[float], float],
        list[tuple[list[tuple[float, float]], tuple[float | None, float | None]]],
    ]: ...
    def refits(
        self, values: Sequence[float], noises: Sequence[ArrayLike], draws: int, seed: int
    ) -> list[tuple[list[float], float]]: ...

@final
class DescentSettings:
    def __new__(
        cls, *, samples: int, starts: int, agreeing: int, rounds: int
    ) -> DescentSettings: ...

@final
class SwarmSettings:
    def __new__(
        cls,
        *,
        particles: int,
        iterations: int,
        update: str,
        inertia_start: float,
        inertia_end: float,
        inertia_iterations: int,
        cognitive: float,
        social: float,
        topology: str,
        velocity_limit: float,
        boundary: str,
        min_improvement: float,
        stall_iterations: int,
        polish: bool,
    ) -> SwarmSettings: ...
    @staticmethod
    def xu_li_2010() -> dict[str, Any]: ...
    @staticmethod
    def spso_2011() -> dict[str, Any]: ...

@final
class Search:
    @property
    def estimates(self) -> list[dict[str, Any]]: ...
    @property
    def rms(self) -> float: ...
    @property
    def rms_with_priors(self) -> float | None: ...
    @property
    def constraints(self) -> list[tuple[str, str, str, bool]]: ...
    @property
    def records(self) -> list[dict[str, Any]]: ...
    @property
    def offset(self) -> float: ...
    @property
    def creep(self) -> tuple[list[float], list[float]]: ...
    @property
    def iterations(self) -> int: ...
    @property
    def evaluations(self) -> int: ...
    @property
    def polish_evaluations(self) -> int: ...
    @property
    def failures(self) -> int: ...
    @property
    def substeps(self) -> int: ...
    @property
    def history(self) -> NDArray[np.float64]: ...
    @property
    def agreeing(self) -> int: ...
    @property
    def stop_reason(self) -> Literal["stalled", "iterations", "interrupted"]: ...
    @property
    def order(self) -> int: ...
    @property
    def runs(
        self,
    ) -> list[tuple[float, int, int, Literal["stalled", "iterations", "interrupted"]]]: ...
    @property
    def lags(self) -> tuple[float, float, bool] | None: ...
    @property
    def scale_assumed(self) -> bool: ...

def tracking_metrics(
    desired: ArrayLike, actual: ArrayLike, dt: float, frequency: float | None
) -> tuple[float, float, float, float, float, float | None, float | None]: ...
def period_metrics(
    desired: ArrayLike, actual: ArrayLike, dt: float, period: float
) -> list[tuple[float, float, float, float, float, float | None, float | None]]: ...
def residual(errors: ArrayLike, fitted: int) -> tuple[float, float, float, float, float]: ...
def check_loop(controller: Controller, plant: LoopPlant) -> dict[str, Any]: ...
def loop_response(
    controller: Controller, plant: LoopPlant, frequency: list[float]
) -> tuple[
    list[tuple[float, float]],
    list[tuple[float, float]],
    list[tuple[float, float]],
    list[float],
]: ...

@final
class LoopPlant:
    @staticmethod
    def from_matrices(
        a: Sequence[float], b: Sequence[float], c: Sequence[float], d: float, delay: float
    ) -> LoopPlant: ...
    def matrices(self) -> tuple[list[float], list[float], list[float], float, float]: ...
    @property
    def static_gain(self) -> float: ...

@final
class Controller:
    def __new__(
        cls,
        *,
        dt: float,
        limits: tuple[float, float],
        span: tuple[float, float] | None,
        max_jump: float | None,
        law: tuple[str, list[float]] | None,
        repetitive: tuple[str, list[float]] | None,
        filters: list[tuple[str, list[float]]],
        follows: bool,
    ) -> Controller: ...
    @property
    def line_length(self) -> int: ...
    def coefficients(self) -> list[tuple[str, list[float]]]: ...
    def step_time(self, samples: int) -> float: ...
    def start(self, present: float | None) -> Session: ...

def law_reference_numerator(law: tuple[str, list[float]], dt: float) -> list[float] | None: ...
def law_transfer_function(law: tuple[str, list[float]], dt: float) -> list[list[float]]: ...

@final
class Session:
    def check(self, reference: float, measured: float) -> None: ...
    def step(self, reference: float, measured: float, feedforward: float) -> float: ...
    def last(self) -> tuple[float, float, float, float, float, float, bool, bool, bool]: ...
    def refused(self) -> tuple[int, int, int]: ...
    def save(self) -> bytes: ...
    def load(self, bytes: bytes) -> None: ...
    def applied(self, volts: float) -> None: ...
    def reached(self) -> float | None: ...
    def reset(self) -> None: ...
    def retune(self, other: Controller) -> None: ...

class _Timing(Protocol):
    @property
    def delay(self) -> float: ...
    @property
    def jitter(self) -> float: ...
    @property
    def voltages_before(self) -> Sequence[float]: ...

@final
class VirtualStage:
    def __new__(
        cls,
        stage: Stage,
        of_amplifier: tuple[float, float, float, float],
        of_sensor: tuple[float, float, float, float, float, float, int],
        cycles: tuple[float, float] | None,
        step: float,
    ) -> VirtualStage: ...
    @staticmethod
    def xu_li_2010(seed: int) -> tuple[Any, ...]: ...
    @staticmethod
    def xu_li_2010_y(seed: int) -> tuple[Any, ...]: ...
    def loop_plants(self, low: float, high: float, delay: float) -> list[LoopPlant]: ...
    def simulate(
        self, u: ArrayLike, dt: float, hold_name: str
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
    def track(
        self,
        controller: Controller,
        reference: ArrayLike,
        feedforward: ArrayLike,
        timing: _Timing,
        substeps: int,
    ) -> TrackingRun: ...

@final
class VirtualRun:
    def __new__(cls, stage: VirtualStage) -> VirtualRun: ...
    def advance(
        self, u: ArrayLike, dt: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...

# Rms and largest error [m], effort [V], slew [V/s], clipped share.
_Figures = tuple[float, float, float, float, float]

@final
class Task:
    def __new__(
        cls,
        *,
        stage: VirtualStage,
        timing: _Timing,
        dt: float,
        reference: ArrayLike,
        feedforward: ArrayLike,
        beside: ArrayLike,
        first: int,
        measured: bool,
    ) -> Task: ...
    def figures(self, controllers: Sequence[Controller], threads: int) -> list[_Figures]: ...

@final
class PathTask:
    def __new__(
        cls,
        x: Task,
        y: Task,
        *,
        lag: float,
        circle: tuple[float, float, float] | None,
        path: tuple[ArrayLike, ArrayLike],
    ) -> PathTask: ...
    def figures(
        self, controllers: Sequence[tuple[Controller, Controller]], threads: int
    ) -> list[_Figures]: ...

@final
class SoughtController:
    def __new__(
        cls,
        *,
        controller: Controller,
        period: float | None,
        sign: float,
        law: tuple[str, float, float],
        sought: list[tuple[str, float, float, bool]],
        plants: Sequence[LoopPlant],
    ) -> SoughtController: ...

class _Goal(Protocol):
    @property
    def minimise(self) -> str: ...
    @property
    def tolerances(self) -> Sequence[float]: ...
    @property
    def effort(self) -> float: ...
    @property
    def slew(self) -> float: ...
    @property
    def largest_error(self) -> float: ...
    @property
    def largest_saturation(self) -> float: ...

class _Budget(Protocol):
    @property
    def particles(self) -> int: ...
    @property
    def iterations(self) -> int: ...
    @property
    def seed(self) -> int: ...

class _TuningProblem(Protocol):
    @property
    def goal(self) -> _Goal: ...
    @property
    def search(self) -> _Budget: ...
    @property
    def threads(self) -> int: ...

def tune(
    problem: _TuningProblem,
    *,
    margins: tuple[float, float, float, float],
    axes: Sequence[SoughtController],
    tasks: Sequence[Task | PathTask],
    stages: int,
    starts: Sequence[Sequence[float]],
) -> dict[str, Any]: ...
def tuning_costs(
    problem: _TuningProblem,
    *,
    margins: tuple[float, float, float, float],
    axes: Sequence[SoughtController],
    tasks: Sequence[Task | PathTask],
    stages: int,
    places: Sequence[Sequence[float]],
) -> list[tuple[float, float]]: ...

_Motion = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
_Spread = tuple[float, float, float, float, float]

@final
class XYStage:
    def __new__(
        cls,
        x: VirtualStage,
        y: VirtualStage,
        cross_talk: tuple[float, float],
        lag: float,
        missed: tuple[float, int],
    ) -> XYStage: ...
    def simulate(
        self, ux: ArrayLike, uy: ArrayLike, dt: float, hold_name: str
    ) -> list[_Motion]: ...
    def track(
        self,
        controllers: tuple[Controller, Controller],
        references: tuple[ArrayLike, ArrayLike],
        feedforwards: tuple[ArrayLike, ArrayLike],
        timings: tuple[_Timing, _Timing],
        substeps: int,
    ) -> tuple[TrackingRun, TrackingRun]: ...

_Parts = tuple[ArrayLike, ArrayLike]

@final
class ModalSystem:
    def __new__(
        cls,
        drives: int,
        sensors: int,
        poles: _Parts,
        inputs: _Parts,
        outputs: _Parts,
        direct: ArrayLike,
    ) -> ModalSystem: ...
    def simulate(
        self, state: _Parts, drive: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
    def track(
        self,
        gains: Sequence[tuple[float, float, float, float | None]],
        dt: float,
        matrices: _Parts,
        limits: Sequence[tuple[float, float]],
        signals: tuple[ArrayLike, ArrayLike, ArrayLike],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...

_Array = NDArray[np.float64]
_Terms = tuple[int, int, _Parts, _Parts, _Parts, ArrayLike]
_FoundTerms = tuple[tuple[_Array, _Array], tuple[_Array, _Array], tuple[_Array, _Array], _Array]

@final
class ModalFit:
    def __new__(
        cls, drives: int, sensors: int, angles: ArrayLike, value: _Parts, weights: ArrayLike
    ) -> ModalFit: ...
    def pursue(self, expected: float, most: int, fixed: bool) -> _FoundTerms: ...
    def refine(self, start: _Terms, held: float) -> _FoundTerms: ...
    def misfit(self, at: _Terms) -> float: ...
    def pole_deviations(self, at: _Terms, variance: ArrayLike) -> tuple[_Array, _Array]: ...

@final
class Regressors:
    def __new__(
        cls,
        drives: int,
        sensors: int,
        matrix: ArrayLike,
        products: Sequence[Sequence[int]],
        stops: Sequence[tuple[int, float]],
        changes: Sequence[tuple[int, float]],
    ) -> Regressors: ...
    def follow(
        self, drives: ArrayLike, displacements: ArrayLike, state: _Parts | None = None
    ) -> tuple[_Array, _Array, _Array]: ...

_ForcedState = tuple[_Parts, _Parts, _Parts]

@final
class DistortedModes:
    def __new__(
        cls, system: ModalSystem, regressors: Regressors, forces: _Parts
    ) -> DistortedModes: ...
    def simulate(
        self, state: _ForcedState, drive: ArrayLike
    ) -> tuple[
        _Array, tuple[tuple[_Array, _Array], tuple[_Array, _Array], tuple[_Array, _Array]]
    ]: ...

def choose_distortion(
    levels: Sequence[tuple[_Terms, ArrayLike, _Parts, _Parts, ArrayLike, Sequence[float]]],
    drives: int,
    most: int,
) -> tuple[list[tuple[int, int, int, float, float]], list[list[list[float]]], list[float]]: ...
def balanced_terms(given: _Terms) -> _FoundTerms: ...
def aligned_terms(given: _Terms, other: _Terms) -> _FoundTerms: ...
def circle_errors(
    x: ArrayLike, y: ArrayLike, centre: tuple[float, float], radius: float
) -> NDArray[np.float64]: ...
def path_errors(
    x: ArrayLike, y: ArrayLike, path_x: ArrayLike, path_y: ArrayLike
) -> NDArray[np.float64]: ...
def spread(errors: ArrayLike) -> _Spread: ...
def autoregression(noise: ArrayLike) -> tuple[list[float], float]: ...
def resampled_noises(
    noise: ArrayLike, scale: float, draws: int, seed: int
) -> list[list[float]]: ...
def bounded_least_squares(
    rows: list[list[float]], right: list[float], bounds: list[tuple[float, float]]
) -> list[float]: ...
def linearised_covariance(
    records: Sequence[
        tuple[
            Sequence[ArrayLike],
            Sequence[ArrayLike],
            ArrayLike,
            ArrayLike,
            float,
        ]
    ],
    precision: Sequence[Sequence[float]],
    draws: int,
    seed: int,
) -> tuple[
    list[list[float]],
    list[bool],
    list[float],
    list[tuple[float, float]],
    list[float],
    list[list[float]],
    list[int],
    list[list[float]],
]: ...
def tied_values(
    model: str, values: Sequence[float], ties: Sequence[tuple[int, str]]
) -> list[float]: ...
def cross_talk_share(driven: ArrayLike, other: ArrayLike) -> tuple[float, float, float]: ...
def sensor_noise(
    record: ArrayLike, dt: float
) -> tuple[_Spread, float, float, int, float, float, float | None]: ...

@final
class TrackingRun:
    @property
    def measured(self) -> NDArray[np.float64]: ...
    @property
    def saturated(self) -> NDArray[np.bool_]: ...
    def motion(self) -> list[NDArray[np.float64]]: ...
    def part(self, name: str) -> NDArray[np.float64]: ...

@final
class Conventional:
    def __new__(
        cls,
        *,
        voltage: float,
        steady_state: float,
        peaks: list[float],
        period: float,
        frequency: float,
        static_gain: float,
        resonance_gain: float,
        initial_slope: float,
    ) -> Conventional: ...
    def mode(self) -> tuple[float, float, float, float, float, float]: ...
    def hysteresis(self) -> tuple[float, float, float, float]: ...
    def separate(
        self, one: tuple[float, float], two: tuple[float, float]
    ) -> tuple[float, float]: ...
    def piezo_coefficient(self, stiffness: float, level: tuple[float, float]) -> float: ...

@final
class StepResponse:
    def readings(self) -> tuple[float, float, float, float, float, float, float]: ...
    @property
    def peaks(self) -> list[float]: ...
    @property
    def peak_times(self) -> list[float]: ...
    @property
    def samples(self) -> tuple[int, int, int]: ...
    @property
    def cut(self) -> bool: ...
    @property
    def quality(self) -> tuple[float, float, float, float]: ...
    def spectrum(self) -> list[NDArray[np.float64]]: ...

def read_step(u: ArrayLike, y: ArrayLike, dt: float, hold_name: str) -> StepResponse: ...
def turns(signal: ArrayLike, least: float) -> list[int]: ...
def turns_often(u: ArrayLike) -> bool: ...

@final
class LeastSquaresFit:
    @property
    def parameters(self) -> _Named: ...
    @property
    def rms(self) -> float: ...
    @property
    def evaluations(self) -> int: ...
    @property
    def at_bound(self) -> list[str]: ...
    @property
    def records(self) -> list[dict[str, Any]]: ...
    @property
    def lag_range(self) -> tuple[float, float] | None: ...

def identify_weights(
    problem: Problem,
    *,
    count: int | None,
    thresholds: Sequence[float] | None,
    zones: int,
    creep_times: Sequence[float] | None,
    dynamics: str,
    start: Structure | None,
    threads: int,
    stopped: Callable[[], bool] | None = None,
) -> LeastSquaresFit: ...
def resonances(
    *, u: ArrayLike, y: ArrayLike, dt: float, hold_name: str, start: int, most: int
) -> list[tuple[float, float, float]]: ...
def nnls(a: Sequence[Sequence[float]], b: Sequence[float], free: Sequence[bool]) -> list[float]: ...
