"""Options of a control loop and of the stage that is simulated, and their defaults from a model."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ..._support.units import decibels, shown_unit
from ...errors import ParameterError
from ..command import Option, group, refuse_without_effect
from ..option_groups import Rate, interval
from ..options import Bandwidth, Delay, Limits, Noise, Seed
from ..values import GAIN, LOOP_TIME

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...control.laws.pid import Pid
    from ...control.loop.stability import LoopCheck
    from ...control.loop.tracking import Tracking
    from ...control.parts.repetitive import Repetitive
    from ...control.timing import Timing
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ...stages.virtual import VirtualStage

__all__ = [
    "MOST_SENSITIVITY",
    "NO_FEEDBACK",
    "PAPER",
    "BeyondReach",
    "FeedbackOptions",
    "JitterySimulation",
    "LoopOptions",
    "Online",
    "Simulation",
    "Stage",
    "Unstable",
    "check_same_drive",
    "drive_notes",
    "driven_by_voltage",
    "gain_of",
    "gains_as_options",
    "known_model",
    "repetitive_part",
    "small_margins",
    "stage_model",
    "unit_of",
    "zero_words",
]

# Name of the stage of the paper, which can be simulated without a file.
PAPER = "xu-li-2010"
NO_FEEDBACK = "no feedback: --kp and --ti give a PID controller, as --kp 0.03V/um --ti 20ms"
# The loop of Xu and Li 2010: sampling interval in s, limits in V, gains in V/um and s.
PAPER_DT, PAPER_LIMITS = 0.02, (0.0, 75.0)
PAPER_KQ, PAPER_TQ = 1.0, 0.2
PAPER_GAINS = {"kp": 0.120, "ti": 0.009, "td": 0.044}

Stage = Annotated[
    str | None,
    Option(
        f"Stage to simulate: another model file, or {PAPER}, with the loop of Xu and Li 2010; "
        "default the model itself",
        metavar=f"FILE|{PAPER}",
    ),
]
Online = Annotated[
    bool, Option("Feedforward computed at each sample; default a table of one period")
]
BeyondReach = Annotated[bool, Option("Allow a motion that the stage cannot reach")]
Unstable = Annotated[bool, Option("Run although the loop is unstable for small motions")]


@group
class LoopOptions:
    """Loop."""

    dt: Annotated[
        float | None,
        Option("Sampling interval; default that of a reference file, or of the record", LOOP_TIME),
    ] = None
    rate: Rate = None
    limits: Limits = None

    def interval(
        self, model: IdentifiedModel | None, reference: Reference | None, *, own: bool = True
    ) -> float:
        """Return the sampling interval: as given, of the reference's file, or of the record [s]."""
        known = [interval(self.dt, self.rate), None if own else PAPER_DT]
        known += [None if reference is None else reference.interval, model.dt if model else None]
        for one in known:
            if one is not None:
                return one
        raise _missing("--dt", "the sampling interval, as 5ms, or --rate, as 200Hz")

    def volts(self, model: IdentifiedModel | None, *, own: bool = True) -> tuple[float, float]:
        """Return the limits: as given, or the range of the model's record, in SI."""
        if self.limits is not None:
            unit = unit_of(own, model)
            name, scale = shown_unit(unit)
            for one in self.limits:
                _check_unit("--limits", one, name)
            low, high = (float(one) / scale for one in self.limits)
            if not -math.inf < low < high < math.inf:
                raise ParameterError(
                    "--limits",
                    f"({scale * low:g}, {scale * high:g}) {name}",
                    "two finite numbers, the lower one first",
                    verb="are",
                )
            return low, high
        known = model.drive_range if own and model else PAPER_LIMITS
        if known is None:
            raise _missing("--limits", "the limits of the drive, as 0:75V")
        return known


