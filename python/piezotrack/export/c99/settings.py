"""Numbers of an exported controller that are changed while it runs."""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

import numpy as np

from ..._support.arguments import expect
from ...control.controller.controller import Controller
from ...errors import ParameterError
from .parts import gains_of
from .text import Part, literal, range_literal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .text import Setting

__all__ = ["VERSION", "layout_of", "settings_of", "settings_part"]

# Of the structure of the settings; another layout of the structure has another.
VERSION = 1


def settings_of(
    controller: Controller, *, single: bool = False, like: Controller | None = None
) -> dict[str, float]:
    """Return the numbers of a controller by name, in the order of the settings of its export.

    A program sends them to a board, which seals them and passes them to ``NAME_retune``.

    Parameters
    ----------
    controller : Controller
        The controller whose numbers are wanted.
    single : bool, optional
        Whether the export has floats: the numbers are rounded to these.
    like : Controller, optional
        The controller that was exported. Its structure, interval, limits and span have to be the
        same, as these stay what they are on the board.

    Returns
    -------
    dict of str to float
        The numbers.

    Raises
    ------
    ParameterError
        The controller has no form in C or no settings, differs from `like` in more than these, or
        a number is out of the range that the export of `like` has for it.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid(kp=1e5, ti=0.5))
    >>> settings = pt.control.settings_of(loop)
    >>> settings["pid_proportional"], round(settings["pid_integral"], 3)
    (100000.0, 4000.0)
    """
    expect("controller", controller, Controller, "pt.Controller")
    expect("like", like, (Controller, type(None)), "pt.Controller")
    settings = _settings(controller)
    if not settings:
        raise ParameterError(
            "controller", "one without feedback, filters and repetitive part", "one with settings"
        )
    # A number that a float cannot have is refused by its name.
    for setting in settings:
        for number in setting.numbers:
            literal(number, setting.name, single=single)
    values = _rounded([number for one in settings for number in one.numbers], single=single)
    if like is not None:
        _check_like(controller, like)
        _check_ranges(values, _settings(like), single=single)
    return dict(zip((name for one in settings for name in one.names), values, strict=True))


def _settings(controller: Controller) -> list[Setting]:
    return [setting for part in gains_of(controller) for setting in part.settings]


def _rounded(values: Sequence[float], *, single: bool) -> list[float]:
    if not single:
        return [float(one) for one in values]
    return [float(one) for one in np.asarray(values, dtype=np.float64).astype(np.float32)]


def _check_like(controller: Controller, like: Controller) -> None:
    """Refuse a controller that differs in more than its settings."""
    mine, others = _structure(controller), _structure(like)
    for key in dict.fromkeys((*others, *mine)):
        if mine.get(key) != others.get(key):
            value, expected = (one.get(key, "none") for one in (mine, others))
            raise ParameterError(
                f"controller, {key},", value, f"{expected}, as the controller that was exported"
            )


def _structure(controller: Controller) -> dict[str, str]:
    """Describe all that a settings image does not change, by name."""
    law, inverse = controller.feedback, controller.feedforward
    unit = controller.drive_unit
    described = {
        "dt": f"{controller.dt!r} s",
        "feedback": "none" if law is None else law.info.title,
        "limits": f"{controller.limits[0]!r} to {controller.limits[1]!r} {unit}",
        "span": f"{controller._valid[0]!r} to {controller._valid[1]!r} m",
        "max_jump": repr(controller.max_jump),
        "feedforward": "none" if inverse is None else repr(inverse),
    }
    for part in gains_of(controller):
        for size in part.sizes:
            described[size.comment] = str(size.value)
        for constant in part.constants:
            described[constant.comment] = repr(constant.value)
        for setting in part.settings:
            described[setting.name] = f"{len(setting.numbers)} numbers, {setting.unit}"
        described[part.file] = ", ".join(part.chooses)
    return described


