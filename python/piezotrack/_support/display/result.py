"""Base of all results: text, picture and table, by methods of the same names."""

from __future__ import annotations

from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

from .look import Chosen

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from .look import Style, Width

__all__ = ["Panel", "Result", "Viewed"]


class Viewed:
    """Data with a picture.

    The functions that write and draw it are listed in `views` by name, and are imported when they
    are used: pictures import what they draw, and that imports no picture.

    Attributes
    ----------
    views : mapping of str to str
        ``module:function`` below ``piezotrack`` for ``plot``, for ``html`` as a notebook shows it,
        and for the panels of the class.
    """

    views: ClassVar[Mapping[str, str]]

    @classmethod
    def view(cls, name: str) -> Callable[..., Any]:
        """Import a function of `views`.

        Parameters
        ----------
        name : str
            Its name there.

        Returns
        -------
        callable
            Its first argument is the object.
        """
        module, _, function = cls.views[name].partition(":")
        imported = import_module(f"piezotrack.{module}")
        view: Callable[..., Any] = getattr(imported, function)
        return view

    def plot(
        self,
        *,
        fig: Figure | SubFigure | None = None,
        style: Style | None = None,
        width: Width | None = None,
    ) -> Figure:
        """Draw it.

        Parameters
        ----------
        fig : matplotlib.figure.Figure or SubFigure, optional
            Where to draw; a new figure of pyplot where not given.
        style : {"screen", "paper"}, optional
            As in `piezotrack.figure_style`.
        width : str or float, optional
            Width of a new figure, as ``"85mm"``; a number is in metres.

        Returns
        -------
        matplotlib.figure.Figure
            The figure drawn in; ``plt.show()`` shows it, a notebook shows it by itself.
        """
        figure: Figure = self.view("plot")(self, fig, style=style, width=width)
        return figure

    def plot_panel(
        self,
        panel: str,
        *,
        ax: Axes | None = None,
        style: Style | None = None,
        width: Width | None = None,
    ) -> Axes:
        """Draw one panel of the picture alone.

        Parameters
        ----------
        panel : str
            Its name; that of another is refused with the names of all.
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure of pyplot where not given.
        style : {"screen", "paper"}, optional
            As in `piezotrack.figure_style`.
        width : str or float, optional
            Width of a new figure, as ``"85mm"``; a number is in metres.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.

        Raises
        ------
        ParameterError
            There is no such panel.

        Examples
        --------
        >>> from matplotlib.figure import Figure
        >>> import piezotrack as pt
        >>> log = pt.datasets.dbo_training()[3.0:8.0]
        >>> log.plot_panel("loop", ax=Figure().subplots()).get_xlabel()
        'drive [V]'
        """
        chosen = Chosen(panel, ax)
        axes: Axes = self.view("plot")(self, style=style, width=width, panel=chosen)
        return axes

    def _repr_html_(self) -> str:
        table: str = self.view("html")(self)
        return table


PANEL = """{}

Parameters
----------
ax : matplotlib.axes.Axes, optional
    Where to draw; a new figure of pyplot where not given.
style : {{"screen", "paper"}}, optional
    As in `piezotrack.figure_style`.
width : str or float, optional
    Width of a new figure, as ``"85mm"``; a number is in metres.

Returns
-------
matplotlib.axes.Axes
    The axes drawn on.
"""


class Panel:
    """A panel of a picture, which becomes a method of the class that it is in.

    The function that draws it is in `Viewed.views` under the name of the method.

    Parameters
    ----------
    words : str
        First sentence of the docstring.
    """

    def __init__(self, words: str) -> None:
        self.words = words

    def __set_name__(self, owner: type[Viewed], name: str) -> None:
        def draw(
            self: Viewed,
            *,
            ax: Axes | None = None,
            style: Style | None = None,
            width: Width | None = None,
        ) -> Axes:
            axes: Axes = self.view(name)(self, ax, style=style, width=width)
            return axes

        draw.__doc__ = PANEL.format(self.words)
        draw.__name__, draw.__module__ = name, owner.__module__
        draw.__qualname__ = f"{owner.__qualname__}.{name}"
        setattr(owner, name, draw)

    if TYPE_CHECKING:

        def __call__(
            self,
            *,
            ax: Axes | None = None,
            style: Style | None = None,
            width: Width | None = None,
        ) -> Axes: ...


class Result(Viewed):
    """Result of a computation: its text, its picture, and its content as plain data.

    ``document`` and ``save`` are of the class itself.

    Attributes
    ----------
    views : mapping of str to str
        As of `Viewed`, with ``summary``; without ``html`` a notebook shows the text.
    """

    def summary(self) -> str:
        """Write the result as text.

        Returns
        -------
        str
            Several lines, which ``print(result)`` shows too.
        """
        text: str = self.view("summary")(self)
        return text

    def __str__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        if "html" in self.views:
            return super()._repr_html_()
        return f"<pre>{escape(self.summary())}</pre>"
