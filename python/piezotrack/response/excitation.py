"""Random-phase multisine: the excitation of a frequency response."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from .. import _core
from .._support.arguments import finite, hertz, number_pair, one_of, plain, positive
from ..errors import ParameterError
from ..references.parse import Kind, made_from_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["RandomPhaseMultisine", "parse_excitation"]

# Most periods and realisations.
MOST = 10_000
# Most samples of all of them.
MOST_SAMPLES = 10_000_000


@dataclass(frozen=True, kw_only=True)
class RandomPhaseMultisine:
    r"""Random-phase multisine, played for several periods in several realisations of its phases.

    .. math:: u(t) = u_0 + \sum_k A_k \cos(2 \pi k f_0 t + \varphi_k)

    with independent phases, uniform over a turn, in each realisation. Pintelon and Schoukens,
    System Identification, 2nd ed., 2012, section 4.3. What differs between periods is noise; what
    repeats in all periods, but differs between realisations, is nonlinear distortion.

    Parameters
    ----------
    band : (float, float)
        Lowest and highest frequency of the lines [Hz].
    low, high : float
        Range [V; of a reference m], of which u0 is the middle. The realisation with the largest
        peak reaches one end; all have the same spectrum.
    resolution : float, optional
        f0, the inverse of the period [Hz]; default the lowest frequency. It is rounded so that a
        period has whole samples.
    lines : {"odd", "all"}, optional
        Multiples of f0 that are excited. Without the even ones even distortion, as of a curved
        characteristic, falls between the lines.
    shape : sequence of (float, float), optional
        Frequencies [Hz] and relative amplitudes, between which A_k is interpolated on logarithmic
        axes; flat by default. Less at a mode and at high frequencies spares the stage.
    periods : int, optional
        Periods of each realisation that count.
    settle : int, optional
        Periods before these, in which the stage settles.
    realisations : int, optional
        Draws of the phases.
    seed : int, optional
        Of the phases; the same seed gives the same.

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.RandomPhaseMultisine(band=(1.0, 400.0), low=30.0, high=35.0).duration
    30.0
    """

    band: tuple[float, float]
    low: float
    high: float
    resolution: float | None = None
    lines: Literal["odd", "all"] = "odd"
    shape: Sequence[tuple[float, float]] | None = None
    periods: int = 4
    settle: int = 1
    realisations: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        lowest, highest = (hertz("band", one) for one in number_pair("band", self.band, "Hz"))
        if not lowest < highest:
            raise ParameterError("band", f"{self.band}", "the lower frequency first", verb="is")
        low, high = finite("low", self.low, "V or m"), finite("high", self.high, "V or m")
        if not low < high:
            raise ParameterError("low", f"{low:g}", f"less than high, {high:g}")
        if self.resolution is not None and hertz("resolution", self.resolution) > lowest:
            raise ParameterError(
                "resolution",
                f"{self.resolution:g} Hz",
                f"at most the lowest frequency, {lowest:g} Hz",
            )
        one_of("lines", self.lines, ("odd", "all"))
        for name, least in (("periods", 1), ("settle", 0), ("realisations", 1)):
            count = _core.as_count(name, getattr(self, name))
            if not least <= count <= MOST:
                raise ParameterError(name, count, f"{least} to {MOST}")
        if self.periods * self.realisations < 2:
            raise ParameterError(
                "periods",
                "1, of one realisation",
                "two periods or two realisations, from which the noise follows",
            )
        _core.as_count("seed", self.seed)
        for frequency, relative in () if self.shape is None else self.shape:
            hertz("shape", frequency)
            positive("shape", relative, "relative amplitude")

    @property
    def duration(self) -> float:
        """Time of all periods of all realisations, without ramps [s]."""
        return self.realisations * (self.settle + self.periods) / self.spacing

    @property
    def spacing(self) -> float:
        """Inverse of the period before it is rounded [Hz]."""
        return self.band[0] if self.resolution is None else self.resolution

    @property
    def offset(self) -> float:
        """Middle of the range [V; of a reference m]."""
        return 0.5 * (self.low + self.high)

    def samples(self, rate: float) -> int:
        """Return the samples of a period.

        Parameters
        ----------
        rate : float
            Sampling rate [Hz].

        Returns
        -------
        int
            At least 4.

        Raises
        ------
        ParameterError
            The band is beyond half the rate, or there are more than ten million samples in all.
        """
        if not self.band[1] < 0.5 * rate:
            raise ParameterError(
                "band",
                f"up to {plain(self.band[1])} Hz",
                f"below half the sampling rate, {plain(0.5 * rate)} Hz",
                verb="goes",
            )
        count = max(4, round(rate / self.spacing))
        total = count * self.realisations * (self.settle + self.periods)
        if total > MOST_SAMPLES:
            raise ParameterError(
                "resolution",
                f"{self.spacing:g} Hz",
                f"one with at most {MOST_SAMPLES} samples in all periods and realisations, not "
                f"{total:.3g}",
            )
        return count

    def numbers(self, rate: float) -> NDArray[np.intp]:
        """Return the multiples of f0 that are excited.

        Parameters
        ----------
        rate : float
            Sampling rate [Hz].

        Returns
        -------
        ndarray of int, shape (n,)
            In rising order.

        Raises
        ------
        ParameterError
            No line lies in the band, or it is beyond half the rate.
        """
        count = self.samples(rate)
        spacing = rate / count
        # The tolerance is for bands that end on a line.
        first, last = self.band[0] / spacing - 1e-6, self.band[1] / spacing + 1e-6
        lines = np.arange(max(1, int(np.ceil(first))), min(int(last), (count - 1) // 2) + 1)
        if self.lines == "odd":
            lines = lines[lines % 2 == 1]
        if lines.size == 0:
            raise ParameterError(
                "band",
                f"{plain(self.band[0])} to {plain(self.band[1])} Hz",
                f"one with a line, at {self.lines} multiples of {spacing:.4g} Hz",
            )
        return lines

    def signals(self, rate: float) -> Array:
        """Return one period of each realisation.

        Parameters
        ----------
        rate : float
            Sampling rate [Hz].

        Returns
        -------
        ndarray, shape (realisations, samples)
            Between `low` and `high`.
        """
        lines, count = self.numbers(rate), self.samples(rate)
        spectrum = np.zeros((self.realisations, count // 2 + 1), dtype=np.complex128)
        random = np.random.default_rng(self.seed)
        phases = random.uniform(0.0, 2.0 * np.pi, (self.realisations, lines.size))
        spectrum[:, lines] = self._amplitudes(lines * (rate / count)) * np.exp(1j * phases)
        signals = np.fft.irfft(spectrum, count, axis=1)
        peak = np.abs(signals).max()
        moved = self.offset + (0.5 * (self.high - self.low) / peak) * signals
        # Rounding leaves no range.
        return np.asarray(np.clip(moved, self.low, self.high))

    def _amplitudes(self, frequency: NDArray[np.floating]) -> Array:
        if self.shape is None:
            return np.ones(frequency.size)
        at, relative = np.array(sorted(self.shape), dtype=np.float64).T
        return np.asarray(np.exp(np.interp(np.log(frequency), np.log(at), np.log(relative))))


def parse_excitation(
    text: str, quantity: Literal["voltage", "displacement"] = "voltage"
) -> RandomPhaseMultisine:
    """Make a random-phase multisine from a text, as the command line takes it.

    ``random-phase:1..400Hz,30..35V``: frequencies and range; optional ``resolution=0.5Hz``,
    ``periods=4``, ``settle=1``, ``realisations=6``, ``seed=0``.

    Parameters
    ----------
    text : str
        The kind and its items.
    quantity : {"voltage", "displacement"}, optional
        Of the range.

    Returns
    -------
    RandomPhaseMultisine
        The excitation.

    Raises
    ------
    ParameterError
        The text cannot be parsed, or a value cannot be used.

    Examples
    --------
    >>> from piezotrack.response.excitation import parse_excitation
    >>> parse_excitation("random-phase:1..400Hz,30..35V,periods=8").periods
    8
    """
    ends = "30..35V" if quantity == "voltage" else "20..21um"
    keywords = dict.fromkeys(("periods", "settle", "realisations", "seed"), "number")
    kind = Kind(
        lambda lowest, highest, **others: RandomPhaseMultisine(band=(lowest, highest), **others),
        "random-phase:LOWEST..HIGHEST,LOW..HIGH[,resolution=FREQUENCY][,periods=NUMBER]"
        "[,settle=NUMBER][,realisations=NUMBER][,seed=NUMBER]",
        f"random-phase:1..400Hz,{ends}",
        {("frequency", ".."): ("lowest", "highest"), (quantity, ".."): ("low", "high")},
        {"resolution": "frequency", **keywords},
        ("lowest", "low"),
    )
    made: RandomPhaseMultisine = made_from_text(
        "excitation", text, {"random-phase": kind}, _no_file, None
    )
    return made


def _no_file(path: str, **_: object) -> RandomPhaseMultisine:
    raise ParameterError(
        "excitation", f"the file {path}", "a text, as random-phase:1..400Hz,30..35V"
    )
