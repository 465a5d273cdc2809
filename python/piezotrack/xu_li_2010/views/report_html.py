"""The report as one self-contained HTML file: tables, inline SVG, a script to zoom."""

from __future__ import annotations

from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from ..._support.page.html import svg_text
from ..apparatus import calibration_file
from ..experiments.references import RULES
from ..published import observables
from .report_text import number, place, reading, seen, tally

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from ..reproduction import Reproduction
    from .figures import Drawn

__all__ = ["html_text"]


def html_text(reproduction: Reproduction, figures: Sequence[Drawn]) -> str:
    """Write the page.

    Parameters
    ----------
    reproduction : Reproduction
        The numbers.
    figures : sequence of Drawn
        The pictures, in their order.

    Returns
    -------
    str
        HTML including style, pictures and script.
    """
    package = files(__package__)
    style = package.joinpath("report.css").read_text(encoding="utf-8")
    script = package.joinpath("report.js").read_text(encoding="utf-8")
    body = [
        "<h1>Xu and Li 2010: published and obtained</h1>",
        "<p>Dahl model-based hysteresis compensation of an XY micromanipulator, doi "
        '<a href="https://doi.org/10.1115/1.4001712">10.1115/1.4001712</a>, on a virtual stage: '
        "no measured data of the paper's stage is public. The controllers see readings at 50 Hz "
        "with noise and quantisation, and errors are computed from these, as in the paper; the "
        "true errors are listed too.</p>",
        *_numbers(reproduction),
        *_conclusions(reproduction),
        "<h2>Figures</h2>",
        f"<p>Of the first seed, {reproduction.seeds[0]}. Zoom with the buttons, a double click or "
        "Ctrl and the wheel; then drag to move.</p>",
        *(_figure(one) for one in figures),
        *_beyond(reproduction),
        *_stage(reproduction),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>Xu and Li 2010, reproduced</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f"{chr(10).join(body)}\n<script>\n{script}</script>\n</body>\n</html>\n"
    )


def _numbers(reproduction: Reproduction) -> list[str]:
    rows = []
    for row in reproduction.obtained:
        known, true = row.observable, reproduction.true_median(row.observable.key)
        low, high = row.quartiles
        unit = f", {known.unit}" if known.unit else ""
        cells = [
            f'<span title="{escape(known.how)}">{escape(known.name + unit)}</span>',
            reading(row),
            f"<b>{number(row, row.median)}</b>",
            f"{row.ratio:.2f}",
            "yes" if row.reached else "<b>no</b>",
            known.label,
            f"{number(row, low)} to {number(row, high)}",
            "" if true is None else number(row, true),
            escape(place(row)),
        ]
        rows.append(cells)
    heads = (
        "quantity",
        "published",
        "obtained",
        "ratio",
        "reached",
        "use",
        "quartiles",
        "true",
        "in",
    )
    return [
        "<h2>Numbers</h2>",
        *(f"<p>{escape(line)}</p>" for line in tally(reproduction)),
        f'<div class="numbers">{table(heads, rows)}</div>',
    ]


def _conclusions(reproduction: Reproduction) -> list[str]:
    rows = [
        [
            escape(conclusion.text),
            f"<b>{seen(conclusion.holds)}</b>",
            f"{conclusion.seen} of {conclusion.seeds}",
            escape(conclusion.words),
        ]
        for conclusion in reproduction.conclusions
    ]
    return [
        "<h2>Conclusions</h2>",
        table(("conclusion of the paper", "", "runs", "obtained"), rows),
    ]


def _beyond(found: Reproduction) -> list[str]:
    parts = ["<h2>Beyond the paper</h2>", "<p>On the same stage, with one seed of the sensors.</p>"]
    for section in found.sections:
        rows = [[escape(cell) for cell in row] for row in section.rows]
        parts += [
            f"<h3>{escape(section.title)}</h3>",
            f"<p>{escape(section.text)}</p>",
            table(map(escape, section.heads), rows),
        ]
    return parts


def _stage(found: Reproduction) -> list[str]:
    parts = found.apparatus.document()
    rows = [
        [escape(name.replace("_", " ")), escape(_short(value)), escape(_short(parts["y"][name]))]
        for name, value in parts["x"].items()
    ]
    xy, yx = parts["cross_talk"]
    rules = "".join(f"<li>Fig. {key}: {escape(text)}</li>" for key, text in RULES.items())
    return [
        "<h2>The stage</h2>",
        f"<p>{escape(calibration_file()['provenance']['how'])}</p>",
        f"<p>Lag of y {1e3 * parts['lag']:.3g} ms, chance of a missed tick "
        f"{100 * parts['missed_ticks']:.3g} %, delay {1e3 * parts['delay']:.3g} ms, "
        f"mean sampling jitter {1e3 * parts['jitter']:.2g} ms, cross-talk "
        f"{100 * xy:.3g} % and {100 * yx:.3g} %. SI units:</p>",
        table(("parameter", "x", "y"), rows),
        *_calibration(),
        "<p>Rules for quantities that the paper does not state, written down before any "
        f"calibration:</p><ul>{rules}</ul>",
    ]


def _calibration() -> list[str]:
    """Table of the free parameters and the observables most sensitive to them."""
    named = {one.key: one.name for one in observables()}
    rows = [
        [
            escape(parameter["meaning"]),
            _short(parameter["value"]) + (", on a bound" if _on_a_bound(parameter) else ""),
            f"{_short(parameter['bounds'][0])} to {_short(parameter['bounds'][1])}",
            escape(
                "; ".join(
                    f"{named[key]} {change:+.1f}" for key, change in parameter["moves"].items()
                )
            ),
        ]
        for parameter in calibration_file()["free"]
    ]
    return [
        "<h3>Free parameters against observables</h3>",
        "<p>Last column: the three numbers most sensitive to each parameter, and their change in "
        "units of the tolerance, 15 % or 0.04 um, for 5 % of its range. SI units.</p>",
        table(("parameter", "found", "bounds", "sensitivities"), rows),
    ]


def _on_a_bound(one: Mapping[str, Any]) -> bool:
    low, high = one["bounds"]
    return bool(min(one["value"] - low, high - one["value"]) < 1e-3 * (high - low))


def _short(value: object) -> str:
    if isinstance(value, (tuple, list)):
        return ", ".join(_short(one) for one in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def table(heads: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table that scrolls horizontally on a narrow page; cells are HTML."""
    head = "".join(f"<th>{one}</th>" for one in heads)
    body = "\n".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead>\n{body}</table></div>'


def _figure(drawing: Drawn) -> str:
    return (
        f'<figure id="{drawing.name}"><h3>{escape(drawing.title)}</h3>\n'
        f'<div class="picture">{svg_text(drawing.figure, drawing.name)}</div>\n'
        f"<figcaption>{escape(drawing.caption)}</figcaption></figure>"
    )
