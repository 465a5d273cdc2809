"""The virtual stage in place of the paper's, and the settings of its controllers."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from .._support.files.json_text import parse_json
from .._support.messages import quoted
from ..control.controller.controller import Controller
from ..control.timing import Timing
from ..errors import ParameterError
from ..stages.apparatus import Amplifier, Preconditioning, Sensor
from ..stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage
from ..stages.virtual import VirtualStage
from ..stages.xy import XYStage

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..stages.inverse import Inverse

__all__ = ["DT", "LIMITS", "Apparatus", "loop"]

# The loop of the paper: 50 Hz, amplifiers of 0 to 75 V.
DT, LIMITS = 0.02, (0.0, 75.0)
# With the seed of x, y would have the same noise.
Y_SEEDS = 1 << 32
TICKS = ("missed_ticks", "most_behind")


@dataclass(frozen=True, kw_only=True)
class Apparatus:
    """An XY stage with the timing of its controller.

    Attributes
    ----------
    stage : XYStage
        Both axes, their cross-talk, the lag between them and the ticks that they miss.
    delay : float
        Time from a reading to the effect of its voltage [s].
    jitter : float
        Mean sampling jitter [s].
    """

    stage: XYStage
    delay: float
    jitter: float

    @property
    def x(self) -> VirtualStage:
        """Axis of Figs. 3 to 14."""
        assert isinstance(self.stage.x, VirtualStage)
        return self.stage.x

    @property
    def y(self) -> VirtualStage:
        """Second axis."""
        assert isinstance(self.stage.y, VirtualStage)
        return self.stage.y

    @property
    def plays_of_x(self) -> PrandtlIshlinskiiStage:
        """Play operators, creep and mode of x."""
        assert isinstance(self.x.stage, PrandtlIshlinskiiStage)
        return self.x.stage

    @property
    def timing(self) -> Timing:
        """Delay and jitter as an argument of `track` and `contour`."""
        return Timing(delay=self.delay, jitter=self.jitter)

    def seeded(self, seed: int) -> Apparatus:
        """Return the same apparatus with other seeds of both sensors.

        Parameters
        ----------
        seed : int
            0 or above.

        Returns
        -------
        Apparatus
            With different noise on x and y.
        """
        x, y = _seeded(self.x, seed), _seeded(self.y, seed + Y_SEEDS)
        return replace(self, stage=replace(self.stage, x=x, y=y))

    def document(self) -> dict[str, Any]:
        """Return the numbers of the apparatus for a file, SI."""
        return {
            "x": _numbers(self.x),
            "y": _numbers(self.y),
            "cross_talk": list(self.stage.cross_talk),
            "lag": self.stage.lag,
            "missed_ticks": self.stage.missed_ticks,
            "most_behind": self.stage.most_behind,
            "delay": self.delay,
            "jitter": self.jitter,
        }

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Apparatus:
        """Make the apparatus from its `document`.

        Parameters
        ----------
        document : mapping
            As `Apparatus.document` returns it.

        Returns
        -------
        Apparatus
            With seed 0.

        Raises
        ------
        ParameterError
            An entry is missing or cannot be used.
        """
        try:
            x, y = (_axis(document[axis]) for axis in "xy")
            # Documents written before ticks were missed have none.
            ticks = {key: document[key] for key in TICKS if key in document}
            both = {key: document[key] for key in ("cross_talk", "lag")}
            stage = XYStage(x=x, y=y, **both, **ticks)
            return cls(stage=stage, delay=document["delay"], jitter=document["jitter"]).seeded(0)
        except (KeyError, TypeError, IndexError):
            raise ParameterError(
                "document", quoted(document), "what Apparatus.document returns"
            ) from None

    @classmethod
    def calibrated(cls) -> Apparatus:
        """Return the calibrated apparatus of the package."""
        return cls.of(calibration_file()["apparatus"])


def calibration_file() -> dict[str, Any]:
    """Read the result of the calibration, with its provenance."""
    name = "calibrated.json"
    document: dict[str, Any] = parse_json(name, files(__package__).joinpath(name).read_bytes())
    return document


def _seeded(stage: VirtualStage, seed: int) -> VirtualStage:
    return replace(stage, sensor=replace(stage.sensor, seed=seed))


def _numbers(stage: VirtualStage) -> dict[str, Any]:
    """Return the parts with their numbers, without the seed."""
    numbers = asdict(stage)
    del numbers["sensor"]["seed"]
    return numbers


def _axis(numbers: Mapping[str, Any]) -> VirtualStage:
    """Make an axis, a stage with play operators, from its numbers."""
    return VirtualStage(
        stage=PrandtlIshlinskiiStage(**numbers["stage"]),
        amplifier=Amplifier(**numbers["amplifier"]),
        sensor=Sensor(**numbers["sensor"]),
        preconditioning=Preconditioning(**numbers["preconditioning"]),
        step=numbers["step"],
    )


def loop(
    inverse: Inverse | None = None,
    *,
    limits: tuple[float, float] = LIMITS,
    dt: float = DT,
    **parts: Any,
) -> Controller:
    """Make a controller with the paper's sampling and limits: 50 Hz, 0 to 75 V."""
    return Controller(dt=dt, limits=limits, feedforward=inverse, **parts)
