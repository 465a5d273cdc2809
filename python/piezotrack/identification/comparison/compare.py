"""Comparison of models of one record: fitted on a part of it, scored on the rest."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from ... import _core
from ..._support.arguments import expect, has_entries, one_of
from ..._support.display.progress_parts import Parts
from ..._support.display.result import Result
from ..._support.files.writing import (
    make_folder,
    picture_files,
    result_set,
    save_figures,
    write_document,
)
from ...data.dataset import Dataset
from ...errors import Interrupted, ParameterError
from ...stages.registry import MODELS, ModelInfo, model_named
from ..fit import identify
from ..fitted.identified_model import IdentifiedModel
from ..fitted.model_entries import provenance
from ..fitted.model_file import load
from ..methods.descents import Descents
from ..methods.least_squares import LeastSquares
from .parts import parts_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..fitted.score import Score
    from ..fitted.start import History

    Array = NDArray[np.float64]

__all__ = ["Comparison", "ModelScore", "compare", "comparison_files"]

FORMAT = "piezotrack-comparison"
SCHEMA_VERSION = 1

Window = tuple[float | None, float | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelScore:
    """One model of a comparison.

    Attributes
    ----------
    name : str
        Of its files: the name of the model, or of the file that it comes from.
    title : str
        Title in the table.
    fit : Identification or IdentifiedModel
        The model; with the details of the fit if it was fitted here.
    train, test : Score
        Score on the part that was fitted, and on the one that was not; percentages refer to the
        stroke of the former.
    autocorrelation : float
        Correlation of neighbouring residuals on the fitted part: near 1 where the fit is limited by
        the model, not by noise.
    parameters : int or None
        Number of values fitted, offset included; None if the model was not fitted on this part.
    aic, bic : float or None
        Information criteria on the fitted part, for `parameters` values and a variance.
    """

    name: str
    title: str
    fit: IdentifiedModel
    train: Score
    test: Score
    autocorrelation: float
    parameters: int | None
    aic: float | None
    bic: float | None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Comparison(Result):
    """Comparison of models; see `compare`.

    Attributes
    ----------
    rows : tuple of ModelScore
        One for each model, in the order given.
    train, test : Dataset
        The part that was fitted, and the one that was not.
    carried : bool
        Whether the test part belongs to the same record, with state and offset carried over;
        otherwise it is another record, with an offset of its own.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.comparison_report:comparison_text",
        "plot": "identification.views.comparison_plot:plot_comparison",
        "html": "identification.views.comparison_report:comparison_html",
    }

    rows: tuple[ModelScore, ...]
    train: Dataset
    test: Dataset
    carried: bool

    def __repr__(self) -> str:
        scores = "; ".join(f"{row.title} {row.test.rms_percent:.3g} %" for row in self.rows)
        return f"<Comparison, rms on what was not fitted: {scores}; see summary()>"

    @property
    def best(self) -> ModelScore:
        """The model with the lowest RMS on the part that was not fitted."""
        return min(self.rows, key=lambda row: row.test.rms)

    @property
    def fits(self) -> dict[str, IdentifiedModel]:
        """The models by name."""
        return {row.name: row.fit for row in self.rows}

    @property
    def notes(self) -> list[str]:
        """Warnings: models that were fitted to a part of the test data."""
        seen = ((row, row.fit.window_on(self.test)) for row in self.rows)
        return [
            f"{row.title} was fitted on {window[0]:.6g} to {window[1]:.6g} s of "
            f"{self.test.source}, a part of its test data here"
            for row, window in seen
            if window is not None
        ]

    def followed(self, row: ModelScore, part: Literal["train", "test"]) -> Array:
        """Displacement simulated by a model on one of the two parts.

        Parameters
        ----------
        row : ModelScore
            One of `rows`.
        part : {"train", "test"}
            Which part.

        Returns
        -------
        ndarray, shape (n,)
            Displacement with the offset, and the drift, that were scored [m].
        """
        expect("row", row, ModelScore, "one of the rows")
        one_of("part", part, ("train", "test"))
        data, score = (self.train, row.train) if part == "train" else (self.test, row.test)
        own = part == "test" and not self.carried
        x: Array = row.fit.simulate(data, offset="own" if own else score.offset).x
        return x

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        where = provenance(self.train)
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "unit": "errors, offsets, strokes and spreads in m; fit_percent in %",
            "best": self.best.name,
            "carried": self.carried,
            "models": [_entry(row) for row in self.rows],
            "train": where.pop("data"),
            "test": provenance(self.test)["data"],
            "provenance": where,
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the figures as JSON, the models, and the picture.

        Parameters
        ----------
        folder : path-like
            Where to; made where it is missing.

        Returns
        -------
        list of pathlib.Path
            ``comparison.json``, ``{name}.json`` of each model, ``comparison.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        with result_set(make_folder(folder)) as path:
            return [
                write_document(path / "comparison.json", self.document()),
                *(row.fit.save(path / f"{row.name}.json") for row in self.rows),
                *save_figures({"comparison": self.plot()}, path),
            ]


