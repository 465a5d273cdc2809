"""Reading of model files, and the errors of files that cannot be read."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.files.json_text import number_pair, object_of, parse_json, text_of
from ..._support.messages import quoted
from ..._support.units import of_drive
from ...errors import DataError, ParameterError, PiezotrackError
from ...stages.registry import model_named, stage_class
from .certainty.entries import covariance_of_file
from .drift import drift_of
from .fitted_record import records_of_file
from .identified_model import IdentifiedModel
from .model_entries import FORMAT, SCHEMA_VERSION, SENSOR, drive_unit_of, sensor_number
from .start import start_of

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping

    from ...stages.base import Stage
    from ...stages.model_info import ModelInfo
    from ...stages.motion import StageState
    from .fitted_record import FittedRecord

__all__ = [
    "checked_content",
    "entries_of",
    "load",
    "read_content",
    "stage_of",
]

# Parameters of the model "prandtl-ishlinskii" by their names in version 1.
NAMES_1 = {
    "corners": "dead_zone_thresholds",
    "bends": "dead_zone_weights",
    "creep_shares": "creep_weights",
}
# Entries that are fields of a model; all others are its details.
OWN = {
    "format",
    "schema_version",
    "model",
    "parameters",
    "scale_assumed",
    "offset",
    "stroke",
    "delay",
    "start",
    "drift",
    "records",
    "interpolation",
    "covariance",
}
# Most samples to which one is interpolated.
MOST_FINER = 100
# Format of models of several axes.
SEVERAL_AXES = "piezotrack-axes"
# Entries of a parameter that are not details of the fit.
FACTS = ("value", "unit", "symbol")


def load(path: str | os.PathLike[str]) -> IdentifiedModel:
    """Read a model file.

    Parameters
    ----------
    path : path-like
        A file that `save` of an identified model wrote, with this version of piezotrack or an
        older one.

    Returns
    -------
    IdentifiedModel
        The model, its numbers as they were saved, bit for bit.

    Raises
    ------
    DataError
        The file is missing, is not a model file, or was written by a newer version.

    Examples
    --------
    >>> import piezotrack as pt
    >>> model = pt.identification.IdentifiedModel(
    ...     model=pt.DahlStage.xu_li_2010(), offset=0.0, offset_fitted=False, stroke=119e-6
    ... )
    >>> import os, tempfile
    >>> path = model.save(os.path.join(tempfile.mkdtemp(), "dahl.json"))
    >>> pt.load(path).model == model.model
    True
    """
    name, document = checked_content(path, "model", FORMAT, SCHEMA_VERSION, first=1)
    try:
        info = model_named(document.get("model"))
    except ParameterError as error:
        raise DataError(f"{name} holds a {str(error).replace(' is', '', 1)}") from None
    with entries_of(name):
        if document["schema_version"] == 1:
            _from_version_1(document, searched=info.searched)
        parameters = document["parameters"]
        _check_origin(document.get("provenance"))
        stage = stage_of(info, parameters, drive_unit_of(document, info))
        delay = document["delay"]
        return IdentifiedModel(
            model=stage,
            offset=file_number("offset", document["offset"]),
            offset_fitted=_core.as_truth("offset fitted", document["offset"]["fitted"]),
            scale_assumed=_core.as_truth("scale_assumed", document["scale_assumed"]),
            stroke=file_number("stroke", document["stroke"]),
            delay=file_number("delay", delay),
            start=start_of(document.get("start"), stage_class(info)._state),
            drift=drift_of(document.get("drift")),
            records=_records(document, stage_class(info)._state),
            interpolation=_interpolation(document.get("interpolation")),
            covariance=covariance_of_file(document.get("covariance"), _numbers_of(stage)),
            details={
                "parameters": {key: _fit_details(entry) for key, entry in parameters.items()},
                "delay": _fit_details(delay),
                **{key: value for key, value in document.items() if key not in OWN},
            },
        )


def _numbers_of(stage: Stage) -> set[str]:
    """Return the names of the numbers of a stage, entries of lists one by one, and of the delay."""
    names = {"delay"}
    for name in stage.parameter_names():
        value = getattr(stage, name)
        entries = (
            [f"{name}[{k}]" for k in range(len(value))] if isinstance(value, tuple) else [name]
        )
        names |= {one for one in entries if value is not None}
    return names


def stage_of(info: ModelInfo, parameters: dict[str, Any], drive: str) -> Stage:
    """Read a stage from the entries of a file.

    Parameters
    ----------
    info : ModelInfo
        Its model.
    parameters : dict
        Entries by the name of the parameter; those of versions without a parameter get it.
    drive : str
        Unit of the drive.

    Returns
    -------
    Stage
        The stage.

    Raises
    ------
    ParameterError
        A parameter is in another unit, or out of its range.
    """
    for parameter in info.parameters:
        unit = of_drive(parameter.unit, drive)
        if parameter.is_list and parameter.is_optional and parameter.name not in parameters:
            parameters[parameter.name] = {"value": [], "unit": unit}
        require_unit(parameter.name, parameters[parameter.name], unit)
    values = {parameter.name: parameters[parameter.name]["value"] for parameter in info.parameters}
    for parameter in info.parameters:
        if parameter.is_list:
            values[parameter.name] = tuple(values[parameter.name])
    return stage_class(info)(**values)


def _check_origin(found: Any) -> None:
    """Refuse entries on the record identified that cannot be used."""
    _check_record("provenance: data", object_of("provenance", found).get("data"))


def _check_record(place: str, found: Any) -> None:
    """Refuse entries on a record that cannot be used."""
    record = object_of(place, found)
    for name in ("source", "sha256", "drive_unit"):
        text_of(f"{place}: {name}", record.get(name))
    for name in ("drive_rate", "dt_s"):
        if record.get(name) is not None:
            _core.as_number(f"{place}: {name}", record[name])
    for name in ("window_s", "drive_range"):
        number_pair(f"{place}: {name}", record.get(name))


def _records(document: Mapping[str, Any], state: type[StageState]) -> tuple[FittedRecord, ...]:
    """Read the records of a model that was identified from several."""
    records = records_of_file(document.get("records"), state)
    for i, one in enumerate(records):
        _check_record(f"records[{i}]: data", one.origin)
    return records


def _interpolation(entry: object) -> int | None:
    """Read to how many samples each of a record is interpolated; None where it is not."""
    if entry is None:
        return None
    factor = _core.as_count("interpolation", entry)
    if not 2 <= factor <= MOST_FINER:
        raise ParameterError("interpolation", f"{factor}", f"a whole number from 2 to {MOST_FINER}")
    return factor


def _fit_details(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in entry.items() if key not in FACTS}


def _from_version_1(document: dict[str, Any], *, searched: bool) -> None:
    """Convert the content of a file of version 1 to that of this version."""
    # Files of the first models have no delay.
    document.setdefault("delay", {"value": 0.0, "unit": "s"})
    if searched:
        return
    document.setdefault("scale_assumed", False)
    parameters = document["parameters"]
    document["parameters"] = {NAMES_1.get(key, key): entry for key, entry in parameters.items()}
    for key, entry in document["parameters"].items():
        chosen = key in ("thresholds", "dead_zone_thresholds", "creep_times")
        entry.setdefault("free", not chosen)


def checked_content(
    path: str | os.PathLike[str], kind: str, form: str, latest: int, first: int | None = None
) -> tuple[str, dict[str, Any]]:
    """Read a file of some `format`, of the versions `first` to `latest`; return name and content.

    Raises
    ------
    DataError
        The file is missing, of another format, or of another version.
    """
    name, document = read_content(path)
    if not isinstance(document, dict) or document.get("format") != form:
        if isinstance(document, dict) and document.get("format") == SEVERAL_AXES:
            raise DataError(
                f"{name} is a model of several axes, which only `track` takes: expected a {kind} "
                "of one axis"
            )
        raise DataError(f"{name} is not a piezotrack {kind}: its 'format' is not '{form}'")
    found = document.get("schema_version")
    known = range(latest if first is None else first, latest + 1)
    if found not in known or isinstance(found, bool):
        versions = f"{latest}" if len(known) == 1 else f"{known[0]} to {latest}"
        raise DataError(
            f"{name}: schema_version is {quoted(found)}: expected {versions}, which this version "
            "of piezotrack reads"
        )
    return name, document


def read_content(path: str | os.PathLike[str]) -> tuple[str, Any]:
    """Read what a JSON file holds.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    name : str
        Of the file, for messages.
    content : object
        What it holds.

    Raises
    ------
    DataError
        The file is missing, or is no JSON.
    """
    try:
        file = Path(path)
    except TypeError:
        raise ParameterError("path", f"{path!r}", "the name of a file") from None
    try:
        content = file.read_bytes()
    except IsADirectoryError:
        raise DataError(
            f"{file.name}: is a directory: expected a file that piezotrack saved"
        ) from None
    except FileNotFoundError:
        raise DataError(
            f"{file.name}: there is no such file in {quoted(str(file.parent))}"
        ) from None
    except OSError as error:
        raise DataError(f"{file.name}: {(error.strerror or str(error)).lower()}") from None
    except ValueError as error:
        raise DataError(f"{file.name} cannot be read: {error}") from None
    return file.name, parse_json(file.name, content)


@contextmanager
def entries_of(name: str) -> Iterator[None]:
    """Name the file in errors about a missing or malformed entry."""
    try:
        yield
    except KeyError as error:
        raise DataError(f"{name}: the entry {error} is missing") from None
    except (TypeError, AttributeError, OverflowError):
        raise DataError(f"{name}: an entry is not of the form that 'save' writes") from None
    except PiezotrackError as error:
        raise DataError(f"{name}: {error}") from None


def require_unit(name: str, entry: Mapping[str, Any], unit: str) -> None:
    """Refuse an entry that is in another unit than the one that is written."""
    if entry.get("unit") != unit:
        raise ParameterError(f"the unit of {name}", f"{entry.get('unit')!r}", f"{unit!r}")


def file_number(name: str, entry: Mapping[str, Any]) -> float:
    """Take offset, stroke or delay from the file."""
    require_unit(name, entry, SENSOR[name][0])
    return sensor_number(name, entry["value"])
