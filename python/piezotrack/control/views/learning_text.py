"""Text of a learning: its heading, its trials line by line, and how it ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..learning.iterative_learning import IterativeLearning, LearningTrial
    from ..learning.learn import Learning

__all__ = ["heading", "learning_text", "outcome", "trial_line"]

WHY = {
    "noise": "the repeatable error is below the noise",
    "no change": "no further improvement",
    "not settled": "no further improvement, and the motion has not settled when it is "
    "recorded: expected more periods before the record (settle=), or a faster loop",
    "grows": "the error grows",
    "trials": "all trials were made",
    "interrupted": "it was interrupted, or the device failed",
}


def heading(learner: IterativeLearning) -> str:
    """Write what is known before the first trial, and the titles of the table of trials."""
    kind = {"frequency": "settled period", "lifted": "whole motion from rest"}
    return (
        f"{learner.reference!r}, {kind[learner.method]}, cutoff {learner.cutoff:.4g} Hz\n"
        f"{learner.convergence}\n{'trial':>5}  {'rms nm':>9}  {'max nm':>9}  {'noise nm':>9}"
    )


def trial_line(place: int, trial: LearningTrial) -> str:
    """Write a line of the table of trials."""
    noise = "" if trial.noise is None else f"{1e9 * trial.noise:.4g}"
    rms, most = 1e9 * trial.rms_error, 1e9 * trial.max_error
    return f"{place:>5}  {rms:>9.4g}  {most:>9.4g}  {noise:>9}"


def outcome(learning: Learning) -> list[str]:
    """Write why it ended, and whether the table is at a limit."""
    clipped = learning.trials[learning.best].clipped
    limited = f"the table is at a limit in {100.0 * clipped:.1f} % of its samples"
    moved = learning.trials[-1].unsettled
    differs = (
        f"the periods of a record differ by {1e9 * abs(moved):.4g} nm in the mean, beyond the "
        "noise: the loop has not settled, the stage creeps, or the sensor drifts"
    )
    learner = learning.learner
    lowered = f"the cutoff fell to {learner.cutoff:.4g} Hz: above it the error grew"
    return [
        *([lowered] if learner.cutoff_lowered else []),
        *([limited] if clipped > 0.0 else []),
        *([differs] if moved else []),
        f"ended: {WHY[learning.stopped]}",
    ]


def learning_text(learning: Learning) -> str:
    """Write the trials, the best one marked, and how it ended."""
    lines = [heading(learning.learner)]
    for i, trial in enumerate(learning.trials):
        lines.append(trial_line(i, trial) + (" *" if i == learning.best else ""))
    return "\n".join([*lines, *outcome(learning)])
