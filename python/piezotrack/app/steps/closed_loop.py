"""Motion, stage and controller of the present settings, for the steps that follow the model."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from ...control.laws.pid import Pid
from ...control.loop.stability import check_loop
from ...control.parts.filters import LowPass, Notch
from ...control.parts.repetitive import Repetitive
from ...control.plant import displacement_range, lowest_settled_displacement
from ...control.running.track import track
from ...control.timing import Timing
from ...control.tuning.goal import Goal, TuningSearch
from ...control.tuning.margins import Margins, Spread
from ...control.tuning.tune import tune
from ...errors import DataError
from ...identification.fit import identify
from ...identification.fitted.model_file import load
from ...references.parse import parse_path, parse_reference
from ...references.reference import read_reference
from ...stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage
from ...stages.virtual import VirtualStage
from ..desk import Same
from .log import stamp
from .model import fit_of, test_of

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...control.loop.stability import LoopReport
    from ...control.loop.tracking import Tracking
    from ...control.tuning.tuned import Tuned
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ...stages.inverse import Inverse
    from ..desk import Desk

__all__ = [
    "Reach",
    "controller_of",
    "gains_of",
    "limits_of",
    "margins_of",
    "model_of",
    "noise_of",
    "reach_of",
    "reference_of",
    "reference_text",
    "report_of",
    "run_of",
    "stage_of",
    "straight_line",
    "tuned_of",
    "tuning_settings",
]

# Sensitivities that are kept, from aggressive to robust.
AGGRESSIVE, ROBUST = 2.0, 1.15
# Budget of the search that answers at once; a full one follows.
QUICK = TuningSearch(particles=16, iterations=10, seed=1)
FULL = TuningSearch(seed=1)
# Share of the reach that a motion takes at first, and sampling of the reach [s].
SHARE, REACH_STEP = 0.8, 1e-3
# Periods of a motion for a loop that learns.
LEARNING = 8


class Reach(NamedTuple):
    """Displacements that a stage reaches between the limits [m]."""

    low: float
    high: float


def model_of(desk: Desk) -> IdentifiedModel:
    """Return the chosen model as its file has it, which is what the commands read."""
    fit = fit_of(desk)

    def compute() -> IdentifiedModel:
        return load(fit.save(desk.place("model") / f"{fit.model.info.name}.json"))

    found: IdentifiedModel = desk.result("model", Same(fit), compute)
    return found


def limits_of(desk: Desk) -> tuple[float, float]:
    """Return the range of the drive of the record [V]."""
    model = model_of(desk)
    if model.drive_range is None or model.dt is None:
        raise DataError("the model has no range of the drive: fit one to a record")
    return model.drive_range


def noise_of(desk: Desk) -> float:
    """Return the noise of the simulated sensor [m], in whole digits of nanometres."""
    given = desk.state.loop.noise
    return given if given is not None else _rounded(fit_of(desk).noises[0], 1e9)


def _rounded(value: float, per: float) -> float:
    """Round to three digits of the unit in which a command has it."""
    return float(f"{per * value:.3g}") / per


def stage_of(desk: Desk) -> VirtualStage:
    """Return the stage that is simulated: that of the model, or that of the second log."""
    model = model_of(desk)
    if desk.state.loop.second:
        model = _second(desk)
    key = [Same(model), noise_of(desk)]
    found: VirtualStage = desk.result(
        "stage", key, lambda: VirtualStage.of(model, noise=noise_of(desk), seed=1)
    )
    return found


def _second(desk: Desk) -> IdentifiedModel:
    """Return the same kind of model, fitted to the second log."""
    name, test = fit_of(desk).model.info.name, test_of(desk)
    path = desk.file("test", desk.state.model.test)
    settings = [name, stamp(path), desk.state.model, desk.state.log.zero]

    def compute() -> IdentifiedModel:
        return identify(test, name, progress=False)

    found: IdentifiedModel = desk.result("second", settings, compute)
    return found


def reach_of(desk: Desk) -> Reach:
    """Return what the stage of the model reaches again and again between the limits."""
    model, limits = model_of(desk), limits_of(desk)

    def compute() -> Reach:
        stage = VirtualStage.of(model)
        _, top = displacement_range(stage, limits, REACH_STEP)
        return Reach(lowest_settled_displacement(stage, limits, top, REACH_STEP), top)

    found: Reach = desk.result("reach", Same(model), compute)
    return found


def range_of(desk: Desk) -> tuple[float, float]:
    """Return lowest and highest displacement of the motion [m], in whole digits of a micrometre."""
    state, reach = desk.state.motion, reach_of(desk)
    edge = 0.5 * (1.0 - SHARE) * (reach.high - reach.low)
    low = reach.low + edge if state.low is None else state.low
    high = reach.high - edge if state.high is None else state.high
    return _micro(low), _micro(high)


def _micro(value: float) -> float:
    return float(f"{1e6 * value:.5g}") / 1e6


def reference_text(desk: Desk) -> str:
    """Return the motion as a text for `piezotrack.parse_reference`; empty for one of a file."""
    state, (bottom, top) = desk.state.motion, range_of(desk)
    low, high = f"{1e6 * bottom:.5g}", f"{1e6 * top:.5g}"
    rate = f"{state.frequency:.5g}Hz"
    dwell = f"{1e3 / state.frequency:.6g}ms"
    middle = f"{0.5e6 * (bottom + top):.5g}"
    half = f"{0.5e6 * (top - bottom):.5g}"
    pitch = f"{0.5e6 * (top - bottom) / max(state.steps, 1):.5g}"
    duration = f",{LEARNING / state.frequency:.6g}s" if desk.state.loop.repetitive else ""
    texts = {
        "triangle": f"triangle:{rate},{low}..{high}um{duration}",
        "sine": f"sine:{rate},{low}..{high}um{duration}",
        "staircase": f"staircase:{state.steps},{low}..{high}um,dwell={dwell}",
        "step": f"staircase:levels={low}/{high}um,dwell={dwell}",
        "raster": (
            f"raster:{rate},{2 * float(half):.5g}/{2 * float(half):.5g}um,lines={state.steps},"
            f"centre={middle}/{middle}um"
        ),
        "spiral": f"spiral:{rate},{half}um,pitch={pitch}um,centre={middle}/{middle}um",
        "file": "",
    }
    return texts[state.kind]


def reference_of(desk: Desk) -> Reference:
    """Return the motion; of a path in the plane the fast axis."""
    state = desk.state.motion
    if state.kind == "file":
        path = desk.file("motion", state.file)
        found: Reference = desk.result("file", stamp(path), lambda: read_reference(path))
        return found
    text = reference_text(desk)
    if state.kind in ("raster", "spiral"):
        home = (range_of(desk)[0], range_of(desk)[0])
        return desk.result("path", [text, home], lambda: parse_path(text, origin=home).x)  # type: ignore[no-any-return]
    return desk.result("reference", text, lambda: parse_reference(text))  # type: ignore[no-any-return]


def margins_of(desk: Desk) -> Margins:
    """Return the margins that the slider from aggressive to robust keeps."""
    share = min(max(desk.state.loop.robustness, 0.0), 1.0)
    sensitivity = float(f"{AGGRESSIVE * (ROBUST / AGGRESSIVE) ** share:.3g}")
    return Margins(sensitivity=sensitivity)


def effort_of(desk: Desk) -> float:
    """Return what a change of the command costs, from the slider from slow to fast [m/V]."""
    share = min(max(desk.state.loop.speed, 0.0), 1.0)
    if share == 1.0:
        return 0.0
    (low, high), reach = limits_of(desk), reach_of(desk)
    return _rounded((reach.high - reach.low) / (high - low) * 10.0 ** (1.0 - 2.0 * share), 1e6)


def tuning_parts(desk: Desk) -> list[str] | None:
    """Return the parts of the controller; None for those that stage and motion need."""
    return ["pid", "low-pass", "repetitive"] if desk.state.loop.repetitive else None


def tuning_settings(desk: Desk) -> dict[str, Any]:
    """Return the arguments of `piezotrack.tune` beside stage and motion."""
    state = desk.state.loop
    model = model_of(desk)
    return {
        "dt": model.dt,
        "limits": limits_of(desk),
        "feedforward": model.inverse(),
        "parts": tuning_parts(desk),
        "margins": margins_of(desk),
        "spread": Spread(gain=state.spread),
        "goal": Goal(effort=effort_of(desk)),
        "timing": Timing(delay=state.delay),
    }


def _key(desk: Desk) -> list[Any]:
    """Return what a tuning depends on."""
    state = desk.state.loop
    kept = [state.speed, state.robustness, state.repetitive, state.delay, state.spread]
    return [
        Same(model_of(desk)),
        kept,
        noise_of(desk),
        reference_text(desk),
        desk.state.motion.file,
    ]


def tuned_of(desk: Desk, *, full: bool) -> Tuned:
    """Tune for the present settings, by the search that answers at once or by the full one."""
    stage = VirtualStage.of(model_of(desk), noise=noise_of(desk), seed=1)
    search = FULL if full else QUICK
    found: Tuned = desk.result(
        "tuned" if full else "quick",
        _key(desk),
        lambda: tune([stage], [reference_of(desk)], search=search, **tuning_settings(desk)),
        lasting=full,
    )
    return found


def known_tuning(desk: Desk) -> tuple[Tuned, bool] | None:
    """Return the best tuning of the present settings so far, and whether it is the full one."""
    for name, full in (("tuned", True), ("quick", False)):
        found = desk.known(name, _key(desk))
        if found is not None:
            return found, full
    return None


class Gains(NamedTuple):
    """Gains and filters of a controller in the state's units; 0 for a filter that is not there."""

    kp: float
    ki: float
    kd: float
    low_pass: float
    notch: float


