"""The measured log of Aye and Ang 2018: one amplitude to fit, and another record of many."""

from __future__ import annotations

from ...data.datasets import dbo_tracking, dbo_training
from ..record import BenchmarkRecord

__all__ = ["RECORDS"]

# The transient of an unknown history, and the part that is fitted [s].
SETTLED, FITTED = 3.0, 23.0


def _measured() -> BenchmarkRecord:
    log = dbo_training()
    return BenchmarkRecord(
        name="measured",
        title="measured log, 1 Hz",
        fitted=log[SETTLED:FITTED],
        rest=log[FITTED:],
        others={"other log": dbo_tracking()[SETTLED:]},
    )


RECORDS = {"measured": _measured}
