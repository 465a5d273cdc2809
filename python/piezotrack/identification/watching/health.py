"""Health of a stage: what a new record shows to have changed since the model was identified."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

from ... import _core
from ..._support.display.result import Result
from ..._support.files.writing import write_document

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from ..fitted.identified_model import IdentifiedModel

__all__ = ["RATIOS", "Change", "Health", "Refit", "Verdict"]

# Changes that are ratios to what the model's own record has.
RATIOS = ("residual", "noise")

Verdict = Literal["unchanged", "changed", "not judged"]


class Change(NamedTuple):
    """One property of a stage, and whether a record shows that it has changed.

    Attributes
    ----------
    name : {"residual", "gain", "hysteresis", "mode", "lag", "delay", "drift", "noise"}
        The property.
    value : float or None
        Change in `unit`: relative, but of the delay in s and of the drift in m over the record. Of
        residual and noise the ratio to that of the model's own record. None where the model or the
        record has nothing to compare.
    interval : (float, float) or None
        All intervals of a result hold at once in 95 of 100 records, model error included.
    unit : str
        SI; empty for ratios.
    verdict : {"unchanged", "changed", "not judged"}
        Whether the interval leaves out the value of an unchanged stage.
    reason : str
        Why it is not judged, which other change would look the same, or, where no change is seen,
        that only a large one could be; empty otherwise.
    """

    name: str
    value: float | None
    interval: tuple[float, float] | None
    unit: str
    verdict: Verdict
    reason: str = ""

    @property
    def detectable(self) -> float | None:
        """Least change that the record shows, in `unit`; of residual and noise a ratio.

        A smaller one leaves the verdict "unchanged". None where the change is not judged, and of a
        ratio of 0.
        """
        if self.value is None or self.interval is None:
            return None
        low = self.interval[0]
        if self.name not in RATIOS:
            return self.value - low
        return self.value / low if low > 0.0 else None


class Refit(NamedTuple):
    """A model that was identified again, and whether it is better where it was not fitted.

    Attributes
    ----------
    accepted : bool
        Whether the interval of the improvement is above 0.
    held_out : (float, float)
        Part of the record that was not fitted [s].
    rms_before, rms_after : float
        Deviation there of the old model and of the new one [m].
    improvement : float
        Mean square of the old model less that of the new one there, over that of the old one.
    interval : (float, float)
        That the improvement is in with 95 %, for correlated errors.
    model : IdentifiedModel or None
        Where accepted, the new model, of the part before; its details have the decision.
    """

    accepted: bool
    held_out: tuple[float, float]
    rms_before: float
    rms_after: float
    improvement: float
    interval: tuple[float, float]
    model: IdentifiedModel | None = None

    @property
    def entry(self) -> dict[str, Any]:
        """The decision, without the model, for files: numbers, texts and lists only."""
        return {
            "accepted": self.accepted,
            "held_out_s": list(self.held_out),
            "rms_before": {"value": self.rms_before, "unit": "m"},
            "rms_after": {"value": self.rms_after, "unit": "m"},
            "improvement": {"value": self.improvement, "interval": list(self.interval)},
        }


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Health(Result):
    """Health of a stage by a new record; see `watch`.

    Attributes
    ----------
    model : str
        Title of the model.
    source : str or None
        Where the record comes from.
    rms, rms_identified : float
        Residual of the record and of the model's own record [m]; their ratio is the figure of
        ``health["residual"]``.
    effective : float
        Number of independent samples that the residual is worth.
    changes : tuple of Change
        The residual first, then each property.
    refit : Refit or None
        The guarded refit, where one was made.
    provenance : mapping
        Fingerprints of both records.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.watching.health_report:health_text",
        "plot": "identification.views.watching.health_report:plot_health",
    }

    model: str
    source: str | None
    rms: float
    rms_identified: float
    effective: float
    changes: tuple[Change, ...]
    refit: Refit | None
    provenance: Mapping[str, Any]

    def __repr__(self) -> str:
        changed = ", ".join(one.name for one in self.changes if one.verdict == "changed")
        return f"<Health, {self.model}: {f'changed: {changed}' if changed else 'unchanged'}>"

    def __getitem__(self, name: str) -> Change:
        return next(one for one in self.changes if one.name == name)

    @property
    def healthy(self) -> bool:
        """Whether nothing has changed, as far as the record shows."""
        return all(one.verdict != "changed" for one in self.changes)

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        refit = {} if self.refit is None else {"refit": self.refit.entry}
        return {
            "format": "piezotrack-health",
            "schema_version": 1,
            "model": self.model,
            "source": self.source,
            "healthy": self.healthy,
            "rms": {"value": self.rms, "unit": "m"},
            "rms_identified": {"value": self.rms_identified, "unit": "m"},
            "effective_samples": self.effective,
            "changes": [one._asdict() | {"detectable": one.detectable} for one in self.changes],
            **refit,
            "provenance": {
                "package": "piezotrack",
                "version": _core.__version__,
                **self.provenance,
            },
        }

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the result as JSON.

        Parameters
        ----------
        path : path-like
            The file.

        Returns
        -------
        pathlib.Path
            The file written.

        Raises
        ------
        DataError
            The file cannot be written.
        """
        return write_document(path, self.document())
