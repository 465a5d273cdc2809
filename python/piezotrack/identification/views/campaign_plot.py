"""Picture of a campaign: the cost of every task by record, and how far seeds are apart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.display.plot_style import (
    GUIDE,
    LEVEL,
    MODELS,
    caption,
    drawing,
    heading,
    leftmost,
    legend_inside,
    literal,
    names_beside,
    sheet,
    whole,
)
from ..campaigns.result import size_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ..campaigns.result import Campaign

__all__ = ["plot_campaign"]

MARKERS = "osD^vP"
# Records of one model that are listed by their names; more are drawn along an axis.
LISTED = 6
# Records that are named beside their lines; more are numbered.
NAMED = 40
# A cost this far above the lowest is drawn, in per cent; a seed without a difference is put here.
EQUAL = 1e-3


@drawing
def plot_campaign(campaign: Campaign, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw the costs of a campaign."""
    several = any(len(group) > 1 for group in campaign.groups.values())
    if not several and len(campaign.models) == 1 and len(campaign.records) > LISTED:
        return _along(campaign, fig)
    height = 2.3 + min(0.35 * len(campaign.records), 9.0)
    names = ("costs", "apart") if several else ("costs",)
    least = 1.0 + min(0.2 * len(campaign.records), 6.0)
    figure, panel = sheet(fig, (11.0 if several else 7.5, height), (names,), least=least)
    axes = list(panel.values())
    _costs(campaign, axes[0])
    if several:
        _apart(campaign, axes[1])
    for ax in axes:
        _records(campaign, ax)
    leftmost(axes)
    caption(figure, size_of(campaign))
    handles, labels = axes[0].get_legend_handles_labels()
    if handles:
        figure.legend(
            handles, labels, loc="outside lower center", ncols=3, fontsize="small", frameon=False
        )
    return whole(figure)


def _along(campaign: Campaign, fig: Figure | SubFigure | None) -> Figure:
    """Draw the rms of one model over the records, in the order given."""
    figure, axes = sheet(fig, (7.5, 3.6), (("costs",),), least=1.9)
    ax, (model,) = axes["costs"], campaign.models
    rms = [math.nan if one.error is not None else one.rms_percent for one in campaign]
    places = np.arange(1.0, len(rms) + 1.0)
    ax.plot(places, rms, **{**_style(campaign, model), "linestyle": "-", "linewidth": 0.8})
    if campaign.failed:
        lost = [place for place, one in zip(places, rms, strict=True) if math.isnan(one)]
        ax.plot(lost, [0.0] * len(lost), "x", color="black", label="no model found", clip_on=False)
    median = float(np.nanmedian(rms)) if np.isfinite(rms).any() else 0.0
    ax.axhline(median, **LEVEL, label=f"median {median:.3g} %")
    ax.set(xlabel="record, in the order given", ylabel="rms error [% of stroke]")
    ax.set_ylim(bottom=0.0)
    ax.locator_params(axis="x", integer=True)
    legend_inside(ax)
    caption(figure, f"{literal(model)}: {size_of(campaign)}")
    return whole(figure)


def _places(campaign: Campaign) -> dict[tuple[str, str], float]:
    """Height at which the tasks of each record and model are drawn."""
    records = {title: i for i, title in enumerate(campaign.records, start=1)}
    models = {title: i for i, title in enumerate(campaign.models)}
    apart = 0.7 / len(models)
    return {
        key: records[key[0]] + apart * (models[key[1]] - 0.5 * (len(models) - 1))
        for key in campaign.groups
    }


def _style(campaign: Campaign, model: str) -> dict[str, Any]:
    i = campaign.models.index(model)
    return {
        "color": MODELS[i % len(MODELS)]["color"],
        "marker": MARKERS[i % len(MARKERS)],
        "linestyle": "none",
        "markersize": 5.0,
        "markerfacecolor": "none",
    }


def _costs(campaign: Campaign, ax: Axes) -> None:
    """Draw the rms of every task, and a cross at the edge where no model was found."""
    places, groups = _places(campaign), campaign.groups
    costs = [one.rms_percent for one in campaign if one.error is None]
    for model in campaign.models:
        x, y = [], []
        for (record, title), group in groups.items():
            finite = [one.rms_percent for one in group if one.error is None]
            if title == model:
                x += finite
                y += [places[record, title]] * len(finite)
        ax.plot(x, y, label=literal(model), **_style(campaign, model))
    low, high = (min(costs), max(costs)) if costs else (0.0, 1.0)
    if low > 0.0 and high > 10.0 * low:
        ax.set_xscale("log")
        _plain_numbers(ax)
    else:
        # Room for the crosses at the edge.
        ax.set_xlim(0.0, 1.1 * high)
    if campaign.failed:
        ax.plot(
            [0.985] * len(campaign.failed),
            [places[one.record, one.model] for one in campaign.failed],
            transform=ax.get_yaxis_transform(),
            color="black",
            marker="x",
            linestyle="none",
            label="no model found",
        )
    ax.set_xlabel("rms on what was fitted [% of stroke]")
    heading(ax, "Cost of each task")


def _apart(campaign: Campaign, ax: Axes) -> None:
    """Draw how far the cost of each seed is above the lowest of its record and model."""
    places = _places(campaign)
    for model in campaign.models:
        x, y = [], []
        for (record, title), group in campaign.groups.items():
            costs = [one.rms for one in group if one.error is None]
            if title == model and len(costs) > 1:
                above = 100.0 * (np.array(costs) / (min(costs) or 1.0) - 1.0)
                x += list(np.maximum(above, EQUAL))
                y += [places[record, title]] * len(costs)
        ax.plot(x, y, **_style(campaign, model))
    ax.set_xscale("log")
    ax.set_xlim(left=0.5 * EQUAL)
    _plain_numbers(ax)
    ax.axvline(0.1, **{**GUIDE, "color": "0.3", "linestyle": "--"})
    ax.text(0.1, 0.02, " 0.1 %", transform=ax.get_xaxis_transform(), fontsize="small", color="0.3")
    ax.set_xlabel(f"above the lowest of the seeds [%]; {EQUAL:g} and less at {EQUAL:g}")
    heading(ax, "Seeds left of the dashed line agree within 0.1 %")


def _plain_numbers(ax: Axes) -> None:
    """Write 0.1 in place of a power of ten."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())


def _records(campaign: Campaign, ax: Axes) -> None:
    """Name the records, or number many of them."""
    records = campaign.records
    count = len(records)
    ax.set_ylim(count + 0.5, 0.5)
    if count <= NAMED:
        names_beside(ax, range(1, count + 1), list(records))
    else:
        ax.set_ylabel("record, in the order given")
    for place in np.arange(1.5, count) if count <= NAMED else []:
        ax.axhline(place, **GUIDE)
