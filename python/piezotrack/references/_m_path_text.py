"""Paths as text, as the command line takes them: ``circle:0.1Hz,10um``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import ParameterError
from .paths import circle, lissajous, raster, spiral
from .parse import Kind, made_from_text
from .xy_reference import read_path

if TYPE_CHECKING:
    from .xy_reference import XYReference

__all__ = ["parse_path"]

PLACED = {"centre": "displacement", "ramp": "time"}
PATHS = {
    "circle": Kind(
        circle,
        "circle:FREQUENCY,RADIUS[,DURATION][,phase=ANGLE][,centre=X/Y][,ramp=TIME]",
        "circle:0.1Hz,10um",
        {
            ("frequency", ""): ("frequency",),
            ("displacement", ""): ("radius",),
            ("time", ""): ("duration",),
        },
        {"phase": "angle", **PLACED},
        ("frequency", "radius"),
    ),
    "lissajous": Kind(
        lissajous,
        "lissajous:FX/FY,AX/AY[,DURATION][,phase=ANGLE][,centre=X/Y][,ramp=TIME]",
        "lissajous:0.2/0.3Hz,20/20um",
        {
            ("frequency", "/"): ("frequencies",),
            ("displacement", "/"): ("sizes",),
            ("time", ""): ("duration",),
        },
        {"phase": "angle", **PLACED},
        ("frequencies", "sizes"),
    ),
    "raster": Kind(
        raster,
        "raster:RATE,WIDTH/HEIGHT,lines=NUMBER[,flyback=SHARE][,DURATION][,centre=X/Y][,ramp=TIME]",
        "raster:1Hz,20/20um,lines=9",
        {
            ("frequency", ""): ("line_rate",),
            ("displacement", "/"): ("sizes",),
            ("time", ""): ("duration",),
        },
        {"lines": "number", "flyback": "number", **PLACED},
        ("line_rate", "sizes", "lines"),
    ),
    "spiral": Kind(
        spiral,
        "spiral:FREQUENCY,RADIUS,pitch=LENGTH[,centre=X/Y][,ramp=TIME]",
        "spiral:0.5Hz,20um,pitch=2um",
        {("frequency", ""): ("frequency",), ("displacement", ""): ("radius",)},
        {"pitch": "displacement", **PLACED},
        ("frequency", "radius", "pitch"),
    ),
}


def parse_path(text: str, *, duration: float | None = None) -> XYReference:
    r"""Make a path from a text, as the command line takes it.

    =================================  =====================================================
    ``circle:0.1Hz,10um``              frequency and radius; optional duration,
                                       ``phase=90deg``
    ``lissajous:0.2/0.3Hz,20/20um``    frequencies and amplitudes of x and y; optional
                                       duration, ``phase=90deg``
    ``raster:1Hz,20/20um,lines=9``     lines in a second, width and height, lines in a frame;
                                       optional ``flyback=0.25``, duration
    ``spiral:0.5Hz,20um,pitch=2um``    turns in a second, radius, distance of turns
    ``path.csv``                       a file, as `read_path` takes it
    =================================  =====================================================

    All but files take ``centre=58.5/58.5um`` and ``ramp=2s``.

    Parameters
    ----------
    text : str
        The kind and what is to be known of it, as for `parse_reference`.
    duration : float, optional
        Length [s], where `text` has none; not for a spiral, which has its own.

    Returns
    -------
    XYReference
        As `circle`, `lissajous`, `raster`, `spiral` or `read_path` make it.

    Raises
    ------
    ParameterError
        The text cannot be understood, or a value cannot be used. The message shows what was
        expected.
    DataError
        The file cannot be read or used.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.parse_path("circle:0.1Hz,10um,centre=50/50um")
    XYReference(circle 10 um, 0.1 Hz, 40 to 60 by 40 to 60 um, 30 s)
    """
    if duration is not None and str(text).strip().lower().startswith("spiral:"):
        raise ParameterError(
            f"duration is {duration:g} s: expected none, as radius, pitch and frequency of a "
            "spiral are its length"
        )
    path: XYReference = made_from_text("path", text, PATHS, read_path, duration)
    return path
