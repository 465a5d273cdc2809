"""Result of a verification: the loop as measured, beside what was predicted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from ... import _core
from ..._support.display.result import Panel, Result
from ..._support.files.writing import write_result

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...response.response_data import FrequencyResponse
    from ..controller.controller import Controller
    from ..loop.tracking import Tracking

    Array = NDArray[np.float64]

__all__ = ["Verdict", "Verification"]

Verdict = Literal["holds", "fails", "undecided"]
# Probability that noise alone puts a line beyond the bound, over all lines.
CHANCE = 0.05


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Verification(Result):
    """Sensitivity of a loop measured on the stage, beside the one predicted.

    All follow from one run, in which a random-phase multisine d is added to the command: the plant
    is Y/D over U/D, the sensitivity U/D, and the open loop 1/S - 1. What the loop excites by
    itself is averaged out.

    Attributes
    ----------
    controller : Controller
        The controller.
    plant, sensitivity : FrequencyResponse
        Response of the stage in the loop [m/V], and sensitivity S = 1/(1 + L) at its input.
    predicted : ndarray of complex or None, shape (3, n)
        Sensitivity at the lines for the stage's lowest, middle and highest gain; None without a
        model.
    bound : float
        Largest sensitivity that the loop has to keep.
    run : Tracking
        The run.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "control.views.verification:verification_text",
        "plot": "control.views.verification:plot_verification",
        "plot_sensitivity": "control.views.verification:plot_sensitivity",
        "plot_open_loop": "control.views.verification:plot_open_loop",
    }

    controller: Controller
    plant: FrequencyResponse
    sensitivity: FrequencyResponse
    predicted: NDArray[np.complex128] | None
    bound: float
    run: Tracking

    def __repr__(self) -> str:
        largest = self.sensitivity.magnitude.max()
        return f"<Verification: {self.verdict}, sensitivity {largest:.2f} of {self.bound:g}>"

    @property
    def loop(self) -> FrequencyResponse:
        """Open loop L = 1/S - 1, at the input of the stage."""
        s = self.sensitivity
        # The error of 1/S is that of S over S squared.
        shared = 1.0 / np.abs(s.value) ** 4
        return replace(
            s,
            value=1.0 / s.value - 1.0,
            variance=shared * s.variance,
            noise=None if s.noise is None else shared * s.noise,
            distortion=None if s.distortion is None else shared * s.distortion,
        )

    @property
    def feedback(self) -> FrequencyResponse:
        """Response of the controller that follows, L over the plant [V/m]."""
        loop, plant = self.loop, self.plant
        size = np.abs(plant.value) ** 2
        relative = loop.variance / size + plant.variance * np.abs(loop.value) ** 2 / size**2
        return replace(
            loop,
            value=loop.value / plant.value,
            variance=relative,
            noise=None,
            distortion=None,
            drive_unit="m",
            output_unit="V",
        )

    def _beyond(self) -> tuple[Array, Array]:
        """Return the largest and least sensitivity within the band that all lines share."""
        level = 1.0 - CHANCE / self.sensitivity.frequency.size
        size, band = self.sensitivity.magnitude, self.sensitivity.band(level)
        return size + band, size - band

    @property
    def verdict(self) -> Verdict:
        """Whether the sensitivity is within its bound at all lines, beyond it at one, or neither.

        A line is beyond where its whole band is; the band is that of 95 % for all lines at once. A
        mode narrower than the distance of the lines may be missed between them.
        """
        largest, least = self._beyond()
        if (least > self.bound).any():
            return "fails"
        return "holds" if (largest <= self.bound).all() else "undecided"

    @property
    def beyond(self) -> Array:
        """Frequencies at which the sensitivity may be beyond its bound [Hz], shape (k,)."""
        largest, least = self._beyond()
        kept = least > self.bound if self.verdict == "fails" else largest > self.bound
        return self.sensitivity.frequency[kept]

    @property
    def phase_margin(self) -> float | None:
        """Phase margin between the lines about the highest crossover [rad]; None without one."""
        loop = self.loop
        size = np.log(loop.magnitude)
        (crossings,) = np.nonzero((size[:-1] > 0.0) & (size[1:] <= 0.0))
        if not crossings.size:
            return None
        k = int(crossings[-1])
        share = size[k] / (size[k] - size[k + 1])
        turn = np.angle(loop.value[k + 1] / loop.value[k])
        phase = np.angle(loop.value[k]) + share * turn
        return float(np.mod(phase + np.pi + np.pi, 2.0 * np.pi) - np.pi)

    @property
    def table(self) -> dict[str, Array]:
        """Columns at the lines, with their units in the names."""
        columns = {
            "frequency_Hz": self.sensitivity.frequency,
            "sensitivity": self.sensitivity.magnitude,
            "sensitivity_band_95": self.sensitivity.band(),
            "plant_um_per_V": 1e6 * self.plant.magnitude,
            "plant_band_95_um_per_V": 1e6 * self.plant.band(),
            "plant_phase_deg": np.degrees(self.plant.phase),
        }
        if self.predicted is not None:
            for name, one in zip(("low", "middle", "high"), self.predicted, strict=True):
                columns[f"predicted_{name}_gain"] = np.abs(one)
        return columns

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        margin = self.phase_margin
        return {
            "format": "piezotrack-verification",
            "schema_version": 1,
            "verdict": self.verdict,
            "bound": self.bound,
            "largest_sensitivity": float(self.sensitivity.magnitude.max()),
            "beyond_Hz": self.beyond.tolist(),
            "phase_margin_deg": None if margin is None else float(np.degrees(margin)),
            "plant": self.plant.document(),
            "sensitivity": self.sensitivity.document(),
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the verification to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.

        Returns
        -------
        list of pathlib.Path
            ``verification.csv``, ``verification.json``, ``verification.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        return write_result(folder, "verification", self.document(), self.plot(), self.table)

    plot_sensitivity = Panel("Plot the sensitivity measured, with its band, and predicted.")
    plot_open_loop = Panel("Plot the open loop in the complex plane, with the circle of the bound.")
