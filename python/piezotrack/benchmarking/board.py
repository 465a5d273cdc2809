"""`benchmark`: models times records, each fitted by its default call and judged alike."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from .. import _core
from .._support.display.progress_bar import ProgressBar
from .._support.display.result import Result
from .._support.files.writing import (
    json_ready,
    make_folder,
    picture_files,
    replacing,
    result_set,
    save_figures,
    write_document,
)
from .._support.messages import quoted
from ..errors import ParameterError
from .board_files import BoardFolder
from .contenders import contenders_named
from .records import records_named
from .scoring import result_of

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from .contender import Contender
    from .record import BenchmarkRecord

__all__ = ["Benchmark", "BenchmarkResult", "Inverted", "PartScore", "benchmark", "board_files"]

FORMAT = "piezotrack-benchmark"
SCHEMA_VERSION = 1
NAME = "benchmark"


@dataclass(frozen=True, kw_only=True)
class PartScore:
    """Error of a model on one part of a record.

    Attributes
    ----------
    part : str
        ``"fitted"``, ``"rest"``, or what another record is.
    rms, max_error : float
        Root mean square and largest absolute error [m].
    rms_percent : float
        `rms` in per cent of the stroke of the part fitted.
    """

    part: str
    rms: float
    max_error: float
    rms_percent: float


@dataclass(frozen=True, kw_only=True)
class Inverted:
    """Error of a model's own inverse on one part of a record.

    Attributes
    ----------
    part : str
        Which part.
    drive_rms : float
        Rms of its drive for the measured displacement less the drive that was recorded [V].
    drive_percent : float
        The same in per cent of the drive's range.
    identity_rms : float
        Rms of what the model makes of that drive, less the displacement asked for [m].
    error : str or None
        Why there is none, in a sentence; the figures are then NaN.
    """

    part: str
    drive_rms: float = math.nan
    drive_percent: float = math.nan
    identity_rms: float = math.nan
    error: str | None = None


@dataclass(frozen=True, kw_only=True)
class BenchmarkResult:
    """One model on one record.

    Attributes
    ----------
    record, model : str
        Their names.
    record_title, title : str
        Their titles.
    noise : float
        Noise of the record where it is known, else NaN [m].
    stroke : float
        Stroke of the part fitted [m].
    seconds : float
        Time that the fit took.
    values : int or None
        Number of values fitted.
    chosen : str
        Model that a choice between models made.
    parts : tuple of PartScore
        Errors, those of the part fitted first; empty where the model does not suit.
    inverse : Inverted or None
        Error of the inverse.
    parameters : dict
        True and found values of parameters, and their difference in per cent, where the stage is
        made up and the model has them.
    error : str or None
        Why there is no fit, in a sentence.
    """

    record: str
    model: str
    record_title: str
    title: str
    noise: float
    stroke: float
    seconds: float
    values: int | None
    chosen: str
    parts: tuple[PartScore, ...]
    inverse: Inverted | None
    parameters: Mapping[str, Mapping[str, float]]
    error: str | None

    @property
    def judged(self) -> PartScore | None:
        """The part that a model is judged by: the last one, farthest from what was fitted."""
        return self.parts[-1] if self.parts else None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Benchmark(Result):
    """Results of a benchmark; printed, a table for each record.

    Attributes
    ----------
    results : tuple of BenchmarkResult
        Record by record.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "benchmarking.views.board_table:board_text",
        "markdown": "benchmarking.views.board_table:board_markdown",
        "plot": "benchmarking.views.board_plot:plot_board",
    }

    results: tuple[BenchmarkResult, ...]

    def __repr__(self) -> str:
        return f"<Benchmark of {len(self.results)} results; see summary()>"

    def of(self, record: str) -> list[BenchmarkResult]:
        """Return the results of a record, the best on its last part first.

        Parameters
        ----------
        record : str
            Name of the record.

        Returns
        -------
        list of BenchmarkResult
            Those without a fit come last.

        Raises
        ------
        ParameterError
            There is no such record.
        """
        results = [one for one in self.results if one.record == record]
        if not results:
            known = ", ".join(map(repr, dict.fromkeys(one.record for one in self.results)))
            raise ParameterError("record", quoted(record), f"one of {known}")
        return sorted(results, key=lambda one: one.judged.rms if one.judged else math.inf)

    @property
    def records(self) -> list[str]:
        """Names of the records, in their order."""
        return list(dict.fromkeys(one.record for one in self.results))

    def markdown(self) -> str:
        """Return the tables for a page.

        Returns
        -------
        str
            Markdown.
        """
        text: str = self.view("markdown")(self)
        return text

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "version": _core.__version__,
            "unit": "errors, strokes and noise in m; times in s; drives in the unit of the record",
            "results": [asdict(one) for one in self.results],
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the tables, the picture and the figures to a folder, together.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.

        Returns
        -------
        list of pathlib.Path
            ``benchmark.md``, ``benchmark.json``, ``benchmark.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        with result_set(make_folder(folder)) as path:
            page = path / f"{NAME}.md"
            with replacing(page) as temporary:
                temporary.write_text(self.markdown() + "\n", encoding="utf-8")
            return [
                page,
                write_document(path / f"{NAME}.json", self.document()),
                *save_figures({NAME: self.plot()}, path),
            ]


