"""First step: the log, its columns, its window, and what it can determine."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.arrays import runs
from ..._support.units import best_length_unit, length_text, lookup, shown_unit
from ...data import datasets
from ...data.checks.log_info import info
from ...data.reader import read
from ...errors import DataError, PiezotrackError
from ...identification.confidence.suggestion.suggested_drive import suggest_drive
from ...identification.fit import identify
from .. import parts
from ..code import call, command, given, plain
from ..desk import Download, Same
from .device import RECORDING, recording
from .flags import MARKED, ROLES, UNITS, fixes, flags, flags_of, key, key_of, places, to_choose

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from ...data.checks.log_info import ColumnInfo, LogInfo
    from ...data.dataset import Dataset
    from ...identification.confidence.suggestion.suggested_drive import SuggestedDrive
    from ..desk import Desk, Job
    from ..parts import Light, Part
    from ..state import LogState

    Array = NDArray[np.float64]

__all__ = ["LogStep", "columns_of", "info_of", "log_options", "record_of", "stamp", "window_of"]

COLOURS: dict[str, Light] = {"yes": "green", "partly": "amber", "no": "red"}
# Titles of the lights, in their order.
SUBJECTS = {
    "loop": "Loop",
    "minor loops": "Small loops",
    "rate": "Rate or lag",
    "creep": "Creep",
    "mode": "Mode",
    "record": "Record",
}
OPENING = (
    "Drop a log here, or choose a file: CSV, MAT, HDF5, TDMS and others, or the state of this page"
)
# Length of a drive that is suggested [s].
SUGGESTED = 30.0
# Highest frequency of a spectrum with hum, and half of the width of a mark in it [Hz].
HIGHEST, WIDTH = 350.0, 1.5


def columns_of(state: LogState) -> dict[str, Any]:
    """Return the arguments of `info` and `read` for the columns of a log."""
    named = {role: _column(getattr(state, role)) for role in ROLES}
    units = {_column(name): unit for name, unit in state.units.items() if unit}
    return given({**named, "units": units, "dt": state.dt, "missing": state.missing})


def _column(text: str | None) -> str | int | None:
    return int(text) if text is not None and text.isdecimal() else text


def info_of(desk: Desk) -> LogInfo:
    """Describe the log that is open."""
    state = desk.state.log
    path = desk.file("log", state.source)
    settings = [str(path), stamp(path), columns_of(state)]
    found: LogInfo = desk.result("info", settings, lambda: info(path, **columns_of(state)))
    return found


def stamp(path: Any) -> float:
    """Distinguish files of one name that were opened one after the other."""
    return float(path.stat().st_mtime_ns)


def record_of(desk: Desk) -> Dataset:
    """Read the whole record that is open."""
    state = replace(desk.state.log, window=None)
    path = desk.file("log", state.source)

    def compute() -> Dataset:
        log = read(path, **columns_of(state), resample=state.resample, hold=state.hold or "foh")
        log = log if state.decimate <= 1 else log.decimate(state.decimate)
        return log.zeroed() if state.zero else log

    found: Dataset = desk.result("record", [stamp(path), state], compute)
    return found


def window_of(desk: Desk) -> Dataset:
    """Return the part of the record that is used."""

    def compute() -> Dataset:
        log, window = record_of(desk), desk.state.log.window
        return log if window is None else log[window[0] : window[1]]

    found: Dataset = desk.once("window", compute)
    return found


class LogStep:
    """The log."""

    title = "Log"

    def light(self, desk: Desk) -> tuple[Light, str]:
        """Red without a log that can be read, amber where the record determines no loop."""
        if not desk.state.log.source:
            return "grey", "no log yet"
        found = info_of(desk)
        if found.problem and desk.state.log.resample is None:
            return "red", "not read as it is"
        log = window_of(desk)
        words = f"{length_text(log.stroke)}, {1.0 / log.dt:.4g} Hz, {log.duration:.4g} s"
        worst = {one.verdict for one in found.determines if one.subject in ("record", "loop")}
        return ("amber" if worst - {"yes"} else "green"), words

    def page(self, desk: Desk) -> list[Part]:
        """Return the file, its columns, charts, lights and flags."""
        state = desk.state.log
        opening = parts.controls(
            "open",
            "",
            parts.file("log", OPENING),
        )
        example = parts.buttons(
            "example", parts.action("Take the measured example", "log.example", primary=True)
        )
        if not state.source:
            return [
                parts.text(
                    "welcome",
                    "From a log to a controller",
                    "Open the record of a piezo stage: its drive voltage and its displacement. "
                    "The five steps on the left lead to a model, a motion, a tuned loop and files "
                    "for your hardware.",
                    "Nothing leaves this computer: the page talks to a program here, and the file "
                    "is read by it.",
                ),
                opening,
                example,
                *recording(desk),
            ]
        page = [opening, *recording(desk)]
        try:
            found = info_of(desk)
        except PiezotrackError as error:
            return [
                *page,
                parts.messages("fault", parts.message("red", str(error))),
                example,
            ]
        page.append(_columns(state, found))
        try:
            log = record_of(desk)
            part = window_of(desk)
        except PiezotrackError as error:
            words = to_choose(state, found) or str(error)
            fault = parts.message("red", words, *fixes(state, found))
            return [*page, parts.messages("fault", fault)]
        return [
            *page,
            flags(desk, found, log, part),
            _drive_chart(desk, found, log, part),
            _displacement_chart(desk, part),
            _loop_chart(desk, part),
            *_hum_chart(desk, part),
            _lights(found),
            *_next(desk),
            parts.code("code", "The same in Python", "\n".join(self.python(desk))),
            parts.code("command", "and as a command", "\n".join(self.commands(desk))),
        ]

    def python(self, desk: Desk) -> list[str]:
        """Read the log and cut the window."""
        state = desk.state.log
        if not state.source:
            return []
        reading = call(
            "log = pt.read",
            repr(state.source),
            **columns_of(state),
            resample=state.resample,
            hold=state.hold,
        )
        lines = ["import piezotrack as pt", "", reading]
        if state.decimate > 1:
            lines.append(f"log = log.decimate({state.decimate})")
        if state.zero:
            lines.append("log = log.zeroed()")
        if state.window is not None:
            first, last = state.window
            lines.append(f"log = log[{plain(first)}:{plain(last)}]")
        return lines

    def commands(self, desk: Desk) -> list[str]:
        """Describe the log."""
        state = desk.state.log
        return [command("info", state.source, **_reading(state))] if state.source else []

    @property
    def actions(self) -> Mapping[str, Callable[[Desk, Mapping[str, Any]], Download | None]]:
        """The example, the drive to record next, and what a device does."""
        own = {"example": _example, "suggest": _suggest, "suggested": _suggested}
        return {**own, **RECORDING}


def _reading(state: LogState) -> dict[str, Any]:
    """Return the options of the commands that describe a log."""
    return {
        "time": state.time,
        "drive": state.drive,
        "displacement": state.displacement,
        "unit": [f"{name}={unit}" for name, unit in state.units.items() if unit],
        "dt": None if state.dt is None else f"{plain(state.dt)}s",
        "missing": state.missing,
    }


def log_options(state: LogState) -> dict[str, Any]:
    """Return the options of the commands that read a log."""
    window = state.window
    return {
        **_reading(state),
        "resample": None if state.resample is None else f"{plain(state.resample)}s",
        "hold": state.hold,
        "decimate": state.decimate if state.decimate > 1 else None,
        "zero": state.zero,
        "window": None if window is None else f"{plain(window[0])}:{plain(window[1])}",
    }


def _example(desk: Desk, _: Mapping[str, Any]) -> None:
    """Open the measured logs of the package, one to fit and one to test."""
    for purpose, name, log in (
        ("log", "training.csv", datasets.dbo_training()),
        ("test", "tracking.csv", datasets.dbo_tracking()),
    ):
        content = log.save(desk.place("example") / name).read_bytes()
        desk.keep(purpose, name, content)  # type: ignore[arg-type]
    # The first three seconds of both are a transient of an unknown history.
    state = desk.state.changed("log", {"source": "training.csv", "window": (3.0, 23.0)})
    desk.state = state.changed("model", {"test": "tracking.csv", "test_from": 3.0})


def _columns(state: LogState, found: LogInfo) -> Part:
    """Return lists for the columns and their units; what is missing is red."""
    options = [(key(i, one), _title(one)) for i, one in enumerate(found.columns)]
    items = []
    for role, label in ROLES.items():
        chosen = getattr(state, role) or key_of(found, found.roles.get(role, ""))
        needed = role != "time" or (state.dt is None and found.time is None)
        items.append(
            parts.select(
                role,
                label,
                chosen,
                [(None, "not chosen" if needed else "none"), *options],
                missing=needed and chosen is None,
            )
        )
        column = next((c for i, c in enumerate(found.columns) if key(i, c) == chosen), None)
        if column is not None:
            unit = state.units.get(str(chosen)) or column.unit
            known = [one for one in UNITS[role] if lookup(one) is not None]
            known += [unit] if unit and unit not in known else []
            items.append(
                parts.select(
                    f"units.{chosen}",
                    f"Unit of {label.lower()}",
                    unit or None,
                    [(None, "not known"), *((one, one) for one in known)],
                    missing=not unit,
                )
            )
    items.append(
        parts.select(
            "missing",
            "Missing readings",
            state.missing,
            [(None, "refuse"), ("drop", "leave out"), ("fill", "interpolate")],
        )
    )
    holds = [(None, "linear"), ("zoh", "constant")]
    items.append(parts.select("hold", "Drive between samples", state.hold, holds))
    items.append(parts.check("zero", "Count from the first reading", state.zero))
    items.append(parts.number("dt", "Interval, where there are no times", state.dt, "s"))
    title = f"{found.source}: {found.format}, {len(found.columns)} columns"
    return parts.controls("columns", title, *items, step="log")


def _title(column: ColumnInfo) -> str:
    unit = f" [{column.unit}]" if column.unit else ""
    missing = f", {column.missing} missing" if column.missing else ""
    return f"{column.title}{unit}: {column.low:.4g} to {column.high:.4g}{missing}"


def _drive_chart(desk: Desk, found: LogInfo, log: Dataset, part: Dataset) -> Part:
    """Draw the drive, on which the window is brushed."""
    unit, scale = shown_unit(log.drive_unit)
    window = desk.state.log.window or (float(log.t[0]), float(log.t[-1]))
    line = desk.result(
        "drive line",
        [Same(log), desk.plotter.width, desk.plotter.zoom.get("drive")],
        lambda: desk.plotter.over_time("drive", log.t, scale * log.u, "drive", "drive"),
    )
    regions = []
    if found.time is not None and desk.state.log.resample is None:
        regions = [parts.region(a, b, "gap", "bad") for a, b, _ in found.time.gaps[:MARKED]]
    regions += places(desk, part, "clipped")
    span = f"{log.t[0]:.4g} to {log.t[-1]:.4g} s"
    words = (
        f"The drive from {span}, between {scale * log.u.min():.4g} and {scale * log.u.max():.4g} "
        f"{unit}; used from {window[0]:.4g} to {window[1]:.4g} s, {len(part)} samples."
    )
    return parts.chart(
        "drive",
        "Drive: drag over the part to use",
        words,
        ("time", "s"),
        ("drive", unit),
        [line],
        regions=regions,
        brush={"step": "log", "name": "window", "from": window[0], "to": window[1]},
        wide=True,
        height=160,
    )


def _displacement_chart(desk: Desk, part: Dataset) -> Part:
    """Draw the displacement of the window, with readings that are far off or missing."""
    unit, scale = best_length_unit(part.stroke)
    y = part.recorded
    lines = [desk.plotter.over_time("y", part.t, scale * y, "displacement", "measured")]
    regions = []
    if part.left_out is not None:
        regions = [
            parts.region(float(part.t[a]), float(part.t[b - 1]), "missing", "bad")
            for a, b in runs(part.left_out)[:MARKED]
        ]
    regions += [*places(desk, part, "end"), *places(desk, part, "jump")]
    far = np.flatnonzero(part.far)[:MARKED]
    if far.size:
        marks = parts.points(part.t[far], scale * y[far], "far off", "bad", marks=True)
        lines.append(marks)
    words = (
        f"The displacement of the part that is used, over {length_text(part.stroke)}; "
        f"{far.size} readings far off, {len(regions)} ranges missing."
    )
    return parts.chart(
        "y", "Displacement", words, ("time", "s"), ("displacement", unit), lines, regions=regions
    )


def _loop_chart(desk: Desk, part: Dataset) -> Part:
    """Draw the hysteresis loop of the window."""
    unit, scale = best_length_unit(part.stroke)
    drive, times = shown_unit(part.drive_unit)
    line = desk.plotter.in_plane("loop", times * part.u, scale * part.y, "measured", "measured")
    words = (
        f"The hysteresis loop: {length_text(part.stroke)} over {times * np.ptp(part.u):.4g} "
        f"{drive}, displacement over drive."
    )
    return parts.chart("loop", "Loop", words, ("drive", drive), ("displacement", unit), [line])


def _hum_chart(desk: Desk, part: Dataset) -> list[Part]:
    """Draw the spectrum of the quick part of the displacement, where it has hum."""
    quick = next((flag.quick for flag in flags_of(desk, part) if flag.quick), None)
    if quick is None:
        return []
    shown = slice(1, int(np.searchsorted(quick.frequencies, HIGHEST)))
    line = desk.plotter.over_time(
        "hum", quick.frequencies[shown], 1e9 * quick.amplitudes[shown], "displacement", "measured"
    )
    regions = [parts.region(f - WIDTH, f + WIDTH, "hum", "bad") for f, _ in quick.hum]
    words = "The displacement without its loop and what is slower than the mains: " + ", ".join(
        f"{1e9 * size:.3g} nm at {f:.4g} Hz" for f, size in quick.hum
    )
    axes = ("frequency", "Hz"), ("amplitude", "nm")
    return [parts.chart("hum", "Hum", f"{words}.", *axes, [line], regions=regions)]


def _lights(found: LogInfo) -> Part:
    """Return what the record can determine as lights."""
    order = list(SUBJECTS)
    known = sorted(found.determines, key=lambda one: order.index(one.subject))
    items = [(COLOURS[one.verdict], SUBJECTS[one.subject], one.text) for one in known]
    return parts.lights("determines", "What this record can determine", *items)


def _next(desk: Desk) -> list[Part]:
    """Return the drive to record next, or the button that computes it."""
    drive = desk.suggested
    if drive is None or drive[0] != desk.state.log:
        label = "Suggest what to record next"
        running = "suggestion" in desk.running
        return [
            parts.buttons(
                "suggest",
                parts.action("Stop", "stop") if running else parts.action(label, "log.suggest"),
            ),
            *desk.faults("suggestion"),
        ]
    found: SuggestedDrive = drive[1]
    unit, scale = shown_unit(found.drive_unit)
    t = found.dt * np.arange(found.u.size, dtype=np.float64)
    line = desk.plotter.over_time("next", t, scale * found.u, "drive", "drive")
    blocks = ", ".join(dict.fromkeys(found.blocks))
    words = f"A drive of {t[-1]:.3g} s that determines a model better than a sine: {blocks}."
    return [
        parts.chart("next", "Record this next", words, ("time", "s"), ("drive", unit), [line]),
        parts.buttons("next-file", parts.action("Drive as CSV", "log.suggested")),
    ]


def _suggest(desk: Desk, _: Mapping[str, Any]) -> None:
    """Compute the drive to record next, for a model of plays of this record."""
    state, part = desk.state.log, window_of(desk)

    def work(job: Job) -> None:
        fit = identify(part, "prandtl-ishlinskii", progress=False)
        if job.stop.is_set():
            return
        limits = float(part.u.min()), float(part.u.max())
        found = suggest_drive(
            fit,
            limits=limits,
            slew=float(np.abs(np.diff(part.u)).max()) / part.dt,
            seconds=min(SUGGESTED, part.duration),
            dt=part.dt,
        )
        desk.suggested = (state, found)

    desk.start("suggestion", work)


def _suggested(desk: Desk, _: Mapping[str, Any]) -> Download:
    """Write the suggested drive as CSV."""
    if desk.suggested is None:
        raise DataError("no drive has been suggested: expected the button above first")
    path = desk.suggested[1].save(desk.place("suggested") / "suggested.csv")
    return Download(path.name, path.read_bytes())