def gains_of(controller: Controller) -> Gains:
    """Return the gains of a controller."""
    law = controller.feedback
    pid = None if law is None else law._pid
    if pid is None:
        return Gains(0.0, 0.0, 0.0, 0.0, 0.0)
    low = next((one.cutoff for one in controller.filters if isinstance(one, LowPass)), 0.0)
    notch = next((one.frequency for one in controller.filters if isinstance(one, Notch)), 0.0)
    return Gains(pid.kp, pid.kp / pid.ti, pid.kp * pid.td, low, notch)


def by_hand(desk: Desk) -> bool:
    """Whether a gain or a filter is not that of the search."""
    state = desk.state.loop
    return any(
        one is not None for one in (state.kp, state.ki, state.kd, state.low_pass, state.notch)
    )


def controller_of(desk: Desk) -> Controller:
    """Return the controller: that of the search, with what was changed by hand.

    As long as no search of the present settings has ended it is that of the last one, and before
    any the one that follows from the margins alone.
    """
    known = known_tuning(desk)
    if known is not None:
        desk.last_tuned = known[0].controller
    base = desk.last_tuned
    if base is None or base.feedforward is None or base.dt != model_of(desk).dt:
        base = _from_margins(desk)
    key = [Same(base), Same(model_of(desk)), desk.state.loop]
    if by_hand(desk):
        key.append(reference_text(desk))

    def compute() -> Controller:
        own = replace(base, feedforward=model_of(desk).inverse())
        return with_hand(desk, own) if by_hand(desk) else own

    found: Controller = desk.result("controller", key, compute)
    return found


