"""Size and style of pictures, from the caller down to each panel and file."""

from __future__ import annotations

import re
import warnings
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import wraps
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeAlias, TypeVar, get_args

from ...errors import ParameterError
from ..arguments import has_entries, positive
from ..messages import quoted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.axes import Axes

    P = ParamSpec("P")
    R = TypeVar("R")

__all__ = [
    "CHOSEN",
    "FORMATS",
    "Chosen",
    "Look",
    "Style",
    "Width",
    "drawing",
    "figure_style",
    "look",
    "looking",
    "without_glyph_warnings",
]

Style: TypeAlias = Literal["screen", "paper"]
Width: TypeAlias = "str | float"
FORMATS = ("png", "svg", "pdf")
INCH = 0.0254
# A column of most journals.
COLUMN = 0.085 / INCH
WIDTHS = (0.02 / INCH, 1.0 / INCH)
_WIDTH = re.compile(r"\s*([0-9.]+)\s*(mm|cm|in)\s*")
_INCHES = {"mm": 1e-3 / INCH, "cm": 1e-2 / INCH, "in": 1.0}


@dataclass(frozen=True)
class Look:
    """How pictures are drawn and saved.

    Attributes
    ----------
    style : {"screen", "paper"}
        In a paper the letters have 8 points, lines are thin, and the caption is the title.
    width : float or None
        Width of new figures [inch]; None for that of each picture.
    formats : tuple of str
        Endings of the files.
    """

    style: Style = "screen"
    width: float | None = None
    formats: tuple[str, ...] = ("png", "svg")

    @property
    def paper(self) -> bool:
        """Whether pictures are for a paper."""
        return self.style == "paper"

    @property
    def settings(self) -> Any:
        """Settings of Matplotlib while something is drawn."""
        if not self.paper:
            return {}
        thin = {"axes.linewidth": 0.6, "legend.handlelength": 1.6, "axes.labelpad": 2.0}
        ticks = {f"{axis}tick.{of}.width": 0.6 for axis in "xy" for of in ("major", "minor")}
        return {"font.size": 8.0, **thin, **ticks}

    @property
    def dots(self) -> int:
        """Dots per inch of a PNG."""
        return 300 if self.paper else 150

    def size(self, width: float, height: float) -> tuple[float, float]:
        """Scale the size of a picture on a screen [inch] to the width wanted."""
        wanted = self.width or (COLUMN if self.paper else width)
        return wanted, height * wanted / width

    def changed(self, style: object, width: object, formats: object = None) -> Look:
        """Return this look with what is given in its place."""
        new = self
        if style is not None:
            if style not in get_args(Style):
                raise ParameterError("style", quoted(style), "'screen' or 'paper'")
            new = replace(new, style=style)  # type: ignore[arg-type]
        if width is not None:
            new = replace(new, width=_inches(width))
        if formats is not None:
            new = replace(new, formats=_endings(formats))
        return new


SCREEN = Look()
_LOOK: ContextVar[Look] = ContextVar("look", default=SCREEN)


@dataclass
class Chosen:
    """The one panel of a picture that is drawn, in axes given or made for it.

    Attributes
    ----------
    name : str
        Its name in the picture.
    ax : Axes or None
        Where it is drawn; None until it is known.
    """

    name: str
    ax: Axes | None = None


CHOSEN: ContextVar[Chosen | None] = ContextVar("chosen", default=None)
_INSIDE: ContextVar[bool] = ContextVar("inside", default=False)


def look() -> Look:
    """Return how pictures are drawn here."""
    return _LOOK.get()


@contextmanager
def figure_style(
    style: Style | None = None,
    *,
    width: Width | None = None,
    formats: str | Sequence[str] | None = None,
) -> Iterator[None]:
    """Draw and save all pictures within a ``with`` block in one style.

    Figures that are made in it with Matplotlib have a constrained layout, which leaves room for
    their labels.

    Parameters
    ----------
    style : {"screen", "paper"}, optional
        For a paper letters have 8 points, lines are thin, and titles are left to the caption. A
        picture is then as wide as a column, 85 mm, where `width` is not given.
    width : str or float, optional
        Width of new figures, as ``"85mm"``, ``"17cm"`` or ``"3.3in"``; a number is in metres.
        Below 125 mm panels are below each other.
    formats : str or sequence of str, optional
        Files that ``save`` writes: ``"png"``, ``"svg"``, ``"pdf"``; the first two where not given.

    Yields
    ------
    None
        Until the block ends.

    Raises
    ------
    ParameterError
        `style`, `width` or `formats` is none of these.

    Examples
    --------
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()[3.0:8.0]
    >>> with pt.figure_style("paper", width="85mm"):
    ...     figure = log.plot()
    >>> float((25.4 * figure.get_size_inches()[0]).round(1))
    85.0
    """
    import matplotlib as mpl

    with looking(style, width, formats), mpl.rc_context({"figure.constrained_layout.use": True}):
        yield


@contextmanager
def looking(
    style: Style | None, width: Width | None, formats: str | Sequence[str] | None = None
) -> Iterator[None]:
    """Draw and save the pictures of the package in one style, as of `figure_style`."""
    token = _LOOK.set(look().changed(style, width, formats))
    try:
        yield
    finally:
        _LOOK.reset(token)


def drawing(view: Callable[P, R]) -> Callable[P, R]:
    """Let a function that draws take ``style`` and ``width`` too, and fit what it has drawn.

    It takes an object and where to draw, a figure `fig` or axes `ax`, which are new ones where
    None, and returns that.

    Parameters
    ----------
    view : callable
        Returns a figure or axes, or several axes.

    Returns
    -------
    callable
        The same with more keywords: `style` and `width` of `figure_style`, and `panel`, which alone
        is then drawn and returned.
    """

    @wraps(view)
    def draw(
        *args: Any,
        style: Any = None,
        width: Any = None,
        panel: Any = None,
        **options: Any,
    ) -> Any:
        import matplotlib as mpl

        from .fitting import fit_in, parts_of

        if _INSIDE.get():
            return view(*args, **options)
        token, chosen = _INSIDE.set(True), CHOSEN.set(panel)
        try:
            with looking(style, width), mpl.rc_context(look().settings):
                before = parts_of([*args, *options.values(), panel and panel.ax])
                drawn: Any = view(*args, **options)
                drawn = panel.ax if panel else drawn
                with without_glyph_warnings():
                    fit_in(drawn, before, thin=look().paper)
        finally:
            _INSIDE.reset(token)
            CHOSEN.reset(chosen)
        return drawn

    return draw


@contextmanager
def without_glyph_warnings() -> Iterator[None]:
    """Draw a box for a letter that the font does not have, without a warning for each."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
        yield


def _inches(width: object) -> float:
    if isinstance(width, str):
        try:
            number, unit = _WIDTH.fullmatch(width).groups()  # type: ignore[union-attr]
            inches = float(number) * _INCHES[unit]
        except (AttributeError, ValueError):
            inches = 0.0
    else:
        inches = positive("width", width, "m") / INCH
    if not WIDTHS[0] <= inches <= WIDTHS[1]:
        raise ParameterError("width", quoted(width), "20 mm to 1 m, as '85mm', '17cm' or '3.3in'")
    return inches


def _endings(formats: object) -> tuple[str, ...]:
    endings = tuple(formats) if has_entries(formats) else (formats,)
    for one in endings:
        if one not in FORMATS:
            raise ParameterError("formats", quoted(one), ", ".join(map(repr, FORMATS)))
    return endings
