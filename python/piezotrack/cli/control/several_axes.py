"""Models of several axes in ``piezotrack track``: a decoupled loop along a reference of each."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...errors import NumericalError, ParameterError, ShapeError
from ..command import refuse_without_effect
from .loop_options import MOST_SENSITIVITY, PAPER

if TYPE_CHECKING:
    from ...control.laws.pid import Pid
    from ...multiaxis.loop.closed_loop import MultiAxisTracking
    from ...multiaxis.modal_model import MultiAxisModel
    from ..option_groups import Motion
    from ..output import Output
    from .loop_options import FeedbackOptions, Simulation

__all__ = ["axes_in", "refuse_several_references", "track_several"]

# Options that act on several axes.
ACTING = {
    *("model", "reference", "stage", "duration", "period", "limits", "feedforward"),
    *("kp", "ti", "td", "tt", "unstable", "noise", "seed"),
    *("verbose", "json", "quiet", "out", "overwrite", "format", "width"),
}
# Units of a gain from displacement to displacement.
RATIOS = ("", "um/um", "nm/nm")


def axes_in(file: Path) -> MultiAxisModel | None:
    """Load a model of several axes, or return None where the file is another."""
    from ...identification.fitted.model_file import read_content
    from ...multiaxis.modal_model import FORMAT
    from ...multiaxis.model_file import load_axes

    # A file that is not there is told where it is needed.
    if not file.is_file():
        return None
    _, document = read_content(file)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        return None
    return load_axes(file)


def refuse_several_references(text: str) -> None:
    """Refuse references of several axes for a model of one."""
    from ...multiaxis.loop.references import BETWEEN

    if BETWEEN in text and not Path(text).is_file():
        count = len(text.split(BETWEEN))
        raise ParameterError(
            "REFERENCE", f"of {count} axes", "one reference, as the model has one axis"
        )


def track_several(
    model: MultiAxisModel,
    file: Path,
    reference: str,
    stage: str | None,
    motion: Motion,
    loop: FeedbackOptions,
    simulation: Simulation,
    output: Output,
    *,
    unstable: bool,
) -> None:
    """Track references of several axes, with the diagonal of the gains and with all of them."""
    from ..._support.files.writing import picture_files
    from ...multiaxis.loop.closed_loop import check_axes, track_axes
    from ...multiaxis.loop.references import sampled_references

    others = [one.name for one in click.get_current_context().command.params if one.name]
    refuse_without_effect([name for name in others if name not in ACTING], "with several axes")
    if model.output_unit != "m":
        raise ParameterError("MODEL", f"in {model.output_unit}", "displacements, in um")
    if not simulation.noise:
        refuse_without_effect(("seed",), "without --noise")
    plant = _stage(stage, model)
    law = _law(loop)
    wanted = sampled_references(
        reference, model.sensors, model.dt, duration=motion.duration, period=motion.period
    )
    output.will_write(["axes_run.csv", "axes_run.json", *picture_files("axes_run")])
    margins = check_axes(plant, law, model=model)
    if not margins.stable and not unstable:
        raise NumericalError(f"the decoupled loop is {margins}: lower --kp or raise --ti")
    settings: dict[str, Any] = {
        "feedforward": "static" if loop.feedforward else "none",
        "limits": None if loop.limits is None else loop.volts(None),
        "noise": simulation.parts["noise"],
        "seed": simulation.seed,
        "model": model,
    }
    run = track_axes(plant, wanted, law, **settings)
    try:
        diagonal = track_axes(plant, wanted, law, decoupling="diagonal", **settings)
        before = f"{_shares(diagonal)}; {diagonal.margins}"
    except (NumericalError, ShapeError) as error:
        diagonal, before = None, f"{error}"
    lines = [
        f"stage: {stage or file.name}, {model.drives} drives, {model.sensors} sensors",
        run.summary(),
        "largest motion off the references, of the largest stroke",
        f"  before, each axis by its own gain: {before}",
        f"  after, gains at rest decoupled: {_shares(run)}",
    ]
    notes = []
    if loop.limits is not None:
        notes.append("limits count from the mean of the drives at which the model was identified")
    if margins.stable and margins.sensitivity > MOST_SENSITIVITY:
        notes.append(
            f"the loop is close to instability, Ms is above {MOST_SENSITIVITY:g}: lower the gain"
        )
    lines += [f"note  {one}" for one in notes]
    entries = {
        "stage": stage or "model",
        "notes": notes,
        "diagonal": None if diagonal is None else _figures(diagonal),
    }
    written = output.write(partial(run.save, entries=entries))
    output.show("\n".join(lines), run.document() | entries, written)


def _stage(stage: str | None, model: MultiAxisModel) -> MultiAxisModel:
    """Load the stage that is simulated; default the model itself."""
    if stage is None:
        return model
    found = None if stage == PAPER else axes_in(Path(stage))
    if found is None:
        raise ParameterError("--stage", stage, "a model of several axes, as MODEL")
    return found


def _law(loop: FeedbackOptions) -> Pid:
    """Make the law of each decoupled axis, whose gain is a ratio."""
    from ...control.laws.pid import Pid

    if loop.kp is None or loop.ti is None:
        raise ParameterError(
            "--kp" if loop.kp is None else "--ti",
            "missing",
            "--kp 0.01um/um --ti 1ms for the PID of each decoupled axis",
        )
    if (unit := getattr(loop.kp, "unit", "")) not in RATIOS:
        raise ParameterError("--kp", f"in {unit}", "a ratio, as 0.01um/um")
    return Pid(kp=loop.kp, ti=loop.ti, td=loop.td or 0.0, tt=loop.tt)


def _figures(run: MultiAxisTracking) -> dict[str, Any]:
    """Return what the document says of the loop without decoupling."""
    names = ("stable", "sensitivity", "complementary", "cross_coupling")
    return {name: run.document()[name] for name in names}


def _shares(run: MultiAxisTracking) -> str:
    return ", ".join(f"{100.0 * share:.2f} %" for share in run.cross_coupling)