def _from_margins(desk: Desk) -> Controller:
    settings = tuning_settings(desk) | {"parts": None, "goal": Goal()}
    stage = VirtualStage.of(model_of(desk), noise=noise_of(desk), seed=1)
    key = [Same(model_of(desk)), asdict(margins_of(desk)), desk.state.loop.delay]
    found: Controller = desk.result(
        "from margins", key, lambda: tune([stage], **settings).controller
    )
    return found


def with_hand(desk: Desk, base: Controller) -> Controller:
    """Return a controller with the gains and filters that were set by hand."""
    state, gains = desk.state.loop, gains_of(base)
    kp = gains.kp if state.kp is None else state.kp
    ki = gains.ki if state.ki is None else state.ki
    kd = gains.kd if state.kd is None else state.kd
    low = gains.low_pass if state.low_pass is None else state.low_pass
    notch = gains.notch if state.notch is None else state.notch
    filters = [LowPass(low)] if low > 0.0 else []
    kept = next((one for one in base.filters if isinstance(one, Notch)), None)
    if notch > 0.0:
        filters.append(Notch(notch) if kept is None else replace(kept, frequency=notch))  # type: ignore[arg-type]
    law = None if base.feedback is None else base.feedback._pid
    pid = Pid(
        kp=kp,
        ti=kp / ki if ki > 0.0 else math.inf,
        td=kd / kp if kp > 0.0 else 0.0,
        tt=None if law is None or ki == 0.0 else law.tt,
    )
    repetitive = base.repetitive
    if state.repetitive and repetitive is None and (period := reference_of(desk).period):
        repetitive = Repetitive(period=period)
    return replace(base, feedback=pid, filters=filters, repetitive=repetitive)


def straight_line(desk: Desk) -> Inverse:
    """Return a feedforward of constant gain: what there is without a model."""
    model, (low, high) = model_of(desk), limits_of(desk)
    reach = reach_of(desk)
    gain = (reach.high - reach.low) / (high - low)
    line = PrandtlIshlinskiiStage(linear=gain, thresholds=(high - low,), weights=(0.0,))
    # At the lower limit the line is at the lower end of the reach.
    return replace(line.inverse(), offset=reach.low - gain * low, delay=model.delay)


def run_of(desk: Desk, controller: Controller) -> Tracking:
    """Simulate a controller along the motion on the stage."""
    stage, reference = stage_of(desk), reference_of(desk)
    key = [Same(stage), Same(reference), Same(controller), desk.state.loop.delay]
    timing = Timing(delay=desk.state.loop.delay)
    found: Tracking = desk.result(
        "run",
        key,
        lambda: track(
            stage, controller, reference, timing=timing, beyond_reach=True, unstable=True
        ),
    )
    return found


def report_of(desk: Desk, controller: Controller) -> LoopReport:
    """Return stability and margins of a controller on the stage."""
    stage = stage_of(desk)
    key = [Same(stage), Same(controller), desk.state.loop.delay]
    found: LoopReport = desk.result(
        "loop report", key, lambda: check_loop(stage, controller, delay=desk.state.loop.delay)
    )
    return found
