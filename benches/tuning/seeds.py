"""Tune some cases with some seeds; a line of JSON for each: figure [m or V], candidates, CPU [s].

python seeds.py CASES SEEDS, as of `python benches/tuning`, of the package on PYTHONPATH
"""

from __future__ import annotations

import json
import sys
import time
import warnings

from cases import CASES

import piezotrack as pt


def main() -> None:
    warnings.simplefilter("ignore")
    numbers, seeds = ([int(one) for one in text.split(",")] for text in sys.argv[1:3])
    for number in numbers:
        stage, reference, options = CASES[number].make()
        for seed in seeds:
            search = pt.TuningSearch(seed=seed)
            started = time.process_time()
            tuned = pt.tune(stage, reference, search=search, threads=1, **options)
            row = {
                "case": number,
                "seed": seed,
                "figure": tuned.value,
                "candidates": tuned.candidates,
                "cpu": time.process_time() - started,
                "agree": [getattr(tuned, "agreeing", 1), getattr(tuned, "searches", 1)],
            }
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
