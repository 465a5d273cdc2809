"""`load_response`: frequency responses from JSON files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._support.messages import quoted
from ..errors import ParameterError
from ..identification.fitted.model_file import checked_content, entries_of
from .response_data import FORMAT, SCHEMA_VERSION, FrequencyResponse

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["load_response"]


def load_response(path: str | os.PathLike[str]) -> FrequencyResponse:
    """Read a frequency response that `FrequencyResponse.save` has written.

    Parameters
    ----------
    path : path-like
        ``response.json`` of a folder.

    Returns
    -------
    FrequencyResponse
        Its numbers as they were saved, bit for bit.

    Raises
    ------
    DataError
        The file is missing, is no frequency response, or was written by a newer version; or an
        entry is missing or of another kind.

    Examples
    --------
    >>> import tempfile
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[1.0], weights=[0.2e-6])
    >>> lines = pt.RandomPhaseMultisine(band=(5.0, 90.0), low=28.0, high=32.0)
    >>> response = pt.frequency_response(stage, lines, rate=1000.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     again = pt.load_response(response.save(folder)[1])
    >>> bool((again.value == response.value).all())
    True
    """
    name, document = checked_content(path, "frequency response", FORMAT, SCHEMA_VERSION)
    with entries_of(name):
        return _response_of(document)


def _response_of(document: dict[str, Any]) -> FrequencyResponse:
    frequency = _numbers(document, "frequency_Hz")
    if not (frequency.size and (np.diff(frequency) > 0.0).all()):
        raise ParameterError("frequency_Hz", f"{frequency.size} entries", "rising frequencies")
    optional = {
        key: None if document[key] is None else _numbers(document, key)
        for key in ("noise", "distortion", "coherence")
    }
    real, imaginary = _numbers(document, "real"), _numbers(document, "imaginary")
    if real.shape != imaginary.shape:
        raise ParameterError("imaginary", f"{imaginary.size} entries", f"{real.size}, as real")
    return FrequencyResponse(
        frequency=frequency,
        value=real + 1j * imaginary,
        variance=_numbers(document, "variance"),
        degrees=_core.as_count("degrees", document["degrees"]),
        **optional,
        dt=_core.as_number("dt_s", document["dt_s"]),
        amplitude=_core.as_number("amplitude_rms", document["amplitude_rms"]),
        offset=_core.as_number("offset", document["offset"]),
        drive_unit=document["drive_unit"],
        output_unit=document["output_unit"],
        excitation=document["excitation"],
        source=document["source"],
        notes=tuple(document["notes"]),
    )


def _numbers(document: dict[str, Any], key: str) -> Array:
    entry = document[key]
    if not isinstance(entry, list):
        raise ParameterError(key, quoted(entry), "a list of numbers")
    values = np.array([_core.as_number(key, one) for one in entry])
    if not np.isfinite(values).all():
        raise ParameterError(key, quoted(entry), "finite numbers", verb="has")
    return values
