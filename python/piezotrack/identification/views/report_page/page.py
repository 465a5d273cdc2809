"""The report of a stage: its sections, in one file."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING

from ...._support.arguments import expect
from ...._support.display.result import Result
from ...._support.page.file import page_file, write_page
from ...._support.page.parts import Page
from . import sections
from .again import again_section

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from ...fitted.identification import Identification

__all__ = ["report_page", "write_report"]


def write_report(
    fit: Identification,
    path: str | os.PathLike[str],
    *,
    controller: Result | None = None,
    suggestion: Result | None = None,
    date: datetime.date | None = None,
    command: str | None = None,
) -> Path:
    """Write the report; arguments, result and errors as of `Identification.report`.

    Parameters
    ----------
    command : str, optional
        The command that made the fit.
    """
    page_file("path", path)
    page = report_page(
        fit, controller=controller, suggestion=suggestion, date=date, command=command
    )
    return write_page(page, path)


def report_page(
    fit: Identification,
    *,
    controller: Result | None = None,
    suggestion: Result | None = None,
    date: datetime.date | None = None,
    command: str | None = None,
) -> Page:
    """Make the content of the report; arguments as of `write_report`."""
    if controller is not None:
        expect("controller", controller, Result, "a result, as of pt.tune")
    if suggestion is not None:
        expect("suggestion", suggestion, Result, "a result, as of pt.suggest_drive")
    if date is not None:
        expect("date", date, datetime.date, "a datetime.date")
    day = datetime.date.today() if date is None else date
    found = [
        sections.overview(fit),
        sections.records(fit),
        sections.motion(fit),
        sections.residual(fit),
        sections.parameters(fit),
        sections.verdicts(fit),
        sections.search(fit),
        sections.suggestion(suggestion),
        sections.controller(controller),
        again_section(fit, command),
    ]
    sources = [one.data.source or "a record" for one in fit.records if one.data is not None]
    named = ", ".join(dict.fromkeys(sources))
    return Page(
        f"Stage identified from {named}",
        f"{fit.model.info.title}, {day:%Y-%m-%d}",
        tuple(one for one in found if one is not None),
    )
