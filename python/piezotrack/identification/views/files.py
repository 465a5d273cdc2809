"""Files of an identification: the model, and its pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..._support.display.plot_style import whole
from ..._support.files.writing import make_folder, picture_files, result_set, save_figures
from .plot import (
    band_of,
    named,
    plot_convergence,
    plot_loop,
    plot_time,
    what_was_fitted,
    what_was_shown,
)

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from matplotlib.figure import Figure

    from ...data.dataset import Dataset
    from ...stages.motion import Response
    from ..fitted.identification import Identification
    from ..fitted.identified_model import IdentifiedModel

__all__ = ["identification_files", "save_identification", "shown_figures"]


def identification_files(name: str, *, searched: bool, records: int = 1) -> list[str]:
    """Return the names of the files that `save_identification` writes.

    Parameters
    ----------
    name : str
        Beginning of the file names.
    searched : bool
        Whether the model is searched.
    records : int, optional
        Number of records.

    Returns
    -------
    list of str
        The model and its pictures.
    """
    pictures = [f"{panel}{_nth(i)}" for i in range(records) for panel in ("loop", "time")]
    pictures += ["convergence"] if searched else []
    return [f"{name}.json", *picture_files(*(f"{name}_{picture}" for picture in pictures))]


def _nth(i: int) -> str:
    """End of the names of a record's pictures: nothing for the first."""
    return f"_{i + 1}" if i else ""


def save_identification(
    fit: Identification,
    folder: str | os.PathLike[str],
    *,
    name: str | None = None,
    shown: Dataset | None = None,
) -> list[Path]:
    """Write the model and its pictures.

    Parameters
    ----------
    fit : Identification
        Result of an identification.
    folder : path-like
        Folder to write to; created if it does not exist.
    name : str, optional
        Beginning of the file names; by default the name of the model.
    shown : Dataset, optional
        A longer record that the pictures show, with the end of the fit marked; of a fit of one
        record.

    Returns
    -------
    list of pathlib.Path
        ``{name}.json``, and as PNG and SVG ``{name}_loop``, ``{name}_time`` and, after a
        search, ``{name}_convergence``; of a second record ``{name}_loop_2`` and ``{name}_time_2``.
    """
    name = fit.model.info.name if name is None else name
    until = None if shown is None else float(fit.data.t[-1])
    figures: dict[str, Figure] = {}
    for i, record in enumerate(fit.records):
        data = record.data if shown is None else shown
        if data is None:
            continue
        run = fit.simulate(data, offset=record.offset)
        title = what_was_fitted(fit, record)
        drawn = _figures(fit, data, run, title, stroke=record.stroke, fitted_until=until)
        figures |= {f"{name}_{panel}{_nth(i)}": one for panel, one in drawn.items()}
    if fit.model.info.searched:
        converged = plot_convergence(fit, title=named(fit, fit.data))
        figures[f"{name}_convergence"] = whole(converged.figure)
    with result_set(make_folder(folder)) as path:
        return [fit.save(path / f"{name}.json"), *save_figures(figures, path)]


def shown_figures(model: IdentifiedModel, data: Dataset) -> dict[str, Figure]:
    """Draw loop and displacement of a model on any record, in figures of their own."""
    run = model.simulate(data)
    return _figures(model, data, run, what_was_shown(model, data, run), stroke=model.stroke)


def _figures(
    model: IdentifiedModel, data: Dataset, run: Response, title: str, **options: Any
) -> dict[str, Figure]:
    above, _ = plot_time(data, run, half=band_of(model, data), title=title, **options)
    loop = plot_loop(data, run, title=title)
    return {"loop": whole(loop.figure), "time": whole(above.figure)}
