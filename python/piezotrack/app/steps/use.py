"""Fifth step: what is taken away, for hardware, papers and scripts."""

from __future__ import annotations

import io
import json
import zipfile
from typing import TYPE_CHECKING, Any

from ..._support.files.writing import write_columns
from ..._support.units import drive_word, shown_unit
from ...control.controller.load import load_controller
from ...errors import DataError, ParameterError
from ...export.write import export_controller
from .. import parts
from ..code import Code, call, command
from ..desk import Download, drawing
from .closed_loop import (
    by_hand,
    controller_of,
    known_tuning,
    limits_of,
    model_of,
    reference_of,
    report_of,
    tuned_of,
)
from .log import LogStep
from .loop import LoopStep, stable
from .model import ModelStep, chosen_trial, fit_of
from .motion import beyond_reach, is_beyond, motion_word
from .on_device import RUNNING, running

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from ..desk import Desk
    from ..parts import Light, Part

__all__ = ["UseStep"]

FORMS = {
    "c99": "C99, alone",
    "library": "C with libpiezotrack",
    "json": "coefficients",
    "fmu": "FMU for co-simulation",
}
# Date of the files in an archive: the same result gives the same archive.
DATE = (1980, 1, 1, 0, 0, 0)


class UseStep:
    """Files for hardware, papers and scripts."""

    title = "Use"

    def light(self, desk: Desk) -> tuple[Light, str]:
        """Green where there is a tuned loop, amber where there is a model only."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return "grey", "needs a model"
        if known_tuning(desk) is None and not by_hand(desk):
            return "amber", "model only, loop not tuned"
        controller = controller_of(desk)
        if not stable(desk, report_of(desk, controller)):
            return "red", "the loop is unstable"
        return "green", "model and controller"

    def page(self, desk: Desk) -> Iterator[Part]:
        """Return the files, the pictures, and the script and the commands of all steps."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            yield parts.needs("model", "Fit a model first.")
            return
        use = desk.state.use
        tuning = "tuning" in desk.running
        if tuning:
            yield parts.messages("wait", parts.message("grey", WAIT))
        form = parts.controls(
            "form",
            "Controller for firmware and other programs",
            parts.select("to", "Form", use.to, list(FORMS.items())),
            parts.entry("name", "Name of files and functions", use.name),
            parts.check("single", "Numbers of 4 bytes", use.single),
            step="use",
        )
        form["buttons"] = [parts.action("Export", "use.export", primary=True, disabled=tuning)]
        yield form
        yield parts.buttons(
            "files",
            parts.action("Controller", "use.controller", disabled=tuning),
            parts.action("Model", "use.model"),
            parts.action("Voltage as a table", "use.table"),
            parts.action("Motion", "motion.csv"),
            parts.action("Report", "use.report"),
            parts.action("Script", "use.script"),
            parts.action("State of this page", "use.state"),
        )
        if items := beyond_reach(desk):
            yield parts.messages("warnings", *items)
        yield from running(desk)
        yield parts.controls(
            "pictures",
            "Pictures: each chart of the page has a button for its file",
            parts.select("width", "Width", use.width, [(85, "85 mm"), (170, "170 mm")]),
            parts.select("picture", "Format", use.picture, [(f, f) for f in ("pdf", "svg", "png")]),
            step="use",
        )
        script, lines = "\n".join(self.python(desk)), "\n".join(self.commands(desk))
        yield parts.code("script", "All steps in Python", script, open=True)
        yield parts.code("commands", "and as commands", lines, open=True)

    def python(self, desk: Desk) -> list[str]:
        """Return the script of all steps."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return []
        use = desk.state.use
        name = model_of(desk).model.info.name
        report = "tuned" if not by_hand(desk) else "pt.check_loop(stage, controller)"
        periodic = reference_of(desk).period is not None
        exported = call(
            "pt.control.export_controller",
            "controller",
            repr("firmware"),
            to=use.to,
            name=use.name,
            single=use.single or None,
            reference=REFERENCE if periodic else None,
            beyond_reach=(periodic and is_beyond(desk)) or None,
        )
        return [
            *LogStep().python(desk),
            *ModelStep().python(desk),
            *LoopStep().python(desk),
            f'fit.save("{name}.json")',
            f'controller.save("controller.json", report={report})',
            exported,
        ]

    def commands(self, desk: Desk) -> list[str]:
        """Return the commands of all steps."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return []
        use = desk.state.use
        motion = [motion_word(desk)] if reference_of(desk).period is not None else []
        where = "controller.json" if by_hand(desk) else "tuned/controller.json"
        options = {"to": use.to, "name": use.name, "float": use.single, "out": "firmware"}
        free = bool(motion) and is_beyond(desk)
        exported = command("export", where, *motion, **options, beyond_reach=free)
        note = ["# controller.json: by the script, as its gains were set by hand"]
        return [
            *ModelStep().commands(desk),
            *LoopStep().commands(desk),
            *(note if by_hand(desk) else []),
            exported,
        ]

    @property
    def actions(self) -> Mapping[str, Callable[[Desk, Mapping[str, Any]], Download | None]]:
        """The files."""
        return {
            "export": _export,
            "controller": _controller,
            "model": _model,
            "table": _table,
            "report": _report,
            "script": _script,
            "state": _state,
            **RUNNING,
        }


