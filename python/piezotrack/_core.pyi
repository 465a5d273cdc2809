from collections.abc import Callable
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "DAHL_PARAMETERS",
    "Search",
    "SwarmSettings",
    "Trajectory",
    "__version__",
    "as_count",
    "as_number",
    "as_truth",
    "dahl_check",
    "dahl_simulate",
    "dahl_simulate_fixed",
    "dahl_xu_li_2010",
    "identify_dahl",
]

__version__: str
DAHL_PARAMETERS: list[tuple[str, str, str]]

def as_number(name: str, value: object) -> float: ...
def as_count(name: str, value: object) -> int: ...
def as_truth(name: str, value: object) -> bool: ...
def dahl_check(theta: tuple[float, ...]) -> None: ...
def dahl_xu_li_2010() -> list[float]: ...
def dahl_simulate(
    theta: tuple[float, ...],
    u: ArrayLike,
    dt: float,
    hold: str,
    initial: tuple[float, ...],
    method: str,
    accuracy: float,
) -> Trajectory: ...
def dahl_simulate_fixed(
    theta: tuple[float, ...], u: ArrayLike, dt: float, hold: str, substeps: int
) -> Trajectory: ...
def identify_dahl(
    *,
    u: ArrayLike,
    y: ArrayLike,
    dt: float,
    hold_name: str,
    start: int,
    free: list[str] | None,
    fixed: list[tuple[str, float]],
    bounds: list[tuple[str, tuple[float, float]]],
    stiffness: float | None,
    offset: bool,
    settings: SwarmSettings,
    seed: int,
    runs: int,
    threads: int,
    callback: Callable[[int, int, int, float, list[float]], bool] | None,
    progress: Callable[[int, int, int, float, list[float]], None] | None,
) -> Search | None: ...

@final
class Trajectory:
    @property
    def x(self) -> NDArray[np.float64]: ...
    @property
    def v(self) -> NDArray[np.float64]: ...
    @property
    def hysteresis(self) -> NDArray[np.float64]: ...
    @property
    def last(self) -> tuple[float, float, float, float]: ...
    @property
    def substeps(self) -> int: ...
    @property
    def difference(self) -> float: ...

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

@final
class Search:
    @property
    def theta(self) -> list[float]: ...
    @property
    def rms(self) -> float: ...
    @property
    def offset(self) -> float: ...
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
    def stop_reason(self) -> Literal["stalled", "iterations", "interrupted"]: ...
    @property
    def order(self) -> int: ...
    @property
    def runs(
        self,
    ) -> list[tuple[float, int, int, Literal["stalled", "iterations", "interrupted"]]]: ...
    @property
    def scale_assumed(self) -> bool: ...
    @property
    def bounds(self) -> list[tuple[float, float] | None]: ...
    @property
    def sensitivities(self) -> list[tuple[int, float, bool]]: ...
