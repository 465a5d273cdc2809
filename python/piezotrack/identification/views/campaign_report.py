"""The table of a campaign, as text and as a notebook shows it."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING

from ..._support.display.table import Column, Table, words
from ..campaigns.result import size_of

if TYPE_CHECKING:
    from ..campaigns.result import Campaign, TaskResult

__all__ = ["campaign_html", "campaign_text"]

# Lines of the table, and of tasks without a model.
MOST_ROWS, MOST_FAILED = 60, 20
COLUMNS = (
    *(Column(head, left=True) for head in ("record", "model")),
    Column("seeds", before=3),
    *(Column(head, "%", before=3) for head in ("lowest rms", "median", "highest")),
    Column("agree", before=3),
    Column("model found", before=3, left=True),
)
SINGLE = (*COLUMNS[:2], Column("rms", "%", before=3), COLUMNS[-1])
SEEDS = """\
lowest, median and highest of the seeds; agree: how many seeds end within 0.1 % of the lowest;
-: one result alone, as of least squares, which need no seed."""
NOTES = """\
rms: error on the data that were fitted, in % of their stroke. More parameters make it smaller: to
choose a model, judge models on other data (compare)."""


def campaign_text(campaign: Campaign) -> str:
    """Write a campaign as a table.

    Parameters
    ----------
    campaign : Campaign
        The results.

    Returns
    -------
    str
        Several lines.
    """
    lines = [_heading(campaign), "", *_table(campaign).lines()]
    if (more := len(campaign.groups) - MOST_ROWS) > 0:
        lines.append(f"  and {more} more rows: to_frame() has them all")
    failed = _failed(campaign)
    lines += ["", *(f"failed  {name}: {error}" for name, error in failed[:MOST_FAILED])]
    if (more := len(failed) - MOST_FAILED) > 0:
        lines.append(f"failed  {more} more")
    if failed:
        lines += ["The same call tries these again.", ""]
    if noted := sum(bool(one.notes) for one in campaign):
        lines.append(
            f"{noted} of {len(campaign)} results have warnings: notes of each, and in its file"
        )
    return "\n".join([*lines, NOTES, *([SEEDS] if _several(campaign) else [])])


def campaign_html(campaign: Campaign) -> str:
    """Write a campaign as a table of HTML, with the tasks without a model below."""
    tables = [_table(campaign)]
    if failed := _failed(campaign):
        tables.append(words("Tasks without a model", failed[:MOST_FAILED]))
    return "".join(table.html() for table in tables)


def _table(campaign: Campaign) -> Table:
    rows = [_row(*key, group) for key, group in list(campaign.groups.items())[:MOST_ROWS]]
    if _several(campaign):
        return Table(COLUMNS, rows, _heading(campaign))
    return Table(SINGLE, [(*row[:2], row[3], row[-1]) for row in rows], _heading(campaign))


def _several(campaign: Campaign) -> bool:
    """Whether a model was found with several seeds."""
    return any(len(group) > 1 for group in campaign.groups.values())


def _agreeing(group: list[TaskResult]) -> int:
    """Count the seeds within 0.1 % of the lowest cost; those below 0.001 % of stroke are equal."""
    costs = [one.rms_percent for one in group if one.error is None]
    return sum(cost <= max(1.001 * min(costs), 1e-3) for cost in costs)


def _heading(campaign: Campaign) -> str:
    return f"campaign in {campaign.folder}: {size_of(campaign)}"


def _row(record: str, model: str, group: list[TaskResult]) -> tuple[str, ...]:
    """Write the seeds of one record and model."""
    fitted = [one for one in group if one.error is None]
    count = "-" if group[0].seed is None else str(len(group))
    if not fitted:
        return record, model, count, "-", "-", "-", "0", "no model"
    costs = [one.rms_percent for one in fitted]
    if len(group) == 1:
        # Nothing to compare it with.
        return record, model, count, f"{costs[0]:.4g}", "-", "-", "-", fitted[0].kind or ""
    models = ", ".join(sorted({one.kind or "" for one in fitted}))
    figures = (f"{value:.4g}" for value in (min(costs), median(costs), max(costs)))
    return record, model, count, *figures, str(_agreeing(group)), models


def _failed(campaign: Campaign) -> list[tuple[str, str]]:
    """Name the tasks without a model, and say why; seeds that failed alike in one line."""
    seeds: dict[tuple[str, str, str], list[str]] = {}
    for task in campaign.failed:
        alike = seeds.setdefault((task.record, task.model, task.error or ""), [])
        if task.seed is not None:
            alike.append(str(task.seed))
    return [
        (f"{record}, {model}" + (f", seed {', '.join(some)}" if some else ""), error)
        for (record, model, error), some in seeds.items()
    ]
