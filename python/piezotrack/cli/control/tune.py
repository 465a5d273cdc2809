"""``piezotrack tune``: the gains of a controller for an identified model."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from ...errors import ParameterError
from ..error_messages import report_errors
from ..options import (
    Duration,
    Json,
    ModelFile,
    Out,
    Overwrite,
    Period,
    Quiet,
    Zero,
)
from ..output import Output
from .loop_options import (
    AmplifierBandwidth,
    Interval,
    Limits,
    Loop,
    LoopDelay,
    Noise,
    StageModel,
    known_model,
    noise_metres,
    stage_model,
    zero_words,
)

__all__ = ["tune_command"]


@report_errors
def tune_command(
    model: ModelFile,
    reference: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TEXT|FILE",
            help="Reference, as of `track`; may be given several times. Without one the gains "
            "follow from the margins alone.",
            show_default=False,
        ),
    ] = None,
    stage: StageModel = None,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    dt: Interval = None,
    limits: Limits = None,
    zero: Zero = False,
    parts: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Parts of the controller, of pid,low-pass,notch,repetitive; default those that "
            "stage and references ask for.",
            show_default=False,
        ),
    ] = None,
    figure: Annotated[
        str,
        typer.Option(
            metavar="rms|largest|effort",
            help="Error that is made small, or the effort within --allowed-um.",
        ),
    ] = "rms",
    allowed_um: Annotated[
        float | None,
        typer.Option(help="Largest rms error in um.", show_default=False),
    ] = None,
    gain_margin: Annotated[float, typer.Option(help="Least gain margin in dB.")] = 6.0,
    phase_margin: Annotated[float, typer.Option(help="Least phase margin in degrees.")] = 30.0,
    sensitivity: Annotated[float, typer.Option(help="Largest sensitivity Ms.")] = 2.0,
    mode_spread: Annotated[
        float,
        typer.Option(
            help="Percent by which the dynamics may be slower or faster than the model's."
        ),
    ] = 0.0,
    gain_spread: Annotated[
        float, typer.Option(help="Percent by which the gain may differ from the model's.")
    ] = 0.0,
    delay_spread: Annotated[
        float, typer.Option(help="Largest delay in s in addition to --delay.")
    ] = 0.0,
    feedforward: Annotated[
        bool, typer.Option(help="Feedforward by the inverse of the model.")
    ] = True,
    delay: LoopDelay = 0.0,
    noise_nm: Noise = 0.0,
    bandwidth: AmplifierBandwidth = math.inf,
    duration: Duration = None,
    period: Period = None,
    seed: Annotated[int, typer.Option(help="Random seed of the search and the sensor noise.")] = 1,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find the gains of a controller under margins."""
    from ..._support.files.writing import picture_files
    from ...control.timing import Timing
    from ...control.tuning.goal import Goal, TuningSearch
    from ...control.tuning.margins import Margins, Spread
    from ...control.tuning.tune import tune
    from ...control.tuning.tuned import picture_name
    from ...references.parse import reference_of
    from ...stages.virtual import VirtualStage

    _within("--gain-margin", gain_margin, 1e-6, 400.0, "dB, above 0 and below 400")
    _within("--phase-margin", phase_margin, 0.0, 180.0, "degrees, 0 to below 180")
    _within("--sensitivity", sensitivity, 1.0, math.inf, "a factor above 1")
    _within("--mode-spread", mode_spread, 0.0, 95.0, "per cent, 0 to below 95")
    _within("--gain-spread", gain_spread, 0.0, 95.0, "per cent, 0 to below 95")
    _within("--delay-spread", delay_spread, 0.0, math.inf, "seconds, 0 or above")
    margins = Margins(
        gain=10.0 ** (gain_margin / 20.0),
        phase=math.radians(phase_margin),
        sensitivity=sensitivity,
    )
    spread = Spread(delay=(0.0, delay_spread), mode=0.01 * mode_spread, gain=0.01 * gain_spread)
    known = known_model(model, zero=zero)
    desired = [reference_of(text, duration=duration, period=period) for text in reference or ()]
    settings = Loop(True, dt, limits, None, None, None, None)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    pictures = [name for i in range(len(desired)) for name in picture_files(picture_name(i))]
    result.will_write(["tuning.json", "controller.json", *pictures])
    plays = stage_model(stage, known)
    plant = VirtualStage.of(plays, noise=noise_metres(noise_nm), bandwidth=bandwidth, seed=seed)
    tuned = tune(
        [plant] if plays is known else [plant, known],
        desired or None,
        dt=settings.dt(known, desired[0] if desired else None),
        limits=settings.volts(known),
        feedforward=known.inverse() if feedforward else None,
        parts=None if parts is None else [one.strip() for one in parts.split(",")],
        margins=margins,
        spread=spread,
        goal=Goal(
            minimise=_figure(figure, allowed_um),
            largest_error=math.inf if allowed_um is None else 1e-6 * allowed_um,
        ),
        timing=Timing(delay=delay),
        search=TuningSearch(seed=seed),
    )
    words = f"stage: {stage or model.name}{zero_words(known)}\n{tuned}"
    result.show(words, tuned.document(), tuned.save(out))


def _within(option: str, value: float, low: float, high: float, expected: str) -> None:
    """Refuse a value by the name and in the unit of its option, which the library does not know.

    0 is in its range, 1 is not.
    """
    if not (low < value < high or value == low == 0.0):
        raise ParameterError(option, f"{value:g}", expected)


def _figure(figure: str, allowed: float | None) -> Any:
    if figure not in ("rms", "largest", "effort"):
        raise ParameterError("--figure", figure, "rms, largest or effort")
    if figure == "effort" and allowed is None:
        raise ParameterError(
            "--figure", "effort without --allowed-um", "the largest rms error in um"
        )
    if allowed is not None and not allowed > 0.0:
        raise ParameterError("--allowed-um", f"{allowed:g}", "an error above 0 um")
    return figure
