"""Options of the loop that ``track`` and ``contour`` share, and their defaults from a model."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..._support.units import decibels, shown_unit
from ...errors import ParameterError
from ..options import number_range, refuse_without_effect

if TYPE_CHECKING:
    from ...control.laws.pid import Pid
    from ...control.loop.stability import LoopCheck
    from ...control.loop.tracking import Tracking
    from ...control.parts.repetitive import Repetitive
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ...stages.virtual import VirtualStage

__all__ = [
    "NO_FEEDBACK",
    "PAPER",
    "AmplifierBandwidth",
    "Feedback",
    "Feedforward",
    "Interval",
    "Kp",
    "Limits",
    "Loop",
    "LoopDelay",
    "Noise",
    "StageFile",
    "StageModel",
    "Td",
    "Ti",
    "check_same_drive",
    "drive_notes",
    "driven_by_voltage",
    "known_model",
    "noise_metres",
    "refuse_of_other_stage",
    "simulated",
    "small_margins",
    "stage_model",
    "unit_of",
    "zero_words",
]

# Name of the stage of the paper, which can be simulated without a file.
PAPER = "xu-li-2010"
NO_FEEDBACK = (
    "no feedback: give --kp in V/um and --ti in s for a PID controller; in um/um for a drive in um"
)
# The loop of Xu and Li 2010: sampling interval in s, limits in V, gains in V/um and s.
PAPER_DT, PAPER_LIMITS = 0.02, (0.0, 75.0)
PAPER_KQ, PAPER_TQ = 1.0, 0.2
PAPER_GAINS = {"kp": 0.120, "ti": 0.009, "td": 0.044}

StageFile = Annotated[
    str | None,
    typer.Option(
        metavar=f"FILE|{PAPER}",
        help=f"Stage to simulate: another model file, or {PAPER}. Default the model itself.",
        show_default=False,
    ),
]
StageModel = Annotated[
    str | None,
    typer.Option(
        metavar="FILE",
        help="Stage to simulate: another model file, for which the margins hold too. Default the "
        "model itself.",
        show_default=False,
    ),
]
Interval = Annotated[
    float | None,
    typer.Option(
        help="Sampling interval of the controller in s; default that of a reference file, or of "
        f"the record identified, of {PAPER} 0.02.",
        show_default=False,
    ),
]
Limits = Annotated[
    str | None,
    typer.Option(
        metavar="LOW:HIGH",
        help="Limits of the drive in V, or in um where that is its unit; default the drive range "
        f"of the record identified, of {PAPER} 0:75.",
        show_default=False,
    ),
]
Feedforward = Annotated[bool, typer.Option(help="Feedforward by the inverse of the model.")]
Feedback = Annotated[
    bool | None,
    typer.Option(
        help=f"PID feedback; default where --kp is given, and on {PAPER}.", show_default=False
    ),
]
Kp = Annotated[
    float | None,
    typer.Option(
        help=f"Proportional gain of the PID in V/um, or um/um; on {PAPER} 0.12.", show_default=False
    ),
]
Ti = Annotated[
    float | None,
    typer.Option(help=f"Integral time of the PID in s; on {PAPER} 0.009.", show_default=False),
]
Td = Annotated[
    float | None,
    typer.Option(
        help=f"Derivative time of the PID in s; default 0, on {PAPER} 0.044.", show_default=False
    ),
]
LoopDelay = Annotated[float, typer.Option(help="Delay in the loop in s, in addition to the hold.")]
Noise = Annotated[
    float, typer.Option("--noise-nm", help="Noise of the simulated sensor in nm rms.")
]
AmplifierBandwidth = Annotated[
    float, typer.Option("--bandwidth", help="Bandwidth of the simulated amplifier in Hz.")
]


def noise_metres(noise_nm: float) -> float:
    """Noise of the sensor in metres, from the option in nm.

    Parameters
    ----------
    noise_nm : float
        Option ``--noise-nm``, nm rms.

    Returns
    -------
    float
        The same in m rms.

    Raises
    ------
    ParameterError
        If it is negative or not finite: in nm, as it was typed.
    """
    if not (isfinite(noise_nm) and noise_nm >= 0.0):
        raise ParameterError("--noise-nm", f"{noise_nm:g}", "nm rms, finite, 0 or above")
    return 1e-9 * noise_nm


@dataclass(frozen=True)
class Loop:
    """The loop as the options describe it, on one's own stage or on that of the paper.

    Attributes
    ----------
    own : bool
        Whether the model itself is simulated.
    interval, limits : float, str or None
        Options ``--dt`` and ``--limits``.
    feedback : bool or None
        Option ``--feedback`` or ``--no-feedback``.
    kp, ti, td, tt : float or None
        Gains of the PID.
    """

    own: bool
    interval: float | None
    limits: str | None
    feedback: bool | None
    kp: float | None
    ti: float | None
    td: float | None
    tt: float | None = None

    def check(self, context: typer.Context) -> None:
        """Refuse gains of a feedback that is left out."""
        if not self.has_feedback:
            gains = [name for name in ("kp", "ti", "td", "tt") if name in context.params]
            reason = "with --no-feedback" if self.feedback is False else "without --kp"
            refuse_without_effect(context, gains, reason)

    @property
    def has_feedback(self) -> bool:
        """Whether there is feedback: on one's own stage where a gain is given."""
        if self.feedback is None:
            return not self.own or self.kp is not None
        return self.feedback

    def pid(self, model: IdentifiedModel | None) -> Pid | None:
        """Make the feedback; the paper's gains are for its own stage only."""
        from ...control.laws.pid import Pid

        if not self.has_feedback:
            return None
        if not self.own:
            given = {"kp": self.kp, "ti": self.ti, "td": self.td}
            gains = {key: PAPER_GAINS[key] if one is None else one for key, one in given.items()}
            return Pid.from_um(**gains, tt=self.tt)
        if self.kp is None or self.ti is None:
            missing = "--kp" if self.kp is None else "--ti"
            raise ParameterError(
                missing,
                "missing",
                "--kp in V/um and --ti in s for feedback on this stage, or --no-feedback",
            )
        return Pid(kp=self.kp * _per_um(model), ti=self.ti, td=self.td or 0.0, tt=self.tt)

    def dt(self, model: IdentifiedModel | None, reference: Reference | None) -> float:
        """Return the sampling interval: as given, of the reference's file, or of the record [s]."""
        if not self.own:
            return PAPER_DT if self.interval is None else self.interval
        of_file = None if reference is None else reference.interval
        of_model = None if model is None else model.dt
        for known in (self.interval, of_file, of_model):
            if known is not None:
                return known
        raise _missing("--dt", "the sampling interval in s")

    def volts(self, model: IdentifiedModel | None) -> tuple[float, float]:
        """Return the voltage limits: as given, or the range of the model's record [V]."""
        if self.limits is not None:
            low, high = number_range("--limits", self.limits)
            _, scale = shown_unit(unit_of(self.own, model))
            return low / scale, high / scale
        known = model.drive_range if self.own and model else PAPER_LIMITS
        if known is None:
            raise _missing("--limits", "the voltage limits as LOW:HIGH in V")
        return known

    def repetitive(
        self, model: IdentifiedModel, reference: Reference, kq: float | None, tq: float | None
    ) -> Repetitive:
        """Make the repetitive part; on one's own stage half of an error is learnt in a period."""
        from ...control.parts.repetitive import Repetitive
        from ...control.plant import linearised_plants, plant_of

        period = reference.period
        if period is None:
            raise ParameterError(f"--repetitive: the reference ({reference.name}) does not repeat")
        if kq is None and self.own:
            _, middle, _ = linearised_plants(plant_of(model), self.volts(model), 0.0)
            kq = 0.5e-6 / middle.static_gain
        elif kq is not None and self.own:
            kq *= 1e-6 * _per_um(model)
        return Repetitive.from_um(
            period=period,
            kq=PAPER_KQ if kq is None else kq,
            tq=(period / 25.0 if self.own else PAPER_TQ) if tq is None else tq,
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


def _per_um(model: IdentifiedModel | None) -> float:
    """Factor from a gain in V/um, or in um/um where the drive is a position, to SI."""
    _, scale = shown_unit(unit_of(True, model))
    return 1e6 / scale


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


def simulated(
    stage: str | None, known: IdentifiedModel, noise: float, bandwidth: float, seed: int
) -> VirtualStage:
    """Make the stage of `StageFile`, with the noise [m] of a sensor and a bandwidth [Hz]."""
    from ...stages.virtual import VirtualStage

    if stage == PAPER:
        return VirtualStage.xu_li_2010(seed=seed)
    other = stage_model(stage, known)
    return VirtualStage.of(other, noise=noise, bandwidth=bandwidth, seed=seed)


def stage_model(stage: str | None, known: IdentifiedModel) -> IdentifiedModel:
    """Load the model of `StageFile`, with a drive like that of the other; default that itself."""
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


def refuse_of_other_stage(context: typer.Context, own: bool) -> None:
    """Refuse options of the stage that is not simulated."""
    if not own:
        refuse_without_effect(
            context, ["noise_nm", "bandwidth"], f"with --stage {PAPER}, which has its own"
        )
