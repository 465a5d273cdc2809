"""Tuned gains against the published ones, on the calibrated stage of Xu and Li 2010.

Figs. 12 to 14 and the nine circles of Table 2, at the paper's sampling rate and at 1 and 5 kHz.
Gains are tuned with one seed of the sensors, without jitter, by three seeds of the search; all are
judged on other seeds of the sensors, with the calibrated delay, jitter and lag between the axes. Of
tuned gains the median over the searches is printed, with the lowest and the highest.

    python benches/tuned_gains.py [--fast]
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

import piezotrack as pt
from piezotrack.references import circle
from piezotrack.xu_li_2010.apparatus import LIMITS, Apparatus
from piezotrack.xu_li_2010.experiments.fig_06_identification import record, search
from piezotrack.xu_li_2010.experiments.references import SHRUNK, fast, shrunk, slow
from piezotrack.xu_li_2010.experiments.table_2 import PUBLISHED

RATES = (50.0, 1000.0, 5000.0)
JUDGED = (1001, 1002, 1003)
SEARCHES = (1, 2, 3)
PID = pt.Pid.xu_li_2010()


def controller(inverse: Any, dt: float, limits: tuple[float, float], **parts: Any) -> pt.Controller:
    return pt.Controller(dt=dt, limits=limits, feedforward=inverse, **parts)


def tuned(stage: Any, inverse: Any, reference: Any, dt: float, delay: float, **options: Any) -> Any:
    options = {"limits": LIMITS, "goal": pt.Goal(largest_saturation=1.0), **options}
    timing = pt.Timing(delay=delay)
    return pt.tune(stage, reference, dt=dt, feedforward=inverse, timing=timing, **options)


def largest(apparatus: Apparatus, loop: pt.Controller, reference: Any) -> tuple[float, float]:
    """Largest and rms error [m], the mean over the seeds; repetitive control has learnt by then."""
    found = []
    for seed in JUDGED:
        one = apparatus.seeded(seed)
        run = pt.track(
            one.x,
            loop,
            reference,
            timing=pt.Timing(delay=one.delay, jitter=min(one.jitter, 0.2 * loop.dt)),
            beyond_reach=True,
            unstable=True,
        )
        start = 3.0 * reference.period if loop.repetitive is not None else None
        found.append((run.score(start).max_error, run.score(start).rms_error))
    return tuple(np.mean(found, axis=0))


def figures(apparatus: Apparatus, inverse: Any, rates: tuple[float, ...]) -> None:
    repeat = pt.Repetitive.xu_li_2010
    cases = (
        ("12, both", slow(), {"feedback": PID}, LIMITS, ("pid", "low-pass")),
        ("12, no feedforward", slow(), {"feedback": PID}, LIMITS, ("pid", "low-pass")),
        ("13, clipped", shrunk(), {"feedback": PID}, SHRUNK, ("pid", "low-pass")),
        ("14, PID", fast(), {"feedback": PID}, LIMITS, ("pid", "low-pass")),
        (
            "14, repetitive",
            fast(),
            {"feedback": PID, "repetitive": repeat(2.0)},
            LIMITS,
            ("pid", "low-pass", "repetitive"),
        ),
    )
    print("| Fig. | rate Hz | published: largest, rms um | tuned: largest, rms um | s a search |")
    print("| --- | --- | --- | --- | --- |")
    for name, reference, parts, limits, sought in cases:
        forward = None if "no" in name else inverse
        published = largest(apparatus, controller(forward, 0.02, limits, **parts), reference)
        for rate in rates:
            started = time.perf_counter()
            extra = ("notch",) if rate > 400.0 else ()
            found = []
            for seed in SEARCHES:
                loop = tuned(
                    apparatus.x,
                    forward,
                    reference,
                    1.0 / rate,
                    apparatus.delay,
                    limits=limits,
                    parts=(*sought, *extra),
                    search=budget(rate, seed),
                ).controller
                found.append(largest(apparatus, loop, reference))
            took = (time.perf_counter() - started) / len(SEARCHES)
            cells = f"{spread([published])} | {spread(found)}"
            print(f"| {name} | {rate:g} | {cells} | {took:.1f} |", flush=True)


def spread(found: list[tuple[float, float]]) -> str:
    """Median of each figure [um], with the lowest and the highest of several."""
    texts = []
    for values in 1e6 * np.transpose(found):
        text = f"{np.median(values):.3f}"
        if len(values) > 1:
            text += f" ({values.min():.3f} to {values.max():.3f})"
        texts.append(text)
    return ", ".join(texts)


def circles(apparatus: Apparatus, inverse: Any, rates: tuple[float, ...]) -> None:
    print("\nContour error, peak to peak and SD, um.\n")
    print("| radius um | Hz | rate Hz | published | tuned | s a search |")
    print("| --- | --- | --- | --- | --- | --- |")
    one = controller(inverse, 0.02, LIMITS, feedback=PID)
    for case in PUBLISHED:
        path = circle(frequency=case.frequency, radius=case.radius)
        before = contour_error(apparatus, (one, one), path)
        for rate in rates:
            started = time.perf_counter()
            parts = ("pid", "low-pass", "notch") if rate > 400.0 else ("pid", "low-pass")
            after = []
            for seed in SEARCHES:
                pair = tuned(
                    apparatus.stage,
                    inverse,
                    path,
                    1.0 / rate,
                    apparatus.delay,
                    parts=parts,
                    search=budget(rate, seed),
                ).controllers
                after.append(contour_error(apparatus, pair, path))
            took = (time.perf_counter() - started) / len(SEARCHES)
            cells = f"{spread([before])} | {spread(after)}"
            print(
                f"| {1e6 * case.radius:g} | {case.frequency:g} | {rate:g} | {cells} | {took:.1f} |",
                flush=True,
            )


def budget(rate: float, seed: int) -> pt.TuningSearch:
    """Budget of a search; a loop at 5 kHz has 150 000 samples."""
    sizes = {"particles": 32, "iterations": 40} if rate > 2000.0 else {}
    return pt.TuningSearch(seed=seed, **sizes)


def contour_error(apparatus: Apparatus, pair: Any, path: Any) -> tuple[float, float]:
    found = []
    for seed in JUDGED:
        one = apparatus.seeded(seed)
        run = pt.contour(
            one.stage,
            pair,
            path,
            timing=pt.Timing(delay=one.delay, jitter=min(one.jitter, 0.2 * pair[0].dt)),
            beyond_reach=True,
            unstable=True,
        ).metrics
        found.append((run.peak_to_peak, run.sd_error))
    return tuple(np.mean(found, axis=0))


def main() -> None:
    rates = RATES[:1] if "--fast" in sys.argv else RATES
    apparatus = Apparatus.calibrated().seeded(1000)
    fit = search(record(apparatus), 1000)
    inverse = fit.inverse()
    figures(apparatus, inverse, rates)
    circles(apparatus, inverse, rates)


if __name__ == "__main__":
    main()