def compare(
    data: Dataset,
    models: Iterable[str | os.PathLike[str] | IdentifiedModel] | None = None,
    *,
    train: Window | None = None,
    test: Window | Dataset | None = None,
    history: History | None = None,
    seed: int = 0,
    runs: int = 1,
    threads: int | None = None,
    progress: bool | None = None,
) -> Comparison:
    r"""Fit several models to one part of a record and validate them on the rest.

    The drive is simulated from the first sample of the record to the last, so that the state of the
    hysteresis is carried over from the fitted part to the test part. Over the
    n residuals :math:`e_i` of the fitted part,

    .. math::

        AIC = n \ln(RSS/n) + 2 K, \qquad BIC = n \ln(RSS/n) + K \ln n, \qquad RSS = \sum_i e_i^2

    with K the number of values fitted and one for the variance (Burnham and Anderson 2002, Model
    Selection and Multimodel Inference, 2nd edition, sections 2.2 and 6.4, doi 10.1007/b97636).
    Both assume independent residuals. Those of a hysteresis model are correlated
    (`ModelScore.autocorrelation`): the effective number of samples is smaller than n, and both
    criteria favour too many parameters. Prefer the error on the part that was not fitted.

    Parameters
    ----------
    data : Dataset
        The record.
    models : iterable, optional
        Names of models, as for `identify`, which are fitted; model files and identified models,
        which are used unchanged. By default all models for the unit of the drive: a Bouc-Wen
        oscillator is for forces, ``drive_unit="N"``.
    train : (float, float), optional
        Window to fit [s]; either end may be None. By default the first half of the record, or the
        part before `test`, or the whole record if `test` is another one.
    test : (float, float) or Dataset, optional
        Window of the same record to validate on [s], or another record. By default the part after
        `train`.
    history : {"virgin", "settled", "fit"}, optional
        What the stage went through before the record, as for `identify`.
    threads, progress : optional
        As for `identify`.
    seed, runs : optional
        As for `identify`, for the models that are searched.

    Returns
    -------
    Comparison
        Table, figures, picture and the models.

    Raises
    ------
    ParameterError
        A model is neither a name nor a file, a window is out of the record, or `train` and
        `test` overlap.
    DataError
        A record cannot be used, see `identify`; a file is not that of a model.
    Interrupted
        Ctrl-C stopped a search; `partial` is the comparison of the models before.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
    ... )
    >>> u = 37.5 * (1 - np.cos(np.arange(2000) / 100.0))
    >>> log = pt.Dataset(u=u, y=stage.simulate(u, 0.01).x, dt=0.01)
    >>> found = pt.compare(log, ["bouc-wen", "prandtl-ishlinskii"], runs=1, seed=1)
    >>> found.best.name, found.train.duration, found.test.duration
    ('prandtl-ishlinskii', 10.0, 10.0)
    """
    expect("data", data, Dataset, "a Dataset, see pt.read")
    wanted = _wanted(models, data.drive_unit)
    first, second, carried = parts_of(data, train, test)
    first, second = first.without_faulty_readings(), second.without_faulty_readings()
    method = (Descents(seed=seed, runs=runs), LeastSquares())
    rows = []
    # About how long each takes.
    parts = Parts(
        [
            (5.0 if one.searched else 1.0) if isinstance(one, ModelInfo) else 0.1
            for _, _, one in wanted
        ]
    )
    for i, (name, title, source) in enumerate(wanted):
        fitted: IdentifiedModel
        try:
            if isinstance(source, ModelInfo):
                with parts.begin(i):
                    fitted = identify(
                        first,
                        source.name,
                        history=history,
                        method=method,
                        threads=threads,
                        progress=progress,
                    )
            else:
                fitted = source
            rows.append(_compared(name, title, fitted, first, second, carried))
        except KeyboardInterrupt:
            if not rows:
                raise
            done = Comparison(rows=tuple(rows), train=first, test=second, carried=carried)
            words = f"interrupted after {len(rows)} of {len(wanted)} models"
            raise Interrupted(words, done) from None
    return Comparison(rows=tuple(rows), train=first, test=second, carried=carried)


