"""Conclusions of the paper, checked on the obtained values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .experiments.table_2 import PUBLISHED

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["Conclusion", "conclusions"]

Values = dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """A conclusion of the paper, and whether it is confirmed.

    Attributes
    ----------
    text : str
        The conclusion.
    seeds, seen : int
        Runs, and those in which it is confirmed.
    words : str
        The obtained numbers.
    """

    text: str
    seeds: int
    seen: int
    words: str

    @property
    def holds(self) -> bool:
        """Whether it is confirmed in more than half of the runs."""
        return 2 * self.seen > self.seeds


def conclusions(runs: Sequence[Values]) -> tuple[Conclusion, ...]:
    """Check each conclusion on `Experiments.values`, one dict for each seed."""
    return tuple(
        Conclusion(
            text=text,
            seeds=len(runs),
            seen=sum(test(run) for run in runs),
            words=words.format(**_medians(runs)),
        )
        for text, test, words in CHECKS
    )


def _medians(runs: Sequence[Values]) -> dict[str, str]:
    """Return medians in um, by the keys of the format strings."""
    return {
        key.replace(".", "_").replace(
            "-", "_"
        ): f"{1e6 * np.median([run[key] for run in runs]):.2f}"
        for key in runs[0]
    }


def _forward_and_back(run: Values) -> bool:
    return run["both.max"] < min(run["forward.max"], run["back.max"])


def _antiwindup(run: Values) -> bool:
    return run["windup.with"] < run["windup.without"]


def _learns(run: Values) -> bool:
    # From the fourth period on the error changes by noise only.
    return run["repetitive.with"] < run["repetitive.without"] and (
        run["repetitive.fourth"] <= 1.15 * run["repetitive.last"]
    )


def _keys(figure: str) -> list[list[str]]:
    """Return the keys of Table 2, a row for each radius."""
    keys = [f"{case.key}.{figure}" for case in PUBLISHED]
    return [keys[i : i + 3] for i in range(0, 9, 3)]


def _grows_with_radius(run: Values) -> bool:
    columns = zip(*_keys("sd"), strict=True)
    return all(bool(np.all(np.diff([run[key] for key in column]) > 0.0)) for column in columns)


def _grows_with_rate(run: Values) -> bool:
    return all(bool(np.all(np.diff([run[key] for key in row]) > 0.0)) for row in _keys("sd"))


def _dahl(run: Values) -> bool:
    return run["models.dahl"] < run["models.bouc-wen"]


CHECKS: tuple[tuple[str, Callable[[Values], bool], str], ...] = (
    (
        "Feedforward with feedback is better than either alone (Fig. 12).",
        _forward_and_back,
        "largest error {forward_max} um, {back_max} um, both {both_max} um",
    ),
    (
        "Antiwindup helps where the voltage saturates (Fig. 13).",
        _antiwindup,
        "largest error {windup_without} um without, {windup_with} um with it",
    ),
    (
        "Repetitive control lowers the error and settles in about three periods (Fig. 14).",
        _learns,
        "largest error {repetitive_without} um without it; with it {repetitive_second} um in the "
        "2nd period, {repetitive_fourth} um in the 4th, {repetitive_last} um in the last; rms of "
        "the last {repetitive_rms_without} um without, {repetitive_rms_with} um with it",
    ),
    (
        "The contour error grows with the radius (Table 2).",
        _grows_with_radius,
        "SD at 0.2 Hz: {circle_10um_0_2Hz_sd}, {circle_20um_0_2Hz_sd}, {circle_40um_0_2Hz_sd} um",
    ),
    (
        "The contour error grows with the rate (Table 2).",
        _grows_with_rate,
        "SD at 20 um: {circle_20um_0_1Hz_sd}, {circle_20um_0_2Hz_sd}, {circle_20um_0_5Hz_sd} um",
    ),
    (
        "The Dahl model is better than the Bouc-Wen model (Fig. 7).",
        _dahl,
        "largest error {models_dahl} um, Bouc-Wen {models_bouc_wen} um; below, for which stages it "
        "holds",
    ),
)
