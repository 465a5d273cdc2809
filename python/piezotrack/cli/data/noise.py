"""``piezotrack noise``: the noise of a sensor at rest."""

from __future__ import annotations

from ..command import command
from ..option_groups import DisplacementColumns
from ..options import LogFile, Window, cut, of_file
from ..output import Output

__all__ = ["noise_command"]


@command()
def noise_command(
    file: LogFile, window: Window = None, *, columns: DisplacementColumns, output: Output
) -> None:
    """Analyse the noise of a sensor at rest.

    Its rms, resolution and spectrum, and a model of it.
    """
    from ..._support.files.writing import picture_files
    from ...data.reader import read_displacement
    from ...identification.experiments.sensor_noise import identify_noise

    part = cut(read_displacement(file, **columns.arguments), file, window)
    output.will_write(["noise.json", *picture_files("noise")])
    with of_file(file):
        found = identify_noise(part)
    output.show(found.summary(), found.document(), output.write(found.save))
