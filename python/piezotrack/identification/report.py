"""What a person reads of a result: the table, and the files with their pictures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from .._support.files import make_folder, save_figures
from ..stages.registry import kind_of

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from ..data.dataset import Dataset
    from .estimates import Estimate
    from .identified import Fitted
    from .least_squares import PlaysIdentification
    from .search import Identification

__all__ = ["plays_text", "save_identification", "summary_text"]


def summary_text(fit: Identification) -> str:
    """Write a result as a table.

    Parameters
    ----------
    fit : Identification
        What a search found.

    Returns
    -------
    str
        Several lines.
    """
    kind = kind_of(fit.model)
    lines = [
        *_heading(fit),
        f"      {fit.nit} iterations, {fit.nfev} simulations, seed {fit.seed}: {fit.message}",
        *_runs(fit),
        *(f"note  {note}" for note in fit.notes),
        "",
        *_known(fit),
        "",
    ]
    if fit.scale_assumed:
        lines += [
            f"parameters, scale assumed: K = {fit.model.stiffness:g} N/m is nominal. Voltage and",
            f"displacement fix no force; with the true stiffness=, {kind.forces} scale along.",
        ]
    else:
        lines.append("parameters")
    width = 1 + max(3, *(len(estimate.symbol) for estimate in fit.parameters.values()))
    lines.append(f"  {'':<18}{'':<{width}}{'value':>13}  {'':<9}{'standard deviation'}")
    lines += [_row(name, estimate, width) for name, estimate in fit.parameters.items()]
    if unclear := [n for n, e in fit.parameters.items() if not e.identified]:
        lines += ["", "Not fixed by this record: " + ", ".join(unclear) + "."]
    if fit.nfail:
        lines += ["", f"{fit.nfail} simulations did not stay finite and counted as infinitely bad."]
    return "\n".join(lines)


def plays_text(fit: PlaysIdentification) -> str:
    """Write a fit of play operators as a table.

    Parameters
    ----------
    fit : PlaysIdentification
        What a fit found.

    Returns
    -------
    str
        Several lines.
    """
    model = fit.model
    lines = [
        *_heading(fit),
        f"      {fit.nfev} simulations",
        *(f"note  {note}" for note in fit.notes),
        "",
        f"  {'linear':<16}{'w0':<6}{1e6 * model.linear:>12.6g}  um/V",
        f"  {'plays':<16}{'r':<6}{'threshold [V]':>14}  {'w':<4}{'weight [um/V]':>14}",
    ]
    for r, w in zip(model.thresholds, model.weights, strict=True):
        lines.append(f"  {'':<22}{r:>14.6g}  {'':<4}{1e6 * w:>14.6g}")
    if model.corners:
        lines.append(f"  {'dead zones':<16}{'d':<6}{'corner [um]':>14}  {'s':<4}{'bend':>14}")
        for d, s in zip(model.corners, model.bends, strict=True):
            lines.append(f"  {'':<22}{1e6 * d:>14.6g}  {'':<4}{s:>14.6g}")
    if model.creep_times:
        lines.append(f"  {'creep':<16}{'tau':<6}{'time [s]':>14}  {'c':<4}{'share':>14}")
        for tau, c in zip(model.creep_times, model.creep_shares, strict=True):
            lines.append(f"  {'':<22}{tau:>14.6g}  {'':<4}{c:>14.6g}")
    if model.time_constant is not None:
        lines.append(f"  {'time_constant':<16}{'T':<6}{1e3 * model.time_constant:>12.6g}  ms")
    if model.frequency is not None:
        lines.append(f"  {'frequency':<16}{'fn':<6}{model.frequency:>12.6g}  Hz")
        lines.append(f"  {'damping_ratio':<16}{'zeta':<6}{model.damping_ratio:>12.6g}")
    return "\n".join(lines)


def _heading(fit: Fitted[Any]) -> list[str]:
    """Say what was identified from which record, and what is left."""
    data = fit.data
    return [
        f"{kind_of(fit.model).title} stage identified from {data.source or 'a record'}: "
        f"{len(data)} samples, {data.duration:.4g} s at {1 / data.dt:.6g} Hz, "
        f"stroke {1e6 * data.stroke:.4g} um",
        f"cost  {fit.cost_um:.4g} um rms = {fit.cost_percent:.3g} % of stroke"
        + (f", offset {1e6 * fit.offset:.5g} um fitted" if fit.offset_fitted else ""),
    ]


def _runs(fit: Identification) -> list[str]:
    """Say whether several runs agree."""
    if len(fit.runs) == 1:
        return ["      one run: several, runs=4, would tell whether there are other valleys"]
    costs = ", ".join(f"{1e6 * cost:.4g}" for cost in sorted(run.cost for run in fit.runs)[:4])
    more = ", ..." if len(fit.runs) > 4 else ""
    verdict = f"{fit.agreeing} of {len(fit.runs)} runs end within 0.1 % of the best"
    return [f"      {verdict}: {costs}{more} um"]


def _known(fit: Identification) -> list[str]:
    """List what the data tell, whatever the scale of the forces, and what they do not."""
    ratios = _ratios(fit)
    if "delay" in fit.parameters:
        ratios.append(("delay", "delay", 1e3 * fit.delay, "ms"))
    # A ratio to a stiffness that was searched is known where both are; a stiffness that presses
    # against its bound takes the others along.
    whole = fit.parameters["stiffness"]
    known: list[tuple[str, str]] = []
    unknown: list[tuple[str, str]] = []
    for name, symbol, value, unit in ratios:
        estimate = fit.parameters[name]
        alone = "/" not in symbol
        held = not estimate.free and (not whole.free or alone)
        sure = estimate.identified and (whole.precise or alone)
        if not held:
            (known if sure else unknown).append((symbol, f"{value:>12.6g}  {unit}"))
    lines = ["fixed by the data" if known else "nothing is fixed by these data"]
    lines += [f"  {symbol:<10} {text}" for symbol, text in known]
    if unknown:
        lines.append("not fixed by them: " + ", ".join(symbol for symbol, _ in unknown))
    return lines


def _ratios(fit: Identification) -> list[tuple[str, str, float, str]]:
    """Parameter, symbol, value and unit of what does not depend on the scale of the forces."""
    ratios = fit.model.force_ratios()
    # Friction that was neither searched nor there is not worth a line.
    return [r for r in ratios if r[0] != "b0" or fit.parameters["b0"].free or r[2]]


def _row(name: str, estimate: Estimate, width: int) -> str:
    if not estimate.free:
        note = "held"
    elif estimate.deviation is None:
        note = "unknown"
    elif not math.isfinite(estimate.deviation):
        note = "no trace in the data"
    else:
        share = 100 * estimate.deviation / abs(estimate.value) if estimate.value else math.inf
        digits = f"{share:.2g}" if share < 10 else f"{share:.0f}"
        note = f"{digits} %" if share < 100 else "larger than the value"
    if estimate.at_bound:
        note += ", on a bound"
    return (
        f"  {name:<18}{estimate.symbol:<{width}}{estimate.value:>13.6g}  {estimate.unit:<9}{note}"
    ).rstrip()


def save_identification(
    fit: Fitted[Any],
    folder: str | os.PathLike[str],
    *,
    name: str | None = None,
    shown: Dataset | None = None,
) -> list[Path]:
    """Write the model and its pictures.

    Parameters
    ----------
    fit : Identification or PlaysIdentification
        What a fit found.
    folder : path-like
        Where to; made where it is missing.
    name : str, optional
        Beginning of the names of the files; that of the model where it is not given.
    shown : Dataset, optional
        A longer record that the pictures show, with the end of the fit marked.

    Returns
    -------
    list of pathlib.Path
        ``{name}.json``, and as PNG and SVG ``{name}_loop``, ``{name}_time`` and, where a swarm
        searched, ``{name}_convergence``.
    """
    from .plot import plot_convergence, plot_loop, plot_time

    path = make_folder(folder)
    kind = kind_of(fit.model)
    name = kind.name if name is None else name
    record = fit.data if shown is None else shown
    run = fit.simulate(record, offset=fit.offset)
    until = None if shown is None else float(fit.data.t[-1])
    figures = {
        f"{name}_loop": plot_loop(record, run).figure,
        f"{name}_time": plot_time(record, run, stroke=fit.stroke, fitted_until=until)[0].figure,
    }
    if kind.searched:
        figures[f"{name}_convergence"] = plot_convergence(fit).figure  # type: ignore[arg-type]
    return [fit.save(path / f"{name}.json"), *save_figures(figures, path)]  # type: ignore[arg-type]
