"""`load_axes`: models of several axes from JSON files."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._support.arguments import positive
from .._support.messages import quoted
from ..errors import ParameterError, ShapeError
from ..identification.fitted.model_file import checked_content, entries_of
from .distortion import Distortion, ModalForce, Regressors
from .modal_model import FORMAT, SCHEMA_VERSION, AxesLevel, MultiAxisModel
from .modal_terms import ModalTerms

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["load_axes"]


def load_axes(path: str | os.PathLike[str]) -> MultiAxisModel:
    """Read a model of several axes that `MultiAxisModel.save` has written.

    Parameters
    ----------
    path : path-like
        ``axes.json`` of a folder.

    Returns
    -------
    MultiAxisModel
        Its numbers as they were saved, bit for bit, without the measured responses.

    Raises
    ------
    DataError
        The file is missing, is no model of several axes, or was written by a newer version; or an
        entry is missing or of another kind.

    Examples
    --------
    >>> import tempfile
    >>> import piezotrack as pt
    >>> stage = pt.multiaxis.VirtualAxes.three(noise=1e-9, seed=1)
    >>> model = pt.multiaxis.identify_axes(stage.record(samples=512))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     again = pt.multiaxis.load_axes(model.save(folder)[1])
    >>> bool((again.at().poles == model.at().poles).all())
    True
    """
    name, document = checked_content(path, "model of several axes", FORMAT, SCHEMA_VERSION)
    with entries_of(name):
        if not isinstance(document["levels"], list) or not document["levels"]:
            raise ParameterError("levels", quoted(document["levels"]), "a list of levels")
        levels = tuple(_level(entry) for entry in document["levels"])
        shapes = {(one.terms.direct.shape, one.terms.poles.size) for one in levels}
        if len(shapes) > 1:
            raise ShapeError("levels", f"{len(shapes)} sizes", "the same modes at all")
        sizes = [one.level for one in levels]
        if sizes[0] <= 0.0 or any(b <= a for a, b in itertools.pairwise(sizes)):
            raise ParameterError("levels", quoted(sizes), "rising numbers above 0")
        return MultiAxisModel(
            levels=levels,
            distortion=_distortion(document.get("distortion", {}), levels),
            dt=_core.as_number("dt_s", document["dt_s"]),
            drive_unit=document["drive_unit"],
            output_unit=document["output_unit"],
            source=document["source"],
            notes=tuple(document["notes"]),
        )


def _level(entry: dict[str, Any]) -> AxesLevel:
    direct = _array(entry, "direct", 2)
    sensors, drives = direct.shape
    poles = _complex(entry, "poles", 1)
    terms = ModalTerms(poles, _complex(entry, "inputs", 2), _complex(entry, "outputs", 2), direct)
    for name, width in (("inputs", drives), ("outputs", sensors)):
        if getattr(terms, name).shape != (poles.size, width):
            raise ShapeError(
                name, f"the shape {getattr(terms, name).shape}", f"{poles.size} x {width}"
            )
    # Files of models without distortion have none of its entries.
    if entry.get("forces_real"):
        forces = _complex(entry, "forces", 2)
        if forces.shape != (poles.size, drives):
            raise ShapeError("forces", f"the shape {forces.shape}", f"{poles.size} x {drives}")
        terms = replace(terms, forces=forces)
    _ = terms.core
    means = {
        name: _sized(_array(entry, name, 1), name, width)
        for name, width in (("drive_mean", drives), ("output_mean", sensors))
    }
    return AxesLevel(
        level=_core.as_number("level_rms", entry["level_rms"]),
        terms=terms,
        decay_sd=_sized(_array(entry, "decay_sd", 1), "decay_sd", poles.size),
        angle_sd=_sized(_array(entry, "angle_sd_rad", 1), "angle_sd_rad", poles.size),
        misfit=_core.as_number("misfit", entry["misfit"]),
        expected=_core.as_number("expected_misfit", entry["expected_misfit"]),
        distorted=_core.as_number("distorted", entry.get("distorted", 1.0)),
        **means,
    )


def _distortion(entry: dict[str, Any], levels: tuple[AxesLevel, ...]) -> Distortion:
    """Return the distortion of all levels."""
    if not entry.get("forces"):
        return Distortion()
    numbers = {
        name: tuple(_sized_variable(name, row) for row in entry[name])
        for name in ("stops", "changes")
    }
    products = tuple(
        tuple(_core.as_count("products", k) for k in variables) for variables in entry["products"]
    )
    regressors = Regressors(products, **numbers)
    modes = levels[0].terms.poles.size
    forces = []
    for row in entry["forces"]:
        if not isinstance(row, list) or len(row) != 5:
            raise ParameterError("forces", quoted(row), "rows of five numbers", verb="has")
        mode, regressor, power = (_core.as_count("forces", k) for k in row[:3])
        if mode >= modes or regressor >= len(regressors):
            expected = f"a mode below {modes} and a function below {len(regressors)}"
            raise ParameterError("forces", quoted(row), expected, verb="has")
        real, imaginary = (_core.as_number("forces", value) for value in row[3:])
        forces.append(ModalForce(mode, regressor, power, complex(real, imaginary)))
    if any(not one.terms.forces.size for one in levels):
        raise ShapeError("forces_real", "no forces of the drives", "those of each level")
    reference = positive("reference_rms", entry["reference_rms"], "V")
    ends = levels[0].level, levels[-1].level
    found = Distortion(regressors, tuple(forces), reference, ends)
    regressors.core(levels[0].terms, levels[0].level)
    return found


def _sized_variable(name: str, row: object) -> tuple[int, float]:
    """Return a variable and its threshold or scale."""
    if not isinstance(row, list) or len(row) != 2:
        raise ParameterError(name, quoted(row), "pairs of a variable and a number", verb="has")
    return _core.as_count(name, row[0]), _core.as_number(name, row[1])


def _complex(entry: dict[str, Any], name: str, dimensions: int) -> NDArray[np.complex128]:
    real, imaginary = (
        _array(entry, f"{name}_{part}", dimensions) for part in ("real", "imaginary")
    )
    if real.shape != imaginary.shape:
        raise ShapeError(f"{name}_imaginary", f"the shape {imaginary.shape}", f"{real.shape}")
    return real + 1j * imaginary


def _sized(values: Array, name: str, count: int) -> Array:
    if values.size != count:
        raise ShapeError(name, f"{values.size} entries", f"{count}")
    return values


def _array(entry: dict[str, Any], key: str, dimensions: int) -> Array:
    """Return a list of numbers, or of lists of them, as an array of finite numbers."""
    rows = entry[key]
    lists = rows if dimensions == 2 else [rows]
    if not isinstance(rows, list) or not all(isinstance(row, list) for row in lists):
        raise ParameterError(key, quoted(rows), "a list of numbers" if dimensions == 1 else "rows")
    if len({len(row) for row in lists}) > 1 or not lists:
        raise ShapeError(key, "rows of unequal lengths", "rows of the same length")
    values = np.array([[_core.as_number(key, one) for one in row] for row in lists])
    if not np.isfinite(values).all():
        raise ParameterError(key, quoted(rows), "finite numbers", verb="has")
    return np.asarray(values if dimensions == 2 else values[0], dtype=np.float64)
