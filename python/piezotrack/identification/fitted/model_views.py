"""Pictures, bands and intervals of an identified model, whose code is imported when it is used."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from ..._support.display.result import Result

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import ArrayLike

    from ..._support.display.look import Style, Width
    from ...data.dataset import Dataset
    from .certainty.confidence import Confidence
    from .certainty.prediction_band import PredictionBand

__all__ = ["ModelViews"]


class ModelViews(Result):
    """Base of `IdentifiedModel`: the methods whose code is in the rooms above."""

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.report:model_text",
        "plot": "identification.views.plot:plot_model",
        "loop": "identification.views.plot:plot_model_loop",
        "time": "identification.views.plot:plot_model_time",
        "confidence": "identification.confidence.intervals.intervals_of:intervals_of",
        "band": "identification.confidence.prediction_band:prediction_band",
    }

    def confidence(
        self, level: float = 0.95, *, method: Literal["profile", "bootstrap"] = "profile"
    ) -> Confidence:
        """Return intervals of confidence that hold where the cost is not quadratic too.

        `Identification.covariance`, which every fit has, is exact for small deviations. A profile
        shows whether the records limit a parameter at all, and on which side. Refits check both:
        they take the model and the resampled noise for true.

        Parameters
        ----------
        level : float, optional
            Between 0 and 1.
        method : {"profile", "bootstrap"}, optional
            Profiles of the cost, or 200 refits of resampled noise, the same in every call.

        Returns
        -------
        Confidence
            The intervals, with a lower minimum where a profile met one.

        Raises
        ------
        ParameterError
            `level` or `method` is none of these, or the model was read from a file and has no
            record.
        DataError
            The record is too short.
        NumericalError
            The fit leaves no residual.

        Examples
        --------
        >>> import piezotrack as pt
        >>> log = pt.datasets.dbo_training()[3.0:8.0]
        >>> fit = pt.identify(log, "first-order-dahl", method=pt.Descents(seed=1))
        >>> fit.confidence(0.68).parameters["piezo_coefficient"].shape
        'bounded'
        """
        intervals: Confidence = self.view("confidence")(self, level, method)
        return intervals

    def plot(
        self,
        data: Dataset | None = None,
        *,
        fig: Figure | SubFigure | None = None,
        style: Style | None = None,
        width: Width | None = None,
    ) -> Figure:
        """Loop, displacement with its error over time, and convergence of a search.

        Of several records loop and displacement of each, one below the other.

        Parameters
        ----------
        data : Dataset, optional
            Record on which the model is shown; that of the fit where not given. A model from a file
            has none.
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

        Raises
        ------
        ParameterError
            There is no record.
        """
        figure: Figure = self.view("plot")(self, data, fig, style=style, width=width)
        return figure

    def plot_loop(
        self,
        data: Dataset | None = None,
        *,
        ax: Axes | None = None,
        style: Style | None = None,
        width: Width | None = None,
    ) -> Axes:
        """Draw the hysteresis loop: displacement over drive, measured and simulated.

        Parameters
        ----------
        data : Dataset, optional
            As of `plot`.
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure where not given.
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
            There is no record.

        Examples
        --------
        >>> from matplotlib.figure import Figure
        >>> import piezotrack as pt
        >>> log = pt.datasets.dbo_training()[3.0:8.0]
        >>> fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
        >>> ax = fit.plot_loop(ax=Figure().subplots())
        >>> ax.get_xlabel(), ax.get_ylabel()
        ('drive [V]', 'displacement [µm]')
        """
        drawn: Axes = self.view("loop")(self, data, ax, style=style, width=width)
        return drawn

    def plot_time(
        self,
        data: Dataset | None = None,
        *,
        axes: Sequence[Axes] | None = None,
        style: Style | None = None,
        width: Width | None = None,
    ) -> tuple[Axes, Axes]:
        """Draw measured and simulated displacement over time, and the error below.

        Parameters
        ----------
        data : Dataset, optional
            As of `plot`.
        axes : two matplotlib.axes.Axes, optional
            Where to draw; a new figure where not given.
        style : {"screen", "paper"}, optional
            As in `piezotrack.figure_style`.
        width : str or float, optional
            Width of a new figure, as ``"85mm"``; a number is in metres.

        Returns
        -------
        tuple of two matplotlib.axes.Axes
            Displacement, error.

        Raises
        ------
        ParameterError
            There is no record.

        Examples
        --------
        >>> from matplotlib.figure import Figure
        >>> import piezotrack as pt
        >>> log = pt.datasets.dbo_training()[3.0:8.0]
        >>> fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
        >>> above, below = fit.plot_time(axes=Figure().subplots(2, 1))
        >>> below.get_ylabel()
        'error [nm]'
        """
        drawn: tuple[Axes, Axes] = self.view("time")(self, data, axes, style=style, width=width)
        return drawn

    def prediction_band(
        self,
        u: ArrayLike | Dataset,
        dt: float | None = None,
        *,
        level: float = 0.95,
        records: Sequence[Dataset] | None = None,
    ) -> PredictionBand:
        """Predict the displacement under a drive, with a band in which a reading is expected.

        Noise of the sensor, parameters and error of the model are kept apart; see `PredictionBand`.

        Parameters
        ----------
        u : array_like, shape (n,), or Dataset
            The drive [V], from rest, as that of an inverse; or a record, whose offset, drift and
            beginning follow from its readings.
        dt : float, optional
            Sampling interval [s], of a drive that is no record.
        level : float, optional
            Probability with which a reading is in the band.
        records : sequence of Dataset, optional
            Records on which the errors are found, at best some that were not fitted; those of the
            fit where not given. A model from a file has none.

        Returns
        -------
        PredictionBand
            The displacement and its band.

        Raises
        ------
        ParameterError
            `level` is not between 0 and 1, there is no record, or its drive has another unit.
        ShapeError, DataError
            `u` is no drive, or has fewer than 8 samples.

        Examples
        --------
        >>> import piezotrack as pt
        >>> log = pt.datasets.dbo_training()[3.0:13.0]
        >>> fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
        >>> band = fit.prediction_band(log.u - log.u[0], log.dt)
        >>> bool(band.noise.max() < band.half.max() < 0.5e-6)
        True
        """
        predicted: PredictionBand = self.view("band")(self, u, dt, level=level, records=records)
        return predicted
