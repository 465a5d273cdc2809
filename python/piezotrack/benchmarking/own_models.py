"""Contenders of the package: each model by its default call, and the default choice."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING

from ..errors import ParameterError
from ..identification.fit import identify
from ..identification.problem.problem import AUTO
from ..references.reference import Reference
from ..stages.registry import MODELS
from .contender import Contender

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..data.dataset import Dataset
    from ..identification.fitted.identification import Identification
    from ..stages.motion import StageState
    from .record import BenchmarkRecord

    Array = NDArray[np.float64]

__all__ = ["own_contenders"]


@dataclass(frozen=True)
class _Identified:
    """An identified model as the benchmark sees it."""

    fit: Identification

    @property
    def values(self) -> int | None:
        return self.fit.free_count

    @property
    def chosen(self) -> str:
        return self.fit.model.info.title if self.fit.selection else ""

    @property
    def parameters(self) -> dict[str, float]:
        stage = self.fit.model
        named = {one.name: getattr(stage, one.name) for one in fields(stage)}
        return {name: value for name, value in named.items() if isinstance(value, float)}

    def predict(self, data: Dataset) -> Array:
        return self.fit.simulate(data, offset=self.fit.offset).x

    def invert(self, data: Dataset, y: Array) -> tuple[Array, Array] | None:
        state: StageState | None = self.fit.start_on(data).state
        inverse = self.fit.inverse()
        try:
            # Models with the hysteresis in feedback take no state: what the warm-up does is enough.
            inverse = replace(inverse, initial=state)
        except ParameterError:
            state = None
        volts = inverse.voltage(Reference.from_samples(y, data.dt), data.dt)
        return volts, self.fit.displacement(volts, data.dt, initial=state)


def _fit(model: str, data: Dataset) -> _Identified:
    return _Identified(identify(data, model, progress=False))


def own_contenders() -> list[Contender]:
    """List the default choice and each model of the registry.

    Returns
    -------
    list of Contender
        Models driven by a voltage also suit a record driven by a force, but not the reverse.
    """

    def suits(unit: str, record: BenchmarkRecord) -> bool:
        return unit in ("V", record.drive_unit)

    chosen = Contender(name=AUTO, title="default", fit=partial(_fit, AUTO), suits=lambda _: True)
    return [
        chosen,
        *(
            Contender(
                name=info.name,
                title=info.title,
                fit=partial(_fit, info.name),
                suits=partial(suits, info.drive_unit),
            )
            for info in MODELS
        ),
    ]