@group
class FeedbackOptions(LoopOptions):
    """Loop."""

    feedforward: Annotated[bool, Option("Feedforward by the inverse of the model; default yes")] = (
        True
    )
    feedback: Annotated[bool | None, Option(f"PID feedback; default with --kp, and on {PAPER}")] = (
        None
    )
    kp: Annotated[float | None, Option("Proportional gain of the PID, as 0.03V/um", GAIN)] = None
    ti: Annotated[float | None, Option("Integral time of the PID, as 20ms", LOOP_TIME)] = None
    td: Annotated[float | None, Option("Derivative time of the PID; default 0", LOOP_TIME)] = None
    tt: Annotated[
        float | None,
        Option("Time of the anti-windup, inf for none; default sqrt(ti td), or ti", LOOP_TIME),
    ] = None

    def check(self, *, own: bool) -> None:
        """Refuse gains of a feedback that is left out."""
        if not self.has_feedback(own=own):
            reason = "with --no-feedback" if self.feedback is False else "without --kp"
            refuse_without_effect(("kp", "ti", "td", "tt"), reason)

    def has_feedback(self, *, own: bool) -> bool:
        """Whether there is feedback: on one's own stage where a gain is given."""
        if self.feedback is None:
            return not own or self.kp is not None
        return self.feedback

    def pid(self, model: IdentifiedModel | None, *, own: bool) -> Pid | None:
        """Make the feedback; the paper's gains are for its own stage only."""
        from ...control.laws.pid import Pid

        if not self.has_feedback(own=own):
            return None
        if not own:
            given = {"kp": self.kp, "ti": self.ti, "td": self.td}
            gains = {key: PAPER_GAINS[key] if one is None else one for key, one in given.items()}
            return Pid.from_um(**gains, tt=self.tt)
        if self.kp is None or self.ti is None:
            raise ParameterError(
                "--kp" if self.kp is None else "--ti",
                "missing",
                "--kp 0.03V/um --ti 20ms for a PID on this stage, or --no-feedback",
            )
        kp = gain_of("--kp", self.kp, model)
        return Pid(kp=kp, ti=self.ti, td=self.td or 0.0, tt=self.tt)


@group
class Simulation:
    """Simulated stage."""

    delay: Delay = 0.0
    noise: Noise = 0.0
    bandwidth: Bandwidth = math.inf
    seed: Seed = 1

    @property
    def timing(self) -> Timing:
        """Delay and jitter of the loop."""
        from ...control.timing import Timing

        return Timing(delay=self.delay, jitter=getattr(self, "jitter", 0.0))

    @property
    def parts(self) -> dict[str, float]:
        """Noise of the sensor [m], bandwidth of the amplifier [Hz], and seed of the noise."""
        if not (math.isfinite(self.noise) and self.noise >= 0.0):
            raise ParameterError(
                "--noise", f"{1e9 * self.noise:g} nm", "an rms value of 0 or above"
            )
        return {"noise": self.noise, "bandwidth": self.bandwidth, "seed": self.seed}

    def check(self, *, own: bool, searched: bool = False) -> None:
        """Refuse options of a stage that is not simulated, and a seed of no noise."""
        if not own:
            reason = f"with --stage {PAPER}, which has its own"
            refuse_without_effect(("noise", "bandwidth"), reason)
        elif not (searched or self.noise or getattr(self, "jitter", 0.0)):
            has_jitter = " or --jitter" if hasattr(self, "jitter") else ""
            refuse_without_effect(("seed",), f"without --noise{has_jitter}")

    def stage(self, stage: str | None, known: IdentifiedModel) -> VirtualStage:
        """Make the stage of the option ``--stage``; default that of the model."""
        from ...stages.virtual import VirtualStage

        if stage == PAPER:
            return VirtualStage.xu_li_2010(seed=self.seed)
        return VirtualStage.of(stage_model(stage, known), **self.parts)  # type: ignore[arg-type]


@group
class JitterySimulation(Simulation):
    """Simulated stage."""

    jitter: Annotated[
        float, Option("Mean sampling jitter (truncated exponential distribution)", LOOP_TIME)
    ] = 0.0


def repetitive_part(
    options: LoopOptions,
    model: IdentifiedModel,
    reference: Reference,
    kq: float | None,
    tq: float | None,
    *,
    own: bool,
) -> Repetitive:
    """Make the repetitive part; on one's own stage half of an error is learnt in a period."""
    from ...control.parts.repetitive import Repetitive
    from ...control.plant import linearised_plants, plant_of

    period = reference.period
    if period is None:
        raise ParameterError(f"--repetitive: the reference ({reference.name}) does not repeat")
    if kq is None and own:
        _, middle, _ = linearised_plants(plant_of(model), options.volts(model), 0.0)
        kq = 0.5e-6 / middle.static_gain
    elif kq is not None and own:
        kq = gain_of("--kq", kq, model) * 1e-6
    return Repetitive.from_um(
        period=period,
        kq=PAPER_KQ if kq is None else kq,
        tq=(period / 25.0 if own else PAPER_TQ) if tq is None else tq,
    )