def _check_ranges(values: Sequence[float], settings: Sequence[Setting], *, single: bool) -> None:
    ends = [(one.low, one.high) for one in settings for _ in one.numbers]
    names = [name for one in settings for name in one.names]
    for name, value, range_ in zip(names, values, ends, strict=True):
        low, high = _rounded(range_, single=single)
        if not low <= value <= high:
            raise ParameterError(name, value, f"{low:g} to {high:g}, the range of the export")


def layout_of(controller: Controller, parts: Sequence[Part], *, single: bool) -> int:
    """Compute the hash of which numbers the settings are.

    Parameters
    ----------
    controller : Controller
        The controller.
    parts : sequence of Part
        Its parts in C.
    single : bool
        Whether numbers are floats.

    Returns
    -------
    int
        CRC-32 of version, type, interval, and of names, units and counts of the numbers and of the
        sizes that their parts have.
    """
    lines = [str(VERSION), "float" if single else "double", float(controller.dt).hex()]
    for part in parts:
        lines += [f"{one.name} {one.unit} {len(one.numbers)}" for one in part.settings]
        if part.settings:
            lines += [f"{one.name} {one.value}" for one in part.sizes]
            lines += [f"{one.name} {one.value!r}" for one in part.constants]
            lines += part.chooses
    return zlib.crc32("\n".join(lines).encode())


def settings_part(controller: Controller, parts: Sequence[Part], *, single: bool) -> Part:
    """Make the functions that change the settings, with names, ranges and what the design has.

    Parameters
    ----------
    controller : Controller
        The controller.
    parts : sequence of Part
        Its other parts, with settings in some of them.
    single : bool
        Whether numbers are floats.

    Returns
    -------
    Part
        It comes last.
    """
    settings = [one for part in parts for one in part.settings]
    places = places_of(parts)
    count = sum(len(one.numbers) for one in settings)
    kept = places.get("PID_PROPORTIONAL", count)
    sizes = {
        "SETTINGS_VERSION": (VERSION, "of the structure"),
        "SETTINGS_LAYOUT": (
            layout_of(controller, parts, single=single),
            "of names, units, sizes and interval",
        ),
    }
    if any("LAW_ANY" in part.chooses for part in parts):
        end = kept + 4 if kept < count else count
        sizes["SETTINGS_KEPT"] = (kept, "the first number that may change with the state kept")
        sizes["SETTINGS_KEPT_END"] = (end, "the first number behind these")
    if "FILTERS" in places:
        sizes["SETTINGS_FILTERS"] = (places["FILTERS"], "the first number of the filters")
    lines = [f"#define {name} {value}u /* {text} */" for name, (value, text) in sizes.items()]
    return Part(
        file="settings.c",
        chooses=("TUNED",),
        text="\n".join(
            [*lines, "", *_defaults(settings, single=single), "", *_list(settings, single=single)]
        ),
    )


def places_of(parts: Sequence[Part]) -> dict[str, int]:
    """Return the place of the first number of each setting."""
    places, count = {}, 0
    for setting in (one for part in parts for one in part.settings):
        places[setting.name] = count
        count += len(setting.numbers)
    return places


def _defaults(settings: Sequence[Setting], *, single: bool) -> list[str]:
    lines = ["/* the numbers of the design */", "static const real SETTINGS_DEFAULT[] = {"]
    for setting in settings:
        for name, number in zip(setting.names, setting.numbers, strict=True):
            text = literal(number, setting.name, single=single).replace(" /*", ", /*", 1)
            lines.append(f"    {text} /* {name} */")
    return [*lines, "};"]


def _list(settings: Sequence[Setting], *, single: bool) -> list[str]:
    lines = ["const NAME_setting NAME_setting_list[NAME_SETTINGS] = {"]
    for setting in settings:
        low, high = (range_literal(one, single=single) for one in (setting.low, setting.high))
        lines += [f'    {{"{name}", "{setting.unit}", {low}, {high}}},' for name in setting.names]
    return [*lines, "};"]
