"""Controllers of feedforward, feedback and repetitive control."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar, runtime_checkable

from ... import _core
from ..._support.arguments import TOO_FAR, expect, number_pair, one_of
from ..._support.arrays import check_dt
from ..._support.files.writing import write_document
from ..._support.units import shown_unit
from ...errors import NumericalError, ParameterError
from ...identification.fitted.identified_model import IdentifiedModel
from ...stages.inverse import Inverse
from ..parts.filters import Filter, LowPass
from ..parts.part import FeedbackLaw
from ..parts.repetitive import Repetitive
from ..plant import displacement_range
from .session import Session

if TYPE_CHECKING:
    import os
    from pathlib import Path

__all__ = ["Controller", "DesignReport"]

FORMAT = "piezotrack-controller"
SCHEMA_VERSION = 1
# Sampling interval for the reach of a stage [s]: its drive takes seconds.
REACH_STEP = 0.05
DRIVE_UNITS = ("V", "m", "N")
# Readings are valid up to this distance from 0 where nothing is known of the stage [m].
WIDEST = 0.01


@runtime_checkable
class DesignReport(Protocol):
    """Report of the margins of controllers, as `check_loop` and `tune` return it."""

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """The controllers."""

    def design(self) -> dict[str, Any]:
        """Margins for the file of the controller: numbers, texts, lists and dicts only."""


@dataclass(frozen=True, kw_only=True)
class Controller:
    """Feedforward, feedback and repetitive part, clipped to the limits of the amplifier.

    ``u = uFB + uFF + uRC``, and the command is ``v = clip(u)``.

    Parameters
    ----------
    dt : float
        Sampling interval [s].
    limits : (float, float)
        Lowest and highest voltage [V].
    feedforward : Inverse, optional
        From ``fit.inverse()`` or ``stage.inverse()``.
    feedback : Pid, StateSpace or another law of `piezotrack.control`
        The feedback law, optional.
    repetitive : Repetitive, optional
        Repetitive control, for a reference that repeats.
    filters : sequence of LowPass or Notch, optional
        Up to two, on the measurement, one after the other.
    span : (float, float), optional
        Lowest and highest displacement that the sensor can show [m], at most a metre from 0. A
        reading outside is no measurement and is treated as NaN: instruments report overload as
        9.9e37. By default what the stage of `feedforward` reaches between the limits, with as much
        again at each end; without feedforward -10 to 10 mm.
    max_jump : float, optional
        Largest displacement in a sampling interval [m]. A reading further from the last valid one
        is no measurement either; the distance allowed grows with each sample without one. The first
        reading is believed.
    drive_unit : {"V", "m", "N"}, optional
        Unit of limits and commands, for what is printed: ``"m"`` where a position is commanded, as
        the height of a piezo. Gains are then in m/m.

    Raises
    ------
    ParameterError
        A number is out of its range; `kp` or `kq` is so large or small that its unit must be wrong.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(
    ...     dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.from_um(kp=0.120, ti=0.009, td=0.044)
    ... )
    >>> session = loop.start()
    >>> print(f"{session.step(1e-6, 0.0):.3f} V")
    0.267 V
    """

    dt: float
    limits: tuple[float, float]
    feedforward: Inverse | None = None
    feedback: FeedbackLaw | None = None
    repetitive: Repetitive | None = None
    filters: Sequence[Filter] = ()
    span: tuple[float, float] | None = None
    max_jump: float | None = None
    drive_unit: str = "V"
    # Readings that are valid [m], also where `span` is not given.
    _valid: tuple[float, float] = field(init=False, repr=False, compare=False)
    _core: _core.Controller = field(init=False, repr=False, compare=False)
    _provenance: Mapping[str, Any] | None = field(
        default=None, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        dt = check_dt(self.dt)
        one_of("drive_unit", self.drive_unit, DRIVE_UNITS)
        low, high = number_pair("limits", self.limits, self.drive_unit)
        object.__setattr__(self, "limits", (low, high))
        nothing = type(None)
        expect("feedforward", self.feedforward, (Inverse, nothing), "pt.Inverse")
        expect(
            "feedback",
            self.feedback,
            (FeedbackLaw, nothing),
            "pt.Pid, pt.control.StateSpace or another law of pt.control",
        )
        expect("repetitive", self.repetitive, (Repetitive, nothing), "pt.Repetitive")
        expect("filters", self.filters, Sequence, "a list of filters")
        for i, part in enumerate(self.filters):
            expect(f"filters[{i}]", part, Filter, "pt.LowPass or pt.Notch")
            if isinstance(part, LowPass) and part.cutoff * dt > 0.5 * (1.0 + 1e-9):
                half = f"at most half the sampling rate, {0.5 / dt:.6g} Hz"
                raise ParameterError("cutoff", f"{part.cutoff:g} Hz", half)
        inside = None if self.feedback is None else self.feedback._pid
        if inside is not None:
            _check_unit("kp", inside.kp, high - low, "Pid", self.drive_unit)
        if self.repetitive is not None:
            _check_unit("kq", self.repetitive.kq, high - low, "Repetitive", self.drive_unit)
        span = self._span(low, high)
        core = _core.Controller(
            dt=dt,
            limits=(low, high),
            span=span,
            max_jump=None if self.max_jump is None else _core.as_number("max_jump", self.max_jump),
            law=None if self.feedback is None else self.feedback._settings,
            repetitive=None if self.repetitive is None else self.repetitive._settings,
            filters=[one._settings for one in self.filters],
            follows=self.feedforward is not None,
        )
        object.__setattr__(self, "_core", core)
        object.__setattr__(self, "_valid", span or (-WIDEST, WIDEST))

    @classmethod
    def of(
        cls,
        model: IdentifiedModel,
        *,
        dt: float | None = None,
        limits: tuple[float, float] | None = None,
        playback: Literal["table", "online"] = "table",
        feedback: FeedbackLaw | None = None,
        repetitive: Repetitive | None = None,
        filters: Sequence[Filter] = (),
        span: tuple[float, float] | None = None,
        max_jump: float | None = None,
    ) -> Controller:
        """Make a controller with the feedforward of an identified model, for its stage.

        Parameters
        ----------
        model : IdentifiedModel
            Identified model, from ``pt.identify`` or ``pt.load``.
        dt : float, optional
            Sampling interval [s]; default that of the record identified.
        limits : (float, float), optional
            Lowest and highest voltage [V]; default the range of the drive of that record.
        playback : {"table", "online"}, optional
            As in `Inverse`.
        feedback, repetitive, filters, span, max_jump : optional
            As in the class.

        Returns
        -------
        Controller
            With these parts.

        Raises
        ------
        ParameterError
            The file of the model has no record, and `dt` or `limits` is not given.

        Examples
        --------
        >>> import piezotrack as pt
        >>> fit = pt.identify(pt.datasets.dbo_training()[3.0:23.0], "prandtl-ishlinskii")
        >>> loop = pt.Controller.of(fit)
        >>> loop.dt, loop.limits
        (0.005, (0.0, 3.6))
        """
        expect("model", model, IdentifiedModel, "what pt.identify or pt.load returns")
        return cls(
            dt=_of_record("dt", dt, model.dt),
            limits=_of_record("limits", limits, model.drive_range),
            feedforward=model.inverse(playback=playback),
            feedback=feedback,
            repetitive=repetitive,
            filters=filters,
            span=span,
            max_jump=max_jump,
            drive_unit=model.drive_unit,
        )

    def __repr__(self) -> str:
        low, high = self.limits
        count = len(self.filters)
        filters = f", {count} filter{'s' if count > 1 else ''}" if count else ""
        unit, scale = shown_unit(self.drive_unit)
        return (
            f"Controller({self.title}, {1.0 / self.dt:.6g} Hz, "
            f"{scale * low:g} to {scale * high:g} {unit}{filters})"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        # The core's controller is made again.
        given = {one.name: getattr(self, one.name) for one in fields(self) if one.init}
        return _made, (type(self), given)

    def _span(self, low: float, high: float) -> tuple[float, float] | None:
        """Range of valid readings [m] for limits [V]; None for that of the core."""
        if self.span is not None:
            return number_pair("span", self.span, "m")
        if self.feedforward is None:
            return None
        try:
            bottom, top = displacement_range(self.feedforward.stage, (low, high), REACH_STEP)
        except NumericalError:
            return None
        bottom, top = bottom + self.feedforward.offset, top + self.feedforward.offset
        wide = top - bottom
        span = max(bottom - wide, -TOO_FAR), min(top + wide, TOO_FAR)
        return span if span[0] < span[1] else None

    def start(self, *, present: float | None = None) -> Session:
        """Start a session with its own state.

        Parameters
        ----------
        present : float, optional
            Voltage at the stage now [V], for a bumpless start of the feedback. By default it begins
            at 0 V. Without feedback the first command is the feedforward, whatever is there.

        Returns
        -------
        Session
            To be stepped once in each sampling interval.
        """
        return Session(self, present)

    @property
    def provenance(self) -> Mapping[str, Any] | None:
        """Where the file came from that the controller was read from; None without a file."""
        return self._provenance

    @property
    def title(self) -> str:
        """Names of the parts, such as feedforward (Prandtl-Ishlinskii) + PID."""
        parts = []
        if self.feedforward is not None:
            parts.append(f"feedforward ({self.feedforward.stage.info.title})")
        if self.feedback is not None:
            parts.append(self.feedback.info.title)
        if self.repetitive is not None:
            parts.append(self.repetitive.info.title)
        return " + ".join(parts) or "no control"

    def document(self, *, report: DesignReport | None = None) -> dict[str, Any]:
        """Content of the file of the controller.

        Parameters
        ----------
        report : LoopReport or Tuned, optional
            As in `save`.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.

        Raises
        ------
        ParameterError
            `report` is of another controller, or the feedforward is none that a file can hold.
        """
        from ..parts.file_entries import part_entry
        from .controller_file import digest, inverse_entry

        drive, law, learner = self.drive_unit, self.feedback, self.repetitive
        forward = inverse_entry(self.feedforward, drive)
        jump = None if self.max_jump is None else float(self.max_jump)
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "drive_unit": drive,
            "dt_s": float(self.dt),
            f"limits_{drive}": list(self.limits),
            "span_m": None if self.span is None else [float(end) for end in self.span],
            "max_jump_m": "inf" if jump == math.inf else jump,
            "feedforward": forward,
            "feedback": None if law is None else part_entry(law, drive),
            "repetitive": None if learner is None else part_entry(learner, drive),
            "filters": [part_entry(filter_, drive) for filter_ in self.filters],
            "provenance": {
                "package": "piezotrack",
                "version": _core.__version__,
                "model_sha256": None if forward is None else digest(forward["stage"]),
                "design": self._design(report),
            },
        }

    def _design(self, report: DesignReport | None) -> dict[str, Any] | None:
        """Margins at design: of a report, or else of the file that this was read from."""
        if report is None:
            return None if self.provenance is None else self.provenance.get("design")
        expect("report", report, DesignReport, "what pt.check_loop or pt.tune returns")
        if self not in report.controllers:
            raise ParameterError("report", "of another controller", "that of this one")
        return report.design()

    def save(self, path: str | os.PathLike[str], *, report: DesignReport | None = None) -> Path:
        """Write the controller as JSON, for `load_controller` and for ``piezotrack export``.

        Settings have their units in their names. The file says by which version it was written, the
        hash of the stage of the feedforward, and the margins at design where `report` is given. It
        is written to a temporary file and renamed.

        Parameters
        ----------
        path : path-like
            The file.
        report : LoopReport or Tuned, optional
            Margins of this controller, from `check_loop` or `tune`. Without a report the margins of
            the file that the controller was read from are kept.

        Returns
        -------
        pathlib.Path
            The file.

        Raises
        ------
        ParameterError
            `report` is of another controller.
        DataError
            The file cannot be written.

        Examples
        --------
        >>> import piezotrack as pt
        >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
        >>> margins = pt.check_loop(pt.VirtualStage.xu_li_2010(), loop)
        >>> loop.save("loop.json", report=margins).name
        'loop.json'
        """
        return write_document(path, self.document(report=report))


T = TypeVar("T")


def _of_record(name: str, given: T | None, known: T | None) -> T:
    """Take what is given, or what the record of a model has."""
    if given is not None:
        return given
    if known is None:
        raise ParameterError(name, "not in the file of this model", f"{name}=")
    return known


def _made(kind: type[Controller], settings: dict[str, Any]) -> Controller:
    return kind(**settings)


def _check_unit(name: str, gain: float, span: float, owner: str, unit: str) -> None:
    """Refuse a gain that no nanopositioner can have: full span for 10 nm, or a trace for 1 mm."""
    if abs(gain) * 1e-8 > span:
        raise ParameterError(
            name,
            f"{gain:g} {unit}/m",
            f"a gain with which 10 nm of error asks for less than the whole range of {span:g} "
            f"{unit}; {1e-6 * gain:g} {unit}/m is {1e-12 * gain:g} {unit}/um",
        )
    if 0.0 < abs(gain) * 1e-3 < 1e-3 * span:
        raise ParameterError(
            name,
            f"{gain:g} {unit}/m",
            "a gain with which 1 mm of error asks for more than a thousandth of the range; if "
            f"it is in {unit}/um, write pt.{owner}.from_um({name}={gain:g}, ...)",
        )