def driven_by_voltage(model: IdentifiedModel, file: Path) -> IdentifiedModel:
    """Refuse a model whose drive is a position for the stage of the paper, which has volts."""
    if model.drive_unit == "m":
        raise ParameterError(
            f"{file.name}: the drive of this model is a position, in um: expected a drive in V, "
            f"which the stage of {PAPER} has"
        )
    return model


def known_model(file: Path, *, zero: bool, paper: bool = False) -> IdentifiedModel:
    """Load a model, in the displacements of its record or in those that begin at 0."""
    from ...identification.fitted.model_file import load

    model = driven_by_voltage(load(file), file) if paper else load(file)
    return model.zeroed() if zero else model


def zero_words(model: IdentifiedModel) -> str:
    """Say from where displacements count, where not as recorded."""
    return f", zeroed: {1e6 * model.zero:.4g} um subtracted" if model.zero else ""


def unit_of(own: bool, model: IdentifiedModel | None) -> str:
    """Return the unit of the drive of the loop, SI."""
    return model.drive_unit if own and model is not None else "V"


def gain_of(option: str, gain: float, model: IdentifiedModel | None) -> float:
    """Convert a gain in V/um, or in um/um where the drive is a position, to SI."""
    name, scale = shown_unit(unit_of(True, model))
    _check_unit(option, gain, name)
    return gain * (1e6 / scale)


def gains_as_options(controller: Controller) -> str:
    """Write the gains of a PID law as `FeedbackOptions` take them; empty for another law."""
    law = controller.feedback
    if law is None or law.info.name != "pid":
        return ""
    pid, (unit, scale) = law._pid, shown_unit(controller.drive_unit)
    times = {"ti": pid.ti, "td": pid.td} | ({} if pid.tt is None else {"tt": pid.tt})
    words = [f"--{name} {1e3 * one:.5g}ms" for name, one in times.items()]
    return " ".join([f"--kp {1e-6 * scale * pid.kp:.5g}{unit}/um", *words])


def _check_unit(option: str, value: float, drive: str) -> None:
    """Refuse a value whose unit is not that of the drive, or per micrometre of it."""
    unit = getattr(value, "unit", "").partition("/")[0]
    kinds = {"V": ("V", "mV", "kV"), "um": ("um", "nm", "mm"), "N": ("N",)}
    if unit and unit not in kinds.get(drive, (drive,)):
        raise ParameterError(option, f"in {value.unit}", f"{drive}, the unit of the drive")  # type: ignore[attr-defined]


def _missing(option: str, expected: str) -> ParameterError:
    return ParameterError(option, "missing, and the model file has no record", expected)


# Margins below which a loop is called sensitive.
LEAST_MARGIN, MOST_SENSITIVITY = 2.0, 2.5


def small_margins(loop: LoopCheck) -> list[str]:
    """Remark on a stable loop near its limit."""
    small = []
    if loop.stable_gains is not None and loop.stable_gains[1] < LEAST_MARGIN:
        small.append(f"its gain margin is below {decibels(LEAST_MARGIN):.2g} dB")
    if loop.sensitivity > MOST_SENSITIVITY:
        small.append(f"Ms is above {MOST_SENSITIVITY:g}")
    if not loop.stable or not small:
        return []
    return [f"the loop is close to instability, {' and '.join(small)}: lower the gain"]


def drive_notes(model: IdentifiedModel, run: Tracking) -> list[str]:
    """Remarks on a run beyond the range or the rate of the record identified."""
    notes = model.extrapolation_notes(run.voltage)
    if run.controller.feedforward is not None:
        # The rate of the feedforward: a loop's voltage has the noise of the sensor.
        rate = model.extrapolation_notes(run.feedforward, run.controller.dt)
        notes += [note for note in rate if note not in notes and " moves at " in note]
    return notes


def stage_model(stage: str | None, known: IdentifiedModel) -> IdentifiedModel:
    """Load the model of ``--stage``, with a drive like that of the other; default that itself."""
    if stage is None:
        return known
    other = known_model(Path(stage), zero=known.zero != 0.0)
    check_same_drive(other, stage, known.drive_unit)
    return other


def check_same_drive(other: IdentifiedModel, stage: str, drive_unit: str) -> None:
    """Refuse a stage whose drive is in another unit than that of the model or controller."""
    if other.drive_unit != drive_unit:
        one, two = (shown_unit(unit)[0] for unit in (other.drive_unit, drive_unit))
        raise ParameterError(
            "--stage", f"{stage}, whose drive is in {one}", f"one in {two}, as of the model"
        )
