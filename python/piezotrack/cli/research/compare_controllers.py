"""``piezotrack compare-controllers``: controllers side by side on one stage."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from ...errors import ParameterError
from ..control.loop_options import (
    PAPER,
    AmplifierBandwidth,
    Interval,
    Limits,
    Loop,
    LoopDelay,
    Noise,
    StageFile,
    driven_by_voltage,
    noise_metres,
    refuse_of_other_stage,
    simulated,
)
from ..error_messages import report_errors
from ..options import Json, ModelFile, Out, Overwrite, Quiet
from ..output import Output

__all__ = ["compare_controllers_command"]

# Other spellings that the option takes.
SPELLINGS = {
    "inverse + sliding mode": "inverse + sliding-mode",
    "inverse + perturbation estimation": "inverse + perturbation-estimator",
    "inverse + disturbance observer": "inverse + disturbance-observer",
    "inverse + scheduled PID": "inverse + scheduled-pid",
    "PID + hysteresis observer": "PID + hysteresis-observer",
}


@report_errors
def compare_controllers_command(
    context: typer.Context,
    model: ModelFile,
    stage: StageFile = None,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    dt: Interval = None,
    limits: Limits = None,
    rates: Annotated[
        str,
        typer.Option(metavar="A,B,C", help="Rates of the references in Hz: slow, medium, fast."),
    ] = "1,5,20",
    controllers: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Controllers, separated by commas; default all.",
            show_default=False,
        ),
    ] = None,
    sensitivity: Annotated[float, typer.Option(help="Largest sensitivity Ms of each.")] = 2.0,
    delay: LoopDelay = 0.0,
    noise_nm: Noise = 0.0,
    bandwidth: AmplifierBandwidth = math.inf,
    seeds: Annotated[
        int, typer.Option(help="Draws of the sensor noise that each controller is judged by.")
    ] = 3,
    searches: Annotated[
        int, typer.Option(help="Searches, each with another seed, of which the median is taken.")
    ] = 3,
    seed: Annotated[int, typer.Option(help="Random seed of the searches and sensor noise.")] = 1,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare controllers on one stage."""
    from ..._support.files.writing import picture_files
    from ...control.comparing.compare import compare_controllers
    from ...control.timing import Timing
    from ...control.tuning.goal import TuningSearch
    from ...control.tuning.margins import Margins
    from ...identification.fitted.model_file import load

    of_model = stage != PAPER
    refuse_of_other_stage(context, of_model)
    known = load(model) if of_model else driven_by_voltage(load(model), model)
    settings = Loop(of_model, dt, limits, None, None, None, None)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["controllers.json", *picture_files("controllers")])
    plant = simulated(stage, known, noise_metres(noise_nm), bandwidth, seed)
    comparison = compare_controllers(
        plant,
        known,
        dt=settings.dt(known, None),
        limits=settings.volts(known),
        rates=_rates(rates),
        controllers=None
        if controllers is None
        else [SPELLINGS.get(one, one) for one in map(str.strip, controllers.split(","))],
        margins=Margins(sensitivity=sensitivity),
        timing=Timing(delay=delay),
        seeds=seeds,
        searches=searches,
        search=TuningSearch(seed=seed),
    )
    result.show(str(comparison), comparison.document(), comparison.save(out))


def _rates(text: str) -> tuple[float, float, float]:
    try:
        slow, medium, fast = (float(one) for one in text.split(","))
    except ValueError:
        raise ParameterError("--rates", f"{text!r}", "three rates in Hz, as 1,5,20") from None
    if not 0.0 < slow < medium < fast < math.inf:
        raise ParameterError("--rates", f"{text!r}", "three rates in Hz in rising order")
    return slow, medium, fast
