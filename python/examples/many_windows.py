"""A campaign: parts of a measured log, two models, six seeds each.

Run as ``python many_windows.py [OUT]``; what is in the folder ``windows`` is not computed again.
Shows how far the parts differ, and whether the seeds of a swarm end in one minimum. Writes the
picture of docs/campaigns.md, campaign.png.
"""

from __future__ import annotations

import sys
from pathlib import Path

import piezotrack as pt


def main() -> None:
    """Identify, print the table and draw the picture."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    out.mkdir(parents=True, exist_ok=True)
    log = pt.datasets.dbo_training()
    records = {f"{begin} to {begin + 3} s": log.cut(begin, begin + 3) for begin in (3, 8, 13, 18)}
    # Short swarms without a descent, for an example: the default ones agree far more often.
    short = {
        "method": pt.ParticleSwarm(particles=12, iterations=40, polish=False, runs=1),
        "history": "settled",
    }
    models = {model: {"model": model, **short} for model in ("first-order-dahl", "bouc-wen")}
    found = pt.campaign(records, models, range(6), folder="windows")
    print(found.summary())
    found.plot().savefig(out / "campaign.png", dpi=100)


if __name__ == "__main__":
    main()
