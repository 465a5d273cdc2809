"""Text of the residual of a fit, and the note of its cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...._support.units import length_text
from ...confidence.residuals.residual import residual_of

if TYPE_CHECKING:
    from ...confidence.residuals.residual import Residual
    from ...fitted.identification import Identification

__all__ = ["fit_notes", "residual_text", "verdict"]

# What each ingredient is called.
WORDS = {
    "creep": "creep",
    "mode": "a resonance",
    "delay": "a delay or a lag",
    "asymmetry": "an asymmetric loop",
    "rate": "hysteresis that depends on the rate",
    "hum": "hum of the mains",
    "drift": "a drift",
}
# Share of the squared residual from which a loop of another shape is mentioned.
SHAPED = 0.5


def residual_text(residual: Residual) -> str:
    """Write the residual of a fit as a table.

    Parameters
    ----------
    residual : Residual
        The residual.

    Returns
    -------
    str
        Several lines.
    """
    data = residual.data.measured
    percent = 100.0 * residual.rms / residual.stroke
    white = "as white noise" if residual.is_white else "not white"
    lines = [
        f"residual on {data.source or 'a record'}, {len(data)} samples, "
        f"{data.duration:.4g} s at {1.0 / data.dt:.6g} Hz",
        f"rms           {length_text(residual.rms, 3)} ({percent:.3g} % of stroke), "
        f"{length_text(residual.noise, 3)} from sample to sample",
        f"whiteness     Q = {residual.portmanteau:.4g}, threshold {residual.threshold:.3g}: {white}"
        f", neighbours correlate by {residual.correlations[1]:.2g}",
        f"cause         {verdict(residual)}",
    ]
    if residual.candidates:
        lines += ["", "  of the squared residual    explained  beyond the loop"]
        for one in residual.candidates:
            row = f"  {one.name:<25}{100 * one.share:9.1f} %{100 * one.gain:15.1f} %  {one.detail}"
            lines.append(row.rstrip())
        lines.append(f"  {'loop of another shape':<25}{100 * residual.shape:9.1f} %")
    return "\n".join(lines)


def verdict(residual: Residual) -> str:
    """Say what explains a residual, in one sentence without its end.

    Parameters
    ----------
    residual : Residual
        The residual.

    Returns
    -------
    str
        The sentence.
    """
    if residual.is_white:
        return "none: the residual cannot be distinguished from white noise"
    likely = residual.candidates[: residual.likely]
    if len(likely) == 1:
        (one,) = likely
        detail = f" ({one.detail})" if one.detail else ""
        return f"{WORDS[one.name]}{detail} explains {100 * one.share:.0f} % of the squared residual"
    if likely:
        first, second = likely[:2]
        return (
            f"cannot be distinguished: {WORDS[first.name]} or {WORDS[second.name]}, "
            f"{100 * first.share:.0f} and {100 * second.share:.0f} % of the squared residual"
        )
    if residual.shape > SHAPED:
        return (
            "none of those tried; a symmetric loop of another shape explains "
            f"{100 * residual.shape:.0f} % of the squared residual"
        )
    return "none of those tried explains the residual"


def fit_notes(fit: Identification) -> list[str]:
    """Return the notes of a fit, with the cause of its residual on each record that has one.

    Parameters
    ----------
    fit : Identification
        The fit.

    Returns
    -------
    list of str
        The notes: a cause in place of the note that the loop has another shape, and none that they
        have already.
    """
    notes, causes = fit.notes, []
    for i, record in enumerate(fit.records):
        if record.data is None:
            continue
        residual = residual_of(fit, i)
        cause = residual.cause
        # The notes have the lines of the mains, and where a loop is asymmetric.
        known = cause == "hum" or any("is asymmetric" in note for note in notes)
        if cause is None or known:
            continue
        which = f"record {i + 1}: " if len(fit.records) > 1 else ""
        remedy = _remedy(fit, cause)
        causes.append(f"{which}{verdict(residual)}{f': try {remedy}' if remedy else ''}")
        notes = [note for note in notes if "the loop has a shape" not in note]
    return [*notes, *causes]


def _remedy(fit: Identification, cause: str) -> str | None:
    """Return the arguments that give a fit an ingredient, where it has none of it."""
    model, searched = fit.model, fit.model.info.searched
    name = model.info.name
    has = {
        "creep": bool(getattr(model, "creep_weights", ())),
        "mode": searched or getattr(model, "frequency", None) is not None,
        "delay": bool(fit.delay) or getattr(model, "time_constant", None) is not None,
        "asymmetry": name == "asymmetric-prandtl-ishlinskii",
        "rate": name == "rate-dependent-prandtl-ishlinskii",
        "drift": fit.drift is not None,
    }
    if has.get(cause, True):
        return None
    return {
        "creep": "creep=True" if searched else "LeastSquares(creep=True)",
        "mode": 'LeastSquares(dynamics="second")',
        "delay": "delay=True",
        "asymmetry": "'asymmetric-prandtl-ishlinskii'",
        "rate": "'rate-dependent-prandtl-ishlinskii'",
        "drift": "drift=True",
    }[cause]