def board_files() -> list[str]:
    """Return the names of the files that `Benchmark.save` writes."""
    return [f"{NAME}.md", f"{NAME}.json", *picture_files(NAME)]


def benchmark(
    records: Iterable[str | BenchmarkRecord] | None = None,
    models: Iterable[str] | None = None,
    *,
    folder: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    progress: bool | None = None,
) -> Benchmark:
    """Fit models to records by their default calls, and judge them on what was not fitted.

    A model is fitted to one part of a record and judged on another part of it, to which state and
    offset are carried over, and on other records, each with an offset of its own. The inverse is
    asked for the measured displacement of a part that was not fitted, smoothed; its drive is
    compared with the recorded one, and what the model makes of that drive with what was asked.

    Other people's models take part where their package is installed and declares an entry point in
    the group ``piezotrack.models``: a function ``fit(u, y, dt)`` that returns
    ``predict(u, dt) -> x``, or such a ``predict``.

    Parameters
    ----------
    records : iterable of str or BenchmarkRecord, optional
        Names of records of the package, and your own; all of the package where not given.
    models : iterable of str, optional
        Names of models, ``"auto"`` for ``pt.identify(log)``; by default all that suit the unit of
        a record's drive.
    folder : path-like, optional
        Folder with one file for each result, in ``results``. Those of the same record that it has
        are kept.
    overwrite : bool, optional
        Whether they are computed again.
    progress : bool, optional
        As for `identify`.

    Returns
    -------
    Benchmark
        The results; printed, a table.

    Raises
    ------
    ParameterError
        A name is not one of those listed, or `overwrite` is given without a folder.
    DataError
        The folder cannot be written to or read.
    Interrupted
        Ctrl-C stopped a search; the results before it are in the folder.

    Examples
    --------
    >>> import piezotrack as pt
    >>> board = pt.benchmark(["asymmetry"], ["prandtl-ishlinskii", "plays-nnls"])
    >>> board.of("asymmetry")[0].model
    'prandtl-ishlinskii'
    """
    if overwrite and folder is None:
        raise ParameterError("overwrite", "True without a folder", "a folder too")
    contenders, judged = contenders_named(models), records_named(records)
    kept = None if folder is None else BoardFolder(Path(folder))
    pairs = [
        (record, contender)
        for record in judged
        for contender in contenders
        if models is not None or contender.suits(record)
    ]
    results = []
    with ProgressBar(progress, "benchmark") as bar:
        for done, (record, contender) in enumerate(pairs):
            document = None
            if kept is not None and not overwrite:
                document = kept.result(record, contender)
            if document is None:
                bar.step(done, len(pairs), f"{len(pairs)}: {record.title}, {contender.title}")
                document = json_ready(result_of(contender, record))
                if kept is not None:
                    kept.store(record, contender, document)
            results.append(_read(document, record, contender))
    return Benchmark(results=tuple(results))


def _number(value: object) -> float:
    """Return a number of a file, whose NaN is null."""
    return float(value) if isinstance(value, (int, float)) else math.nan


def _read(
    document: Mapping[str, Any], record: BenchmarkRecord, contender: Contender
) -> BenchmarkResult:
    """Make a result of the content of its file, under the titles of today."""
    inverse = document.get("inverse")
    return BenchmarkResult(
        record=record.name,
        model=contender.name,
        record_title=record.title,
        title=contender.title,
        noise=math.nan if record.noise is None else record.noise,
        stroke=record.fitted.stroke,
        seconds=_number(document.get("seconds")),
        values=document.get("values"),
        chosen=document.get("chosen") or "",
        parts=tuple(
            PartScore(
                part=part["part"],
                rms=_number(part["rms_m"]),
                max_error=_number(part["max_error_m"]),
                rms_percent=_number(part["rms_percent"]),
            )
            for part in document.get("parts") or ()
        ),
        inverse=None
        if inverse is None
        else Inverted(
            part=inverse["part"],
            drive_rms=_number(inverse.get("drive_rms")),
            drive_percent=_number(inverse.get("drive_percent")),
            identity_rms=_number(inverse.get("identity_rms_m")),
            error=inverse["error"],
        ),
        parameters=document.get("parameters") or {},
        error=document["error"],
    )
