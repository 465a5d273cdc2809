"""The report of the reproduction: Markdown with its pictures beside it, and JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..._support.files.writing import (
    make_folder,
    picture_files,
    replacing,
    result_set,
    save_figures,
    write_document,
)
from ..apparatus import calibration_file
from ..experiments.references import RULES
from ..published import observables
from ..reproduction import REPORT
from .figures import drawn
from .report_text import number, place, reading, seen, tally

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from ..reproduction import Reproduction
    from .figures import Drawn

__all__ = ["markdown", "save_report"]


def save_report(reproduction: Reproduction, folder: str | os.PathLike[str]) -> list[Path]:
    """Write report and pictures; arguments, result and errors as of `Reproduction.save`."""
    figures = drawn(reproduction.experiments, reproduction.drives)
    text = markdown(reproduction, figures)
    with result_set(make_folder(folder)) as path:
        report, document = (path / name for name in REPORT)
        with replacing(report) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")
        write_document(document, reproduction.document())
        return [report, document, *save_figures({one.name: one.figure for one in figures}, path)]


def markdown(reproduction: Reproduction, figures: Sequence[Drawn]) -> str:
    """Write the report; the pictures are files beside it.

    Parameters
    ----------
    reproduction : Reproduction
        The numbers.
    figures : sequence of Drawn
        The pictures, in their order.

    Returns
    -------
    str
        Markdown.
    """
    parts = [
        "# Xu and Li 2010: published and obtained",
        "Dahl model-based hysteresis compensation of an XY micromanipulator, "
        "[doi 10.1115/1.4001712](https://doi.org/10.1115/1.4001712), on a virtual stage: no "
        "measured data of the paper's stage is public. The controllers see readings at 50 Hz with "
        "noise and quantisation, and errors are computed from these, as in the paper; the true "
        "errors are listed too.",
        *_numbers(reproduction),
        *_conclusions(reproduction),
        f"## Figures\n\nOf the first seed, {reproduction.seeds[0]}.",
        *(_figure(one) for one in figures),
        *_beyond(reproduction),
        *_stage(reproduction),
    ]
    return "\n\n".join(parts) + "\n"


def _numbers(reproduction: Reproduction) -> list[str]:
    rows = []
    for row in reproduction.obtained:
        known, true = row.observable, reproduction.true_median(row.observable.key)
        low, high = row.quartiles
        rows.append(
            [
                f"{known.name}, {known.unit}" if known.unit else known.name,
                reading(row),
                f"**{number(row, row.median)}**",
                f"{row.ratio:.2f}",
                "yes" if row.reached else "**no**",
                known.label,
                f"{number(row, low)} to {number(row, high)}",
                "" if true is None else number(row, true),
                place(row),
            ]
        )
    heads = ("quantity", "published", "obtained", "ratio", "reached", "use", "quartiles", "true")
    return ["## Numbers", *tally(reproduction), _table((*heads, "in"), rows)]


def _conclusions(reproduction: Reproduction) -> list[str]:
    rows = [
        [
            conclusion.text,
            f"**{seen(conclusion.holds)}**",
            f"{conclusion.seen} of {conclusion.seeds}",
            conclusion.words,
        ]
        for conclusion in reproduction.conclusions
    ]
    return ["## Conclusions", _table(("conclusion of the paper", "", "runs", "obtained"), rows)]


def _figure(drawing: Drawn) -> str:
    picture = picture_files(drawing.name)[0]
    return f"### {drawing.title}\n\n![{drawing.title}]({picture})\n\n{drawing.caption}"


def _beyond(found: Reproduction) -> list[str]:
    parts = ["## Beyond the paper", "On the same stage, with one seed of the sensors."]
    for section in found.sections:
        parts += [f"### {section.title}", section.text, _table(section.heads, section.rows)]
    return parts


def _stage(found: Reproduction) -> list[str]:
    parts = found.apparatus.document()
    rows = [
        [name.replace("_", " "), _short(value), _short(parts["y"][name])]
        for name, value in parts["x"].items()
    ]
    xy, yx = parts["cross_talk"]
    return [
        "## The stage",
        calibration_file()["provenance"]["how"],
        f"Lag of y {1e3 * parts['lag']:.3g} ms, chance of a missed tick "
        f"{100 * parts['missed_ticks']:.3g} %, delay {1e3 * parts['delay']:.3g} ms, mean sampling "
        f"jitter {1e3 * parts['jitter']:.2g} ms, cross-talk {100 * xy:.3g} % and {100 * yx:.3g} %. "
        "SI units:",
        _table(("parameter", "x", "y"), rows),
        *_calibration(),
        "Rules for quantities that the paper does not state, written down before any calibration:",
        "\n".join(f"- Fig. {key}: {text}" for key, text in RULES.items()),
    ]


def _calibration() -> list[str]:
    """Table of the free parameters and the observables most sensitive to them."""
    named = {one.key: one.name for one in observables()}
    rows = [
        [
            one["meaning"],
            _short(one["value"]) + (", on a bound" if _on_a_bound(one) else ""),
            f"{_short(one['bounds'][0])} to {_short(one['bounds'][1])}",
            "; ".join(f"{named[key]} {change:+.1f}" for key, change in one["moves"].items()),
        ]
        for one in calibration_file()["free"]
    ]
    return [
        "### Free parameters against observables",
        "Last column: the three numbers most sensitive to each parameter, and their change in "
        "units of the tolerance, 15 % or 0.04 µm, for 5 % of its range. SI units.",
        _table(("parameter", "found", "bounds", "sensitivities"), rows),
    ]


def _on_a_bound(one: Mapping[str, Any]) -> bool:
    low, high = one["bounds"]
    return bool(min(one["value"] - low, high - one["value"]) < 1e-3 * (high - low))


def _short(value: object) -> str:
    if isinstance(value, (tuple, list)):
        return ", ".join(_short(one) for one in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(" | ".join(("", *map(_cell, line), "")).strip() for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