def comparison_files(models: object, drive_unit: str) -> list[str]:
    """Return the names of the files that `Comparison.save` writes.

    Parameters
    ----------
    models : iterable or None
        As for `compare`.
    drive_unit : str
        Unit of the record's drive.

    Returns
    -------
    list of str
        The figures, the models and the picture.
    """
    named = [f"{name}.json" for name, _, _ in _wanted(models, drive_unit)]
    return ["comparison.json", *named, *picture_files("comparison")]


def _wanted(models: object, drive_unit: str) -> list[tuple[str, str, ModelInfo | IdentifiedModel]]:
    """Name, title and source of each model: one to fit, or an identified one."""
    if models is None:
        # Models driven by a voltage also fit a record driven by a force, but not the reverse.
        suited = [info for info in MODELS if info.drive_unit in ("V", drive_unit)]
        return [(info.name, info.title, info) for info in suited]
    if isinstance(models, Mapping) or not has_entries(models):
        raise ParameterError("models", f"{models!r}", "several in a list, as ['dahl']")
    sources = [_source(model) for model in models]
    if not sources:
        raise ParameterError("models", "empty", "one or more")
    # Names of files come first, so that a model saved beside them does not take their place.
    taken = {"comparison"}
    names: dict[int, str] = {}
    for i in sorted(range(len(sources)), key=lambda i: sources[i][0] is None):
        file, model = sources[i]
        names[i] = _unused(file or _info(model).name, taken)
        taken.add(names[i])
    return [
        (names[i], _title(_info(model), names[i]), model) for i, (_, model) in enumerate(sources)
    ]


def _info(model: ModelInfo | IdentifiedModel) -> ModelInfo:
    """Return the model that is to be fitted, or that an identified one is of."""
    info: ModelInfo = model if isinstance(model, ModelInfo) else model.model.info
    return info


def _title(info: ModelInfo, name: str) -> str:
    """Title of a row: that of the model, and the name if it is not that of the model."""
    if name.startswith(info.name):
        return info.title + name.removeprefix(info.name).replace("-", " ")
    return f"{info.title} ({name})"


def _unused(name: str, taken: set[str]) -> str:
    """Append a number to a name that is taken."""
    free = (f"{name}-{i}" for i in range(2, len(taken) + 3))
    return next(one for one in (name, *free) if one not in taken)


def _source(model: object) -> tuple[str | None, ModelInfo | IdentifiedModel]:
    """Name of the file, if any, and the model that an entry of `models` stands for."""
    if isinstance(model, IdentifiedModel):
        return None, model
    if isinstance(model, (str, os.PathLike)):
        for info in MODELS:
            if info.name == model:
                return None, info
        if Path(model).suffix == ".json":
            return Path(model).stem, load(model)
        try:
            model_named(str(model))
        except ParameterError as error:
            words = str(error).removeprefix("model is ")
            words = f"models has {words}; or the JSON file of a model"
            raise ParameterError(words, argument="models") from None
    raise ParameterError(
        "models",
        f"'{type(model).__name__}'",
        "names of models, JSON files of models, or identified models",
        verb="has",
    )


def _compared(
    name: str, title: str, fit: IdentifiedModel, train: Dataset, test: Dataset, carried: bool
) -> ModelScore:
    """Score a model on both parts."""
    here = fit.fitted_on(train)
    score = fit.score(train, offset=fit.offset if here else "own")
    error = train.counted(train.y - fit.simulate(train, offset=score.offset).x)
    count = fit.free_count if here else None
    _, _, autocorrelation, aic, bic = _core.residual(error, count or 0)
    tested = fit.score(test, offset=score.offset if carried else "own")
    return ModelScore(
        name=name,
        title=title,
        fit=fit,
        train=replace(score, stroke=train.stroke),
        test=replace(tested, stroke=train.stroke),
        autocorrelation=autocorrelation,
        parameters=count,
        aic=None if count is None else aic,
        bic=None if count is None else bic,
    )


def _entry(row: ModelScore) -> dict[str, Any]:
    """Content of the JSON file for one model."""
    return {
        "name": row.name,
        "title": row.title,
        "model": row.fit.model.info.name,
        "train": {**asdict(row.train), "fit_percent": row.train.fit_percent},
        "test": {**asdict(row.test), "fit_percent": row.test.fit_percent},
        "parameters": row.parameters,
        "aic": row.aic,
        "bic": row.bic,
        "autocorrelation": row.autocorrelation,
    }
