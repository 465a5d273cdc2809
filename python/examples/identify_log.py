"""From a CSV log to an identified stage: reads, identifies, validates on the rest, saves.

Run as ``python identify_log.py stage.csv``; without a file it makes a log of the virtual stage.
"""

from __future__ import annotations

import sys
from pathlib import Path

import piezotrack as pt
from piezotrack.xu_li_2010.demo import demo_log


def main() -> None:
    """Identify the first half of a log and judge the model on the second."""
    log = pt.read(sys.argv[1]) if len(sys.argv) > 1 else demo_log().decimate(20)
    middle = 0.5 * (log.t[0] + log.t[-1])
    fit = pt.identify(log[:middle], "dahl", method=pt.Descents(seed=1))
    print(fit.summary())
    # The drive of the first half is warm-up for the second: hysteresis remembers.
    print("\nsecond half, not fitted:", fit.score(log[middle:], offset=fit.offset))
    print("model in", fit.save(Path("dahl.json")))


if __name__ == "__main__":
    main()
