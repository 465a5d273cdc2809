"""``piezotrack response``: the frequency response of a stage, with its uncertainty."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ...errors import ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..connection import connected
from ..option_groups import LogOptions
from ..options import OnDevice, Rest, Window, cut, of_file
from ..output import Output
from ..values import FREQUENCY, TIME

if TYPE_CHECKING:
    from typing import TypeAlias

    from ...response.response_data import FrequencyResponse

    Span: TypeAlias = tuple[float | None, float | None]

__all__ = ["response_command"]


@command(hold="zoh")
def response_command(
    source: Annotated[
        list[str],
        Argument(
            "Excitation of a device, random-phase:1..400Hz,30..35V; or logs", "EXCITATION|FILE"
        ),
    ],
    window: Window = None,
    device: OnDevice = None,
    rest: Rest = None,
    *,
    period: Annotated[
        float | None, Option("Time after which the drive of a log repeats; default found", TIME)
    ] = None,
    resolution: Annotated[
        float | None, Option("Distance of the frequencies of a log that does not repeat", FREQUENCY)
    ] = None,
    reading: LogOptions,
    output: Output,
) -> None:
    """Measure a frequency response with its uncertainty, or compute it from logs.

    With --device and --rate a random-phase multisine is played, for several periods in several
    realisations of its phases; noise and nonlinear distortion are distinguished. Of logs each is a
    realisation.
    """
    from ..._support.files.writing import picture_files

    output.will_write(["response.csv", "response.json", *picture_files("response")])
    if device is None:
        found = _of_logs(source, window, reading, period, resolution)
    else:
        refuse_without_effect(["window", "period", "resolution"], "with --device")
        found = _measured(source, device, reading.rate, rest)
    output.show(found.summary(), found.document(), output.write(found.save))


def _of_logs(
    source: list[str],
    window: Span | None,
    reading: LogOptions,
    period: float | None,
    resolution: float | None,
) -> FrequencyResponse:
    from ...response.measuring import frequency_response

    refuse_without_effect(["rest"], "without --device")
    files = [Path(one) for one in source]
    if source[0].startswith("random-phase:"):
        raise ParameterError("--device", "missing", "a device that the excitation is played on")
    logs = [cut(reading.log(file), file, window) for file in files]
    with of_file(files[0]):
        return frequency_response(logs, period=period, resolution=resolution)


def _measured(
    source: list[str], address: str, rate: float | None, rest: float | None
) -> FrequencyResponse:
    from ...response.excitation import parse_excitation
    from ...response.measuring import frequency_response

    if len(source) > 1:
        raise ParameterError(
            "EXCITATION|FILE", f"{len(source)} texts", "one excitation with --device"
        )
    if rate is None:
        raise ParameterError("--rate", "missing", "a sampling rate, as 1kHz")
    excitation = parse_excitation(source[0])
    with connected(address) as device:
        return frequency_response(device, excitation, rate=rate, rest=rest)
