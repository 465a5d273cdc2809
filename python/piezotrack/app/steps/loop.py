"""Fourth step: the loop, tuned and judged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.units import best_length_unit, decibels, length_text
from ...control.views.tuning import searches_text
from ...errors import PiezotrackError
from .. import parts
from ..code import Code, call, command, plain
from .closed_loop import (
    by_hand,
    controller_of,
    effort_of,
    gains_of,
    known_tuning,
    margins_of,
    model_of,
    noise_of,
    report_of,
    run_of,
    tuned_of,
    tuning_parts,
)
from .model import chosen_trial
from .motion import is_beyond, motion_line, motion_word

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from ...control.controller.controller import Controller
    from ...control.loop.stability import LoopReport
    from ...control.loop.tracking import Tracking
    from ..desk import Desk, Download, Job
    from ..parts import Light, Part

__all__ = ["LoopStep", "controller_lines", "stable", "tune_options"]

# Factors about a gain that its slider reaches, and frequencies as shares of the sampling rate.
AROUND, LOWEST, HIGHEST = 30.0, 1e-3, 0.45
# Points of Bode and Nyquist, and sensitivity from which a loop is fragile.
POINTS, FRAGILE = 400, 2.0
# Part of the plane around the critical point that is shown.
PLANE = (-3.2, 1.6, -2.4, 2.4)
BY_HAND = {"kp": None, "ki": None, "kd": None, "low_pass": None, "notch": None}

# Colours of the gains of the stage.
COLOURS = {"low": "first", "middle": "plant", "high": "true"}


class LoopStep:
    """The loop."""

    title = "Loop"

    def light(self, desk: Desk) -> tuple[Light, str]:
        """Red where the loop is unstable on a stage of the set, amber where it is fragile."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return "grey", "needs a model"
        if desk.accepted is None and known_tuning(desk) is None and not by_hand(desk):
            return "grey", "not tuned yet"
        report = report_of(desk, controller_of(desk))
        if not stable(desk, report):
            return "red", "unstable"
        if known_tuning(desk) is None and not by_hand(desk):
            return "amber", "tuned for other settings"
        _, rms = _rms(run_of(desk, controller_of(desk)))
        worst = max(one.sensitivity for _, one in report.cases)
        words = f"{length_text(rms, 3)} rms true, Ms {worst:.2g} at most"
        return ("amber" if worst > FRAGILE * 1.005 else "green"), words

    def page(self, desk: Desk) -> Iterator[Part]:
        """Return sliders, error, spectrum, Bode and Nyquist, and the margins."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            yield parts.needs("model", "Fit a model first.")
            return
        yield _sliders(desk)
        if known_tuning(desk) is None and not by_hand(desk) and desk.tuned_for != _settings(desk):
            _tune(desk, {})
        try:
            controller = controller_of(desk)
            run, report = run_of(desk, controller), report_of(desk, controller)
        except PiezotrackError:
            # What was typed can be typed again.
            if desk.last_tuned is not None:
                yield _gains(desk, desk.last_tuned)
            yield _setting(desk)
            raise
        old = desk.accepted if desk.accepted is not controller else None
        before = None if old is None else run_of(desk, old)
        if known_tuning(desk) is None:
            yield from desk.faults("tuning")
        yield _words(desk, report)
        yield _gains(desk, controller)
        yield _setting(desk)
        yield _error_chart(desk, run, before)
        yield _spectrum_chart(desk, run, before)
        yield from _bode(desk, report, None if old is None else report_of(desk, old))
        yield _margins(desk, report)
        yield parts.code("code", "The same in Python", "\n".join(self.python(desk)))
        yield parts.code("command", "and as a command", "\n".join(self.commands(desk)))

    def python(self, desk: Desk) -> list[str]:
        """Tune, or make the controller that was set by hand."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return []
        return [motion_line(desk), *controller_lines(desk)]

    def commands(self, desk: Desk) -> list[str]:
        """Tune, and simulate the controller."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return []
        name = f"results/{model_of(desk).model.info.name}.json"
        lines = [command("tune", name, motion_word(desk), **tune_options(desk))]
        if by_hand(desk):
            gains = gains_of(controller_of(desk))
            lines = [
                command(
                    "track",
                    name,
                    motion_word(desk),
                    kp=f"{1e-6 * gains.kp:.9g}V/um",
                    ti=f"{1e3 * gains.kp / gains.ki:.9g}ms" if gains.ki > 0.0 else "inf",
                    td=f"{1e3 * gains.kd / gains.kp:.9g}ms" if gains.kp > 0.0 else None,
                    noise=f"{1e9 * noise_of(desk):.3g}nm",
                    beyond_reach=is_beyond(desk),
                )
            ]
        return lines

    @property
    def actions(self) -> Mapping[str, Callable[[Desk, Mapping[str, Any]], Download | None]]:
        """Tune, accept, and go back to the gains of the search."""
        return {"tune": _tune, "accept": _accept, "searched": _searched}


def tune_options(desk: Desk) -> dict[str, Any]:
    """Return the options of `piezotrack tune`."""
    state, known = desk.state.loop, tuning_parts(desk)
    effort = effort_of(desk)
    return {
        "parts": ",".join(known) if known else None,
        "sensitivity": f"{margins_of(desk).sensitivity:g}",
        "gain_spread": f"{100.0 * state.spread:g}" if state.spread else None,
        "effort": f"{1e6 * effort:.3g}um" if effort else None,
        "delay": f"{1e3 * state.delay:.6g}ms" if state.delay else None,
        "noise": f"{1e9 * noise_of(desk):.3g}nm" if noise_of(desk) else None,
        "out": "tuned",
    }


def controller_lines(desk: Desk) -> list[str]:
    """Return the lines of Python that make the controller."""
    state = desk.state.loop
    stage = call("stage = pt.VirtualStage.of", "fit", noise=noise_of(desk), seed=1)
    if by_hand(desk):
        made = controller_of(desk)
        keywords: dict[str, Any] = {"feedback": Code(f"pt.control.{made.feedback!r}")}
        if made.filters:
            named = ", ".join(f"pt.{one!r}" for one in made.filters)
            keywords["filters"] = Code(f"[{named}]")
        return [
            stage,
            call("controller = pt.Controller.of", "fit", **keywords),
            call("print", Code("pt.check_loop(stage, controller)")),
        ]
    margins, known = margins_of(desk), tuning_parts(desk)
    tuned = call(
        "tuned = pt.tune",
        "[stage]",
        "[reference]",
        dt=Code("fit.dt"),
        limits=Code("fit.drive_range"),
        feedforward=Code("fit.inverse()"),
        parts=known,
        margins=Code(call("pt.Margins", sensitivity=margins.sensitivity)),
        spread=Code(f"pt.Spread(gain={plain(state.spread)})") if state.spread else None,
        goal=Code(f"pt.Goal(effort={effort_of(desk)!r})") if effort_of(desk) else None,
        timing=Code(f"pt.Timing(delay={plain(state.delay)})") if state.delay else None,
        search=Code("pt.TuningSearch(seed=1)"),
    )
    return [stage, *tuned.split("\n"), "print(tuned)", "controller = tuned.controller"]


def stable(desk: Desk, report: LoopReport) -> bool:
    """Whether a loop is stable at all gains of the stage and within the spread."""
    return all(_case(desk, one)[0] for _, one in report.cases)


def _case(desk: Desk, check: Any) -> tuple[bool, str]:
    """Return whether a loop is stable at a gain and within the spread, and that in words."""
    spread = desk.state.loop.spread
    if not check.stable:
        return False, "unstable"
    low, high = check.stable_gains or (0.0, math.inf)
    if low <= 1.0 - spread and high >= 1.0 + spread:
        return True, "stable"
    return False, f"unstable within {100 * spread:g} % of the gain"


def _sliders(desk: Desk) -> Part:
    """Return the two sliders, and the buttons."""
    state = desk.state.loop
    part = parts.controls(
        "tuning",
        "Tune",
        parts.slider("speed", "Speed", state.speed, (0.0, 1.0), words=("slower", "faster")),
        parts.slider(
            "robustness", "Robustness", state.robustness, (0.0, 1.0), words=("aggressive", "robust")
        ),
        step="loop",
    )
    running = "tuning" in desk.running
    part["buttons"] = [
        parts.action("Stop", "stop")
        if running
        else parts.action("Tune", "loop.tune", primary=True),
        parts.action("Accept this loop", "loop.accept"),
    ]
    if by_hand(desk):
        part["buttons"].append(parts.action("Take the gains of the search", "loop.searched"))
    return part


def _words(desk: Desk, report: LoopReport) -> Part:
    """Say which constraint is active, and where the loop is unstable."""
    items = []
    known = known_tuning(desk)
    if "tuning" in desk.running:
        items.append(parts.message("grey", "the search goes on; the gains are those so far"))
    if by_hand(desk):
        items.append(parts.message("grey", "gains set by hand"))
    elif known is not None:
        tuned, full = known
        active = ", ".join(tuned.active_constraints)
        words = f"active: {active}" if active else "no constraint is active: the error is the least"
        agree = f"; {searches_text(tuned)}" if full else ""
        items.append(parts.message("green", words + agree))
    for name, one in report.cases:
        stable, words = _case(desk, one)
        if not stable:
            items.append(parts.message("red", f"{words}: {name} gain, {one.gain_text}"))
        elif one.hint:
            items.append(parts.message("amber", one.hint))
    return parts.messages("verdict", *items)


def _gains(desk: Desk, controller: Controller) -> Part:
    """Return the gains and filters, each with a slider about the present value."""
    gains, rate = gains_of(controller), 1.0 / controller.dt
    base = gains_of(desk.last_tuned) if desk.last_tuned is not None else gains
    items = []
    for name, label, unit in (
        ("kp", "kp", "V/um"),
        ("ki", "ki", "V/(um s)"),
        ("kd", "kd", "V s/um"),
    ):
        value, middle = getattr(gains, name), getattr(base, name)
        least = max(middle, 1e-9 * (gains.kp or 1.0)) / AROUND
        bounds = (min(least, value or least), max(middle * AROUND, value, 2.0 * least))
        items.append(parts.slider(name, label, value or least, bounds, unit, per=1e-6, scale="log"))
    items += [
        parts.number("low_pass", "Low-pass, 0 for none", gains.low_pass, "Hz"),
        parts.number("notch", "Notch, 0 for none", gains.notch, "Hz"),
    ]
    return parts.controls("gains", f"Gains, at {rate:.4g} Hz", *items, step="loop")


def _setting(desk: Desk) -> Part:
    """Return what is simulated: delay, noise, spread, and which stage."""
    state, dt = desk.state.loop, model_of(desk).dt or 1.0
    items = [
        parts.check("repetitive", "Repetitive control", state.repetitive),
        parts.slider("delay", "Delay of the loop", state.delay, (0.0, 5.0 * dt), "ms", per=1e3),
        parts.number("noise", "Noise of the sensor", noise_of(desk), "nm", per=1e9),
        parts.slider("spread", "Spread of the gain", state.spread, (0.0, 0.5), "%", per=1e2),
    ]
    if desk.state.model.test:
        items.append(parts.check("second", "The stage is the second log", state.second))
    return parts.controls("setting", "Simulated stage", *items, step="loop", folded=True)


def _last_period(run: Tracking) -> Any:
    """Return the samples of the last whole period, or of what follows the start."""
    period = run.reference.period
    begin = run.settled if period is None else float(run.t[-1]) - period
    return run.t >= begin - 1e-9


def _rms(run: Tracking) -> tuple[float, float]:
    """Return the measured and the true error over one settled period, rms [m]."""
    part = _last_period(run)
    errors = (run.desired[part] - one[part] for one in (run.measured, run.displacement))
    measured, true = (float(np.sqrt(np.nanmean(one**2))) for one in errors)
    return measured, true


def _error_chart(desk: Desk, run: Tracking, before: Tracking | None) -> Part:
    """Draw the measured and the true error over one settled period."""
    part = _last_period(run)
    measured, true = (run.desired - one for one in (run.measured, run.displacement))
    unit, scale = best_length_unit(float(np.nanmax(np.abs(measured[part]))))
    plot, t = desk.plotter, run.t[part]
    lines = [
        plot.over_time("l-error", t, scale * measured[part], "measured", "noise"),
        plot.over_time("l-error", t, scale * true[part], "true", "third", wide=True),
    ]
    if before is not None:
        kept = _last_period(before)
        error = (before.desired - before.displacement)[kept]
        lines.append(
            plot.over_time(
                "l-error", before.t[kept], scale * error, "accepted", "accepted", dash=True
            )
        )
    rms = [length_text(one, 3) for one in _rms(run)]
    words = f"Over one settled period: {rms[0]} rms measured, {rms[1]} rms true."
    return parts.chart("l-error", "Error", words, ("time", "s"), ("error", unit), lines)


def _spectrum_chart(desk: Desk, run: Tracking, before: Tracking | None) -> Part:
    """Draw the spectrum of the measured error."""
    unit, scale = "nm", 1e9
    lines = []
    for one, name, role in ((run, "measured error", "third"), (before, "accepted", "accepted")):
        if one is None:
            continue
        frequency, density = one.error_spectrum()
        lines.append(
            desk.plotter.over_time(
                "l-spectrum", frequency, scale * density, name, role, dash=role == "accepted"
            )
        )
    words = f"Amplitude density of the measured error up to {0.5 / run.controller.dt:.4g} Hz."
    return parts.chart(
        "l-spectrum",
        "Spectrum of the error",
        words,
        ("frequency", "Hz"),
        ("density", f"{unit}/sqrt(Hz)"),
        lines,
        log="xy",
    )


def _bode(desk: Desk, report: LoopReport, before: LoopReport | None) -> list[Part]:
    """Draw the open loop at the lowest, the middle and the highest gain."""
    sizes, phases, planes = [], [], []
    for name, one in report.cases:
        stable = _case(desk, one)[0]
        role = COLOURS[name] if stable else "unstable"
        curves = report.response(POINTS, gain=name)
        shown = f"{name} gain" + ("" if stable else ", unstable")
        size = np.maximum(np.abs(curves.open_loop), 1e-12)
        sizes.append(parts.points(curves.frequency, size, shown, role, wide=name == "middle"))
        degrees = np.degrees(curves.phase)
        phases.append(parts.points(curves.frequency, degrees, shown, role, wide=name == "middle"))
        planes.append(parts.points(*_plane(curves.open_loop), shown, role, wide=name == "middle"))
    sensitivity = report.response(POINTS)
    sizes.append(
        parts.points(sensitivity.frequency, np.abs(sensitivity.sensitivity), "sensitivity", "error")
    )
    if before is not None:
        old = before.response(POINTS)
        size = np.maximum(np.abs(old.open_loop), 1e-12)
        sizes.append(parts.points(old.frequency, size, "accepted", "accepted", dash=True))
        degrees = np.degrees(old.phase)
        phases.append(parts.points(old.frequency, degrees, "accepted", "accepted", dash=True))
        planes.append(parts.points(*_plane(old.open_loop), "accepted", "accepted", dash=True))
    planes.append(parts.points([-1.0], [0.0], "critical point", "bad", marks=True))
    middle = report.middle
    gain = "none" if middle.gain_margin is None else f"{decibels(middle.gain_margin):.3g} dB"
    phase = (
        "none"
        if middle.phase_margin is None
        else f"{math.degrees(middle.phase_margin):.3g} degrees"
    )
    words = (
        f"At the middle gain: gain margin {gain}, phase margin {phase}, "
        f"Ms {middle.sensitivity:.3g}."
    )
    return [
        parts.chart(
            "l-bode",
            "Open loop and sensitivity",
            words,
            ("frequency", "Hz"),
            ("magnitude", ""),
            sizes,
            log="xy",
            levels=[{"at": 0.0, "label": "1"}],
        ),
        parts.chart(
            "l-phase",
            "Phase of the open loop",
            words,
            ("frequency", "Hz"),
            ("phase", "deg"),
            phases,
            log="x",
            levels=[{"at": -180.0, "label": "-180 deg"}],
        ),
        parts.chart(
            "l-nyquist",
            "Nyquist",
            "The open loop in the complex plane, near the critical point. " + words,
            ("real part", ""),
            ("imaginary part", ""),
            planes,
            view=list(PLANE),
        ),
    ]


def _plane(loop: Any) -> tuple[Any, Any]:
    """Return real and imaginary parts, as far as they are near the critical point."""
    near = np.abs(loop) < 20.0
    return np.where(near, loop.real, np.nan), np.where(near, loop.imag, np.nan)


def _margins(desk: Desk, report: LoopReport) -> Part:
    """Return the margins at each gain."""
    rows = []
    for name, one in report.cases:
        gain = "-" if one.gain_margin is None else f"{decibels(one.gain_margin):.3g} dB"
        phase = "-" if one.phase_margin is None else f"{math.degrees(one.phase_margin):.3g} deg"
        delay = "-" if one.delay_margin is None else f"{1e3 * one.delay_margin:.3g} ms"
        width = "-" if one.bandwidth is None else f"{one.bandwidth:.3g} Hz"
        verdict = _case(desk, one)[1]
        cells = (f"{name}, {one.gain_text}", verdict, gain, phase, delay, f"{one.sensitivity:.3g}")
        rows.append((*cells, width))
    columns = ("gain of the stage", "", "gain margin", "phase margin", "delay margin", "Ms")
    return parts.table("margins", "Margins", (*columns, "bandwidth"), rows)


def _settings(desk: Desk) -> object:
    """Return all that a search depends on."""
    state = desk.state
    loop = state.changed("loop", {**BY_HAND, "second": False}).loop
    return (state.log, state.model, state.motion, loop)


def _tune(desk: Desk, _: Mapping[str, Any]) -> None:
    """Tune for the present settings: by a search that answers at once, then by the full one."""
    _searched(desk, {})
    desk.tuned_for = _settings(desk)
    state = desk.state

    def work(job: Job) -> None:
        for full in (False, True):
            if job.stop.is_set():
                return
            tuned_of(desk.at(state), full=full)
            job.changed()

    desk.start("tuning", work)


def _accept(desk: Desk, _: Mapping[str, Any]) -> None:
    """Keep the present loop as the one that others are compared with."""
    desk.accepted = controller_of(desk)


def _searched(desk: Desk, _: Mapping[str, Any]) -> None:
    """Drop what was changed by hand."""
    desk.state = desk.state.changed("loop", BY_HAND)