WAIT = "the search for the gains goes on: the controller can be taken when it has ended"
REFERENCE = Code("reference")


def _controller_file(desk: Desk) -> Path:
    """Write the file of the controller, as `piezotrack tune` does."""
    if "tuning" in desk.running:
        raise DataError(WAIT)
    controller = controller_of(desk)
    path = desk.place("controller") / "controller.json"
    report: Any = report_of(desk, controller)
    if not stable(desk, report):
        raise DataError("the loop is unstable: expected other gains, as Tune finds them")
    if not by_hand(desk):
        report = tuned_of(desk, full=True)
        controller = report.controller
    return controller.save(path, report=report)


def _controller(desk: Desk, _: Mapping[str, Any]) -> Download:
    path = _controller_file(desk)
    return Download(path.name, path.read_bytes())


def _model(desk: Desk, _: Mapping[str, Any]) -> Download:
    """Write the file of the model, as `piezotrack identify` does."""
    fit = fit_of(desk)
    path = fit.save(desk.place("model-file") / f"{fit.model.info.name}.json")
    return Download(path.name, path.read_bytes())


def _export(desk: Desk, _: Mapping[str, Any]) -> Download:
    """Export the controller, as `piezotrack export` does."""
    use, motion = desk.state.use, reference_of(desk)
    controller = load_controller(_controller_file(desk))
    done = export_controller(
        controller,
        desk.place("export"),
        to=use.to,
        name=use.name,
        single=use.single,
        reference=motion if motion.period is not None else None,
        beyond_reach=True,
    )
    if len(done.files) == 1:
        return Download(done.files[0].name, done.files[0].read_bytes())
    return _archive(f"{use.name}.zip", {one.name: one.read_bytes() for one in done.files})


def _archive(name: str, contents: Mapping[str, bytes]) -> Download:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, content in contents.items():
            archive.writestr(zipfile.ZipInfo(file, DATE), content)
    return Download(name, packed.getvalue())


def _table(desk: Desk, _: Mapping[str, Any]) -> Download:
    """Write time, voltage of the inverse and displacement, as `piezotrack feedforward` does."""
    model, motion, limits = model_of(desk), reference_of(desk), limits_of(desk)
    interval = model.dt or 1.0
    samples = motion.sample(interval)
    voltage, _how = model.inverse().played(motion, interval, samples=samples, limits=limits)
    unit, scale = shown_unit(model.drive_unit)
    columns = {
        "time_s": samples.t,
        f"{drive_word(model.drive_unit)}_{unit}": scale * voltage.clip(*limits),
        "displacement_um": 1e6 * samples.x,
    }
    path = write_columns(desk.place("table") / "feedforward.csv", columns)
    return Download(path.name, path.read_bytes())


def _report(desk: Desk, _: Mapping[str, Any]) -> Download:
    """Write the report for readers who do not know the package."""
    known = known_tuning(desk)
    fit = fit_of(desk)
    with drawing:
        path = fit.report(
            desk.place("report") / f"{fit.model.info.name}.html",
            controller=None if known is None or by_hand(desk) else known[0],
        )
    return Download(path.name, path.read_bytes())


def _script(desk: Desk, _: Mapping[str, Any]) -> Download:
    lines = UseStep().python(desk)
    if not lines:
        raise ParameterError("there is nothing to repeat yet: expected a model first")
    return Download("piezotrack_steps.py", ("\n".join(lines) + "\n").encode())


def _state(desk: Desk, _: Mapping[str, Any]) -> Download:
    text = json.dumps(desk.state.document(), indent=1)
    return Download("page.piezotrack.json", (text + "\n").encode())
