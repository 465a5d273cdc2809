"""Second step: the models, fitted side by side and judged on what was not fitted."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.units import best_length_unit, length_text, shown_unit
from ...data.reader import read
from ...errors import DataError, Interrupted, PiezotrackError
from ...identification.comparison.validation import validated
from ...identification.fit import identify
from ...identification.methods.descents import Descents
from ...identification.methods.least_squares import LeastSquares
from ...identification.views.quantities import errors_of, of_sensor, of_stage, predicted
from ...stages.registry import MODELS
from .. import parts
from ..code import Code, call, command, given, plain
from ..desk import Same
from ..state import SHARES
from .log import log_options, record_of, stamp, window_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from ...data.dataset import Dataset
    from ...identification.fitted.certainty.prediction_band import PredictionBand
    from ...identification.fitted.identification import Identification
    from ...identification.fitted.score import Score
    from ...stages.model_info import ModelInfo
    from ..desk import Desk, Download, Job
    from ..parts import Light, Part

__all__ = ["ModelStep", "chosen_trial", "fit_of", "model_options", "test_of"]

# Those that take the least time, first; then all others.
FIRST = ("duhem", "dahl", "prandtl-ishlinskii", "lugre", "bouc-wen")
# Rms error in shares of the stroke below which a model is good, and above which it is not.
GOOD, POOR = 0.005, 0.03


@dataclass
class Trial:
    """One model: how its fit goes on, and how it ended."""

    info: ModelInfo
    fit: Identification | None = None
    score: Score | None = None
    error: str = ""
    seconds: float = 0.0
    running: bool = False
    # Simulations and best cost [m], after each iteration of a search.
    course: list[tuple[int, float]] = field(default_factory=list)
    # What takes time, of a model that is looked at: how far off it may be, and its summary.
    looked_at: bool = False
    band: PredictionBand | None = None
    summary: str = ""


@dataclass
class Trials:
    """All models of one record under the same settings."""

    rows: dict[str, Trial]
    begun: bool = False

    @property
    def done(self) -> list[Trial]:
        """Those that were fitted and judged, the best first."""
        known = [one for one in self.rows.values() if one.score is not None]
        return sorted(known, key=lambda one: one.score.rms if one.score else np.inf)


def parts_of(desk: Desk) -> tuple[Dataset, Dataset, bool]:
    """Return the part that is fitted, the test, and whether they are of one record."""
    state, window = desk.state.model, window_of(desk)
    if state.test:
        return window, test_of(desk), False
    until = _until(window, state.share)
    log = record_of(desk)
    return log[float(window.t[0]) : until], log[until : _end(window)], True


def _until(window: Dataset, share: float) -> float:
    """Return the time until which a window is fitted, on a round number [s]."""
    digits = max(0, 3 - int(np.floor(np.log10(window.duration))))
    return round(float(window.t[0]) + share * window.duration, digits)


def _end(window: Dataset) -> float:
    """Return the time after which a window has no sample, without the last bits of a sum [s]."""
    return float(f"{window.t[-1] + window.dt:.12g}")


def test_of(desk: Desk) -> Dataset:
    """Read the second log, with the columns of the first where it has these titles."""
    state = desk.state.model
    if not state.test:
        raise DataError("there is no second log: drop one in the step Model")
    path = desk.file("test", state.test)

    def compute() -> Dataset:
        log = read(path, missing=desk.state.log.missing, hold=desk.state.log.hold or "foh")
        log = log.zeroed() if desk.state.log.zero else log
        return log if state.test_from <= log.t[0] else log[state.test_from :]

    found: Dataset = desk.result(
        "test",
        [stamp(path), state.test_from, desk.state.log.zero, desk.state.log.hold],
        compute,
    )
    return found


def trials_of(desk: Desk) -> Trials:
    """Return the models of the present settings, fitted or not."""
    found: Trials = desk.once("trials", lambda: _trials(desk))
    return found


def _trials(desk: Desk) -> Trials:
    state = replace(desk.state.model, chosen="")
    log = window_of(desk)
    test = stamp(desk.file("test", state.test)) if state.test else 0.0
    order = {name: i for i, name in enumerate(FIRST)}
    kinds = [one for one in MODELS if one.drive_unit in ("V", log.drive_unit)]
    kinds.sort(key=lambda one: order.get(one.name, len(order)))
    settings = [stamp(desk.file("log", desk.state.log.source)), desk.state.log, state, test]
    trials = Trials({one.name: Trial(one) for one in kinds})
    found: Trials = desk.result("trials", settings, lambda: trials, lasting=True)
    return found


def fit_of(desk: Desk) -> Identification:
    """Return the model that was chosen; else the one with the least error on the test.

    Raises
    ------
    DataError
        No model has been fitted yet.
    """
    found = chosen_trial(desk)
    if found is None or found.fit is None:
        raise DataError("no model is fitted yet: go to the step Model")
    return found.fit


def chosen_trial(desk: Desk) -> Trial | None:
    """Return the chosen model with its fit; None as long as there is none."""
    trials = trials_of(desk)
    chosen = trials.rows.get(desk.state.model.chosen)
    if chosen is not None and chosen.fit is not None:
        return chosen
    return next(iter(trials.done), None)


class ModelStep:
    """The models."""

    title = "Model"

    def light(self, desk: Desk) -> tuple[Light, str]:
        """Green where the error on what was not fitted is small."""
        if not desk.state.log.source:
            return "grey", "needs a log"
        trial = chosen_trial(desk)
        if trial is None or trial.score is None:
            return "grey", "fitting" if "models" in desk.running else "not fitted yet"
        share = trial.score.rms / trial.score.stroke
        light: Light = "green" if share < GOOD else "amber" if share < POOR else "red"
        return light, f"{trial.info.title}, {100.0 * share:.2g} % of stroke"

    def page(self, desk: Desk) -> Iterator[Part]:
        """Return the cards, and loop, error and residual of the chosen model."""
        if not desk.state.log.source:
            yield parts.needs("log", "Open a log first.")
            return
        yield _split(desk)
        trials = trials_of(desk)
        if not trials.begun:
            _begin(desk, {})
        yield from desk.faults("models")
        yield _cards(desk, trials)
        if (course := _convergence(desk, trials)) is not None:
            yield course
        trial = chosen_trial(desk)
        if trial is not None and trial.fit is not None:
            yield from _of_model(desk, trial)
            yield from desk.faults("certainty")
            yield parts.code("code", "The same in Python", "\n".join(self.python(desk)))
            yield parts.code("command", "and as a command", "\n".join(self.commands(desk)))

    def python(self, desk: Desk) -> list[str]:
        """Fit the chosen model and judge it."""
        trial, state = chosen_trial(desk), desk.state.model
        if trial is None:
            return []
        arguments = given(_arguments(desk))
        if trial.info.searched and state.seed:
            arguments["method"] = Code(f"pt.Descents(seed={state.seed})")
        train, test, same = parts_of(desk)
        lines = []
        if same:
            # The window of the first step is narrowed.
            until = plain(_until(window_of(desk), state.share))
            lines.append(f"train = log[{plain(float(train.t[0]))}:{until}]")
            lines.append(f"test = log[{plain(float(test.t[0]))}:]")
        else:
            cut = ".zeroed()" if desk.state.log.zero else ""
            cut += f"[{plain(state.test_from)}:]" if state.test_from else ""
            keywords = given({"missing": desk.state.log.missing, "hold": desk.state.log.hold})
            lines += ["train = log", f"{call('test = pt.read', repr(state.test), **keywords)}{cut}"]
        lines.append(call("fit = pt.identify", "train", repr(trial.info.name), **arguments))
        judged = "fit, score = pt.identification.validated(fit, test)"
        return [*lines, judged, "print(fit.summary())", "print(score)"]

    def commands(self, desk: Desk) -> list[str]:
        """Identify the chosen model."""
        trial = chosen_trial(desk)
        if trial is None:
            return []
        return [command("identify", desk.state.log.source, **model_options(desk, trial.info.name))]

    @property
    def actions(self) -> Mapping[str, Callable[[Desk, Mapping[str, Any]], Download | None]]:
        """Fit again, and leave the second log aside."""
        return {"fit": _begin, "forget": _forget}


def model_options(desk: Desk, name: str) -> dict[str, Any]:
    """Return the options of `piezotrack identify` for the chosen model."""
    state = desk.state.model
    train, test, same = parts_of(desk)
    options = {**log_options(desk.state.log), "model": name}
    if same:
        until = plain(_until(window_of(desk), state.share))
        options["window"] = f"{plain(float(train.t[0]))}:{until}"
        options["test_window"] = f"{until}:{plain(_end(test))}"
    else:
        options["test"] = state.test
        options["test_window"] = f"{plain(state.test_from)}:" if state.test_from else None
    options["history"] = state.history
    words = {True: "fit", False: "none", None: None}
    options["sensor_delay"], options["drift"] = words[state.delay], words[state.drift]
    options["seed"] = state.seed or None
    options["out"] = "results"
    return options


def _arguments(desk: Desk) -> dict[str, Any]:
    """Return the arguments of `identify` that were set."""
    state = desk.state.model
    return {"history": state.history, "delay": state.delay, "drift": state.drift}


def _split(desk: Desk) -> Part:
    """Return what is fitted and what is the test, and the drawer with the rest."""
    state = desk.state.model
    items = []
    if not state.test:
        items.append(parts.slider("share", "Fitted share of the window", state.share, SHARES))
    else:
        items.append(parts.number("test_from", "Test from", state.test_from, "s"))
    items.append(parts.file("test", "Second log as the test: drop or choose a file"))
    histories = [(None, "what the record shows"), ("virgin", "never moved"), ("settled", "settled")]
    fitted = [(None, "where the record shows one"), (True, "fitted"), (False, "none")]
    items += [
        parts.select(
            "history", "Before the record", state.history, [*histories, ("fit", "fitted")]
        ),
        parts.select("drift", "Drift of the sensor", state.drift, fitted),
        parts.select("delay", "Delay of the sensor", state.delay, fitted),
        parts.number("seed", "Seed", state.seed, whole=True),
    ]
    return parts.controls("split", _split_words(desk), *items, step="model")


def _split_words(desk: Desk) -> str:
    """Say what is fitted and what is the test, where both are there."""
    try:
        train, test, same = parts_of(desk)
    except PiezotrackError:
        return "Fit and test"
    fitted = f"{train.t[0]:.4g} to {_end(train):.4g} s"
    tested = f"{test.t[0]:.4g} to {_end(test):.4g} s"
    where = "of the same log" if same else f"of {desk.state.model.test}"
    return f"Fitted: {fitted}. Test: {tested} {where}, which is not fitted."


def _cards(desk: Desk, trials: Trials) -> Part:
    """Return a card for each model, the best first; those that are not fitted yet last."""
    done = trials.done
    chosen = chosen_trial(desk)
    worst = done[-1].score.rms if done and done[-1].score else 1.0
    noise = min((one.fit.noises[0] for one in done if one.fit is not None), default=0.0)
    running = "models" in desk.running
    items = []
    for trial in [*done, *(one for one in trials.rows.values() if one.score is None)]:
        title = trial.info.title
        card: Part = {"title": title[:1].upper() + title[1:], "chosen": trial is chosen}
        if trial.score is not None:
            share = trial.score.rms / trial.score.stroke
            light = "green" if share < GOOD else "amber" if share < POOR else "red"
            card |= {
                "light": light,
                "value": length_text(trial.score.rms, 3),
                "text": f"{100.0 * share:.3g} % of stroke, {trial.seconds:.2g} s to fit",
                "share": trial.score.rms / worst,
                "mark": noise / worst,
                "choose": {"chosen": trial.info.name},
            }
        elif trial.error:
            card |= {"light": "red", "value": "\N{EN DASH}", "text": trial.error}
        elif trial.running:
            cost = f", {length_text(trial.course[-1][1], 3)}" if trial.course else ""
            card |= {
                "light": "grey",
                "value": "fitting" if running else "stopping",
                "text": f"{len(trial.course)} iterations{cost}",
            }
        else:
            card |= {"light": "grey", "value": "waits" if running else "stopped", "text": ""}
        items.append(card)
    words = f"Error on the test, rms; the mark is the noise of the sensor, {length_text(noise, 3)}"
    page = parts.cards("cards", words if done else "Models, quickest first", *items, step="model")
    page["buttons"] = [] if running else [parts.action("Fit again", "model.fit")]
    return page


def _convergence(desk: Desk, trials: Trials) -> Part | None:
    """Draw the best cost of the searches, as long as they run."""
    if "models" not in desk.running:
        return None
    known = [one for one in trials.rows.values() if len(one.course) > 1]
    if not known:
        return None
    unit, scale = best_length_unit(min(one.course[-1][1] for one in known))
    roles = ("first", "second", "third", "error", "true", "measured")
    lines = [
        parts.points(*_columns(one, scale), one.info.title, roles[i % len(roles)], steps=True)
        for i, one in enumerate(known)
    ]
    words = f"The rms error of {len(known)} searches as they go on."
    return parts.chart(
        "convergence",
        "Convergence of the searches",
        words,
        ("simulations", ""),
        ("rms error", unit),
        lines,
        log="xy",
        wide=True,
        height=220,
    )


def _columns(trial: Trial, scale: float) -> tuple[Any, Any]:
    """Return simulations and errors; the line is broken where the next search counts from 1."""
    course = np.array(trial.course)
    begun = np.flatnonzero(np.diff(course[:, 0]) < 0) + 1
    course = np.insert(course, begun, np.nan, axis=0)
    return np.maximum(course[:, 0], 1.0), scale * course[:, 1]


def _of_model(desk: Desk, trial: Trial) -> list[Part]:
    """Return loop with band, error, residual, and the quantities of a model."""
    fit, (_, test, _) = trial.fit, parts_of(desk)
    if fit is None:
        return []
    if not trial.looked_at and not {"models", "certainty"} & set(desk.running):
        _look_at(desk, trial, fit, test)
    key = [Same(fit), Same(test)]
    x = desk.result("test run", key, lambda: fit.simulate(test).x)
    unit, scale = best_length_unit(test.stroke)
    drive, times = shown_unit(test.drive_unit)
    measured, simulated, t = scale * test.recorded, scale * x, test.t
    plot = desk.plotter
    error = test.recorded - x
    fine, to_fine = best_length_unit(float(np.nanmax(np.abs(error))))
    rms = f"{to_fine * np.sqrt(np.nanmean(error**2)):.3g} {fine} rms"
    loop = [
        plot.in_plane("m-loop", times * test.u, measured, "measured", "measured"),
        plot.in_plane("m-loop", times * test.u, simulated, "model", "simulated"),
    ]
    lines = [plot.over_time("m-error", t, to_fine * error, "measured less model", "error")]
    if trial.band is not None:
        edges = (simulated + way * scale * trial.band.half for way in (1.0, -1.0))
        loop[:0] = [
            plot.in_plane("m-loop", times * test.u, edge, "band of 95 %", "noise") for edge in edges
        ]
        half = to_fine * trial.band.half
        kept = plot.kept("m-error", t, half)
        lines.append(parts.band(t[kept], -half[kept], half[kept], "band of 95 %", "noise"))
    pictures = [
        parts.chart(
            "m-loop",
            f"Loop on the test: {trial.info.title}",
            f"The measured loop of the test and that of the model, {rms} apart.",
            ("drive", drive),
            ("displacement", unit),
            loop,
        ),
        parts.chart(
            "m-error",
            "Error over time",
            f"Measured less model on the test, {rms}.",
            ("time", "s"),
            ("error", fine),
            lines,
        ),
        parts.chart(
            "m-residual",
            "Residual over drive",
            "What the model leaves, over the drive: a level band where it is noise alone.",
            ("drive", drive),
            ("error", fine),
            [
                plot.in_plane(
                    "m-residual", times * test.u, to_fine * error, "residual", "error", dots=True
                )
            ],
        ),
    ]
    rows = desk.result("quantities", key, lambda: _quantities(trial, fit))
    notes = [parts.message("amber", note) for note in fit.notes]
    notes += [parts.message("amber", note) for note in (trial.score.notes if trial.score else ())]
    table = parts.table("quantities", "The stage", ("", ""), rows)
    page = [*pictures, table, *([parts.messages("notes", *notes)] if notes else [])]
    if trial.summary:
        page.append(parts.code("summary", "All parameters, with what is sure", trial.summary))
    return page


def _quantities(trial: Trial, fit: Identification) -> list[tuple[str, str]]:
    """Return the quantities of the stage and the errors; +- is half of the interval of 95 %."""
    rows = [*of_stage(fit), *of_sensor(fit.records[0], fit.data), *errors_of(fit, 0)]
    return [*rows, *predicted(fit), ("on the test", str(trial.score))]


def _look_at(desk: Desk, trial: Trial, fit: Identification, test: Dataset) -> None:
    """Compute how far off a model may be, and its summary, in the background."""
    trial.looked_at = True

    def work(job: Job) -> None:
        trial.band = fit.prediction_band(test)
        job.changed()
        trial.summary = fit.summary()

    desk.start("certainty", work)


def _begin(desk: Desk, _: Mapping[str, Any]) -> None:
    """Fit all models that are not fitted yet, one after the other."""
    trials, (train, test) = trials_of(desk), parts_of(desk)[:2]
    trials.begun = True
    method = (Descents(seed=desk.state.model.seed), LeastSquares())
    arguments: dict[str, Any] = {**given(_arguments(desk)), "method": method}

    def work(job: Job) -> None:
        for trial in trials.rows.values():
            if job.stop.is_set():
                break
            if trial.fit is None:
                _fit(trial, train, test, arguments, job)

    desk.start("models", work)


def _fit(trial: Trial, train: Dataset, test: Dataset, arguments: dict[str, Any], job: Job) -> None:
    """Fit and judge one model; what is stopped is left as it was."""
    begun = time.monotonic()
    trial.running, trial.error, trial.course = True, "", []

    def progress(step: Any) -> bool:
        trial.course.append((step.nfev, step.cost))
        job.changed()
        return job.stop.is_set()

    if trial.info.searched:
        arguments = {**arguments, "callback": progress}
    job.changed()
    try:
        fit = identify(train, trial.info.name, progress=False, **arguments)
        fit, score = validated(fit, test)
        # The fit last: what is there is shown.
        trial.score, trial.fit = score, fit
    except Interrupted:
        pass
    except PiezotrackError as error:
        trial.error = str(error)
    finally:
        trial.seconds, trial.running = time.monotonic() - begun, False
        job.changed()


def _forget(desk: Desk, _: Mapping[str, Any]) -> None:
    desk.forget("test")
    desk.state = desk.state.changed("model", {"test": "", "test_from": 0.0})
