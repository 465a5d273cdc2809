"""Reproduction of the paper over several seeds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._support.display.progress_bar import ProgressBar
from .._support.display.result import Result
from .._support.two_threads import one_by_one, two_threads
from ..errors import ParameterError
from .apparatus import Apparatus, calibration_file
from .conclusions import Conclusion, conclusions
from .experiments.references import RULES
from .extensions import sections
from .measured_log import Drives, drives
from .published import SI, Obtained, gathered
from .run import Experiments, run_experiments

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from .section import Section

__all__ = ["REPORT", "Reproduction", "reproduce"]

SEEDS = 20
# The calibration uses seeds below this, and no report does.
FIRST_SEED = 1000
FORMAT, SCHEMA_VERSION = "piezotrack-reproduction", 1
# Files of the report, beside its pictures.
REPORT = ("report.md", "report.json")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Reproduction(Result):
    """Published and obtained numbers and figures of the paper; see `reproduce`.

    Attributes
    ----------
    experiments : Experiments
        Experiments of the first seed, shown in the figures.
    values, true_values : tuple of dict
        Obtained values for each seed, SI, from the readings and from the true displacement.
    seeds : tuple of int
        Seeds of the sensors and searches.
    apparatus : Apparatus
        The stage and the timing of its controller.
    sections : tuple of Section
        Results beyond the paper.
    drives : Drives or None
        Drives of a measured log, if one was given.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "xu_li_2010.views.report_text:summary_text",
        "plot": "xu_li_2010.views.figures:plot_reproduction",
        "report": "xu_li_2010.views.report:save_report",
    }

    experiments: Experiments
    values: tuple[dict[str, float], ...]
    true_values: tuple[dict[str, float], ...]
    seeds: tuple[int, ...]
    apparatus: Apparatus
    sections: tuple[Section, ...]
    drives: Drives | None

    def __repr__(self) -> str:
        counted = [one for one in self.obtained if one.observable.use != "derived"]
        reached = sum(one.reached for one in counted)
        return f"<Reproduction, {reached} of {len(counted)} numbers reached>"

    @property
    def obtained(self) -> tuple[Obtained, ...]:
        """Every published number with the obtained values, in the order of the paper."""
        return gathered(self.values)

    @property
    def conclusions(self) -> tuple[Conclusion, ...]:
        """Conclusions of the paper, checked."""
        return conclusions(self.values)

    def true_median(self, key: str) -> float | None:
        """Median of the true values of an observable.

        Parameters
        ----------
        key : str
            Key of the observable.

        Returns
        -------
        float or None
            SI; None where the observable is not one of closed-loop motion.
        """
        if key not in self.true_values[0]:
            return None
        return float(np.median([one[key] for one in self.true_values]))

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Numbers, strings, lists and dicts only.
        """
        entries = []
        for one in self.obtained:
            entry, true = one.document(), self.true_median(one.observable.key)
            entry["true_median"] = None if true is None else true / SI[one.observable.unit]
            entries.append(entry)
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "source": "Xu and Li 2010, doi 10.1115/1.4001712",
            "rules": RULES,
            "observables": entries,
            "conclusions": [
                {
                    "text": conclusion.text,
                    "holds": conclusion.holds,
                    "seeds": [conclusion.seen, conclusion.seeds],
                    "seen": conclusion.words,
                }
                for conclusion in self.conclusions
            ],
            "beyond": [one.document() for one in self.sections],
            "apparatus": self.apparatus.document(),
            "calibration": calibration_file()["provenance"],
            "provenance": {
                "package": "piezotrack",
                "version": _core.__version__,
                "seeds": list(self.seeds),
            },
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the report as Markdown with pictures, and its numbers as JSON.

        Parameters
        ----------
        folder : path-like
            Folder; made where it is missing.

        Returns
        -------
        list of pathlib.Path
            ``report.md``, ``report.json`` and the pictures.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        written: list[Path] = self.view("report")(self, folder)
        return written


def reproduce(
    *,
    seeds: int = SEEDS,
    apparatus: Apparatus | None = None,
    dbo: str | os.PathLike[str] | None = None,
    progress: bool | None = None,
) -> Reproduction:
    """Repeat the experiments of Xu and Li 2010, doi 10.1115/1.4001712, on a simulated stage.

    Sensor at rest, step test, particle swarm, comparison with a Bouc-Wen model, feedforward, PID,
    antiwindup, repetitive control, circles: each once for every seed of the sensors' noise. The
    controllers see samples at 50 Hz with noise and quantisation, and errors are computed from
    these, as in the paper. The stage is calibrated to the published numbers.

    Parameters
    ----------
    seeds : int, optional
        Number of seeds, 1 to 1000; none of them was used in the calibration.
    apparatus : Apparatus, optional
        Another stage in place of the calibrated one.
    dbo : path-like, optional
        Folder with ``training.csv`` and ``tracking.csv`` of the measured log of a piezo stack of
        github.com/yan9a/DiscreteBacklashOperator, with times and units added: analysed in the
        same way, up to the feedforward.
    progress : bool, optional
        Whether progress is shown: a bar in a terminal or notebook, elsewhere a line on stderr
        every few seconds; where not given, the bar only.

    Returns
    -------
    Reproduction
        Published and obtained numbers, conclusions, figures.

    Raises
    ------
    ParameterError
        `seeds` is out of its range, or `apparatus` is something else.
    DataError
        A file of `dbo` is missing or is not of that log.

    Examples
    --------
    >>> import piezotrack as pt
    >>> found = pt.xu_li_2010.reproduce(seeds=1)
    >>> by_key = {one.observable.key: one for one in found.obtained}
    >>> one = by_key["back.lag"]
    >>> print(f"{one.observable.published} rad published, {one.median:.2f} obtained")
    0.063 rad published, 0.06 obtained
    """
    count = _core.as_count("seeds", seeds)
    if not 1 <= count <= 1000:
        raise ParameterError("seeds", count, "1 to 1000")
    apparatus = Apparatus.calibrated() if apparatus is None else apparatus
    if not isinstance(apparatus, Apparatus):
        kind = type(apparatus).__name__
        raise ParameterError("apparatus", kind, "a pt.xu_li_2010.Apparatus")
    chosen = tuple(range(FIRST_SEED, FIRST_SEED + count))
    # A missing file is reported before the computation.
    log = None if dbo is None else drives(dbo)
    with ProgressBar(progress, "reproduce") as bar:
        bar.step(0, 0, f"the first of {count} seeds, with its figures")
        experiments = run_experiments(apparatus, chosen[0])
        bar.step(0, 0, "results beyond the paper")
        more = sections(apparatus.seeded(chosen[0]), experiments)
        rest = _scored(apparatus, chosen[1:], bar)
    values, true = zip((experiments.values, experiments.true_values), *rest, strict=True)
    return Reproduction(
        experiments=experiments,
        values=values,
        true_values=true,
        seeds=chosen,
        apparatus=apparatus,
        sections=tuple(more if log is None else [*more, log.section()]),
        drives=log,
    )


def _scored(
    apparatus: Apparatus, seeds: Sequence[int], bar: ProgressBar
) -> list[tuple[dict[str, float], dict[str, float]]]:
    """Repeat the experiments with other seeds, and keep the numbers only."""

    def score(seed: int) -> tuple[dict[str, float], dict[str, float]]:
        experiments = run_experiments(apparatus, seed)
        return experiments.values, experiments.true_values

    runs = []
    with two_threads() as pool:
        for one in one_by_one(pool, score, seeds):
            runs.append(one)
            bar.step(1 + len(runs), 1 + len(seeds), f"{1 + len(seeds)} seeds")
    return runs
