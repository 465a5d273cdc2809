"""``piezotrack feedforward``: the table of the inverse of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..command import command
from ..option_groups import Motion
from ..options import ModelFile, Reference, Zero, in_order
from ..output import Output
from .loop_options import BeyondReach, LoopOptions, Online, known_model, zero_words

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["feedforward_command"]


@command()
def feedforward_command(
    model: ModelFile,
    reference: Reference,
    *,
    motion: Motion,
    loop: LoopOptions,
    zero: Zero = False,
    online: Online = False,
    beyond_reach: BeyondReach = False,
    output: Output,
) -> None:
    """Compute the feedforward voltage for a motion.

    Written as a table of time, voltage and displacement.
    """
    from ..._support.files.writing import (
        picture_files,
        result_set,
        save_figures,
        write_columns,
    )
    from ..._support.units import drive_word, shown_unit
    from ...control.loop.preconditions import check_within_reach
    from ...control.plant import plant_of
    from ...control.views.tracking_plot import plot_feedforward

    in_order(model, reference)
    known = known_model(model, zero=zero)
    desired = motion.of(reference)
    interval = loop.interval(known, desired)
    # A file without a record has no range.
    volts = None if loop.limits is None and known.drive_range is None else loop.volts(known)
    output.will_write(["feedforward.csv", *picture_files("feedforward")])
    samples = desired.sample(interval)
    if volts is not None and not beyond_reach:
        check_within_reach(plant_of(known), volts, samples, known.drive_unit)
    voltage, how = known.inverse(playback="online" if online else "table").played(
        desired, interval, samples=samples, limits=volts
    )
    if volts is not None:
        voltage = voltage.clip(*volts)
    unit, scale = shown_unit(known.drive_unit)
    what = drive_word(known.drive_unit)
    shown = scale * voltage
    table = {"time_s": samples.t, f"{what}_{unit}": shown, "displacement_um": 1e6 * samples.x}

    def save(place: Path) -> list[Path]:
        with result_set(place) as folder:
            picture = plot_feedforward(
                *(samples.t, voltage, samples.x),
                title=f"feedforward ({known.model.info.title}) for {desired.name}",
                drive_unit=known.drive_unit,
                limits=volts,
            )
            written = [write_columns(folder / "feedforward.csv", table)]
            return written + save_figures({"feedforward": picture}, folder)

    notes = known.extrapolation_notes(voltage, interval)
    lines = [
        f"{desired!r} at {1.0 / interval:g} Hz; {how}{zero_words(known)}",
        f"{voltage.size} samples, {what} from {shown.min():.4g} to {shown.max():.4g} {unit}",
        *(f"note  {note}" for note in notes),
    ]
    document = {
        "reference": repr(desired),
        "samples": voltage.size,
        "dt": {"value": interval, "unit": "s"},
        f"{what}_range": {
            "value": [float(voltage.min()), float(voltage.max())],
            "unit": known.drive_unit,
        },
        "feedforward": how,
        "notes": notes,
    }
    output.show("\n".join(lines), document, output.write(save))
