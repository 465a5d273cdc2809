"""Reports of an identification: the table, and the files with their pictures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..._support.units import length_text, of_drive, shown_unit
from ..fitted.start import GAIN
from ..methods.descents import Descents
from ..methods.least_squares import LeastSquares
from ..methods.particle_swarm import ParticleSwarm
from .confidence.residual_report import fit_notes
from .quantities import errors_of, errors_of_file, of_sensor, of_stage, predicted, rows

if TYPE_CHECKING:
    from ...data.dataset import Dataset
    from ..fitted.estimates import Estimate, SearchRun
    from ..fitted.identification import Identification
    from ..fitted.identified_model import IdentifiedModel

__all__ = [
    "determined",
    "list_sentences",
    "model_text",
    "parameter_notes",
    "search_sentences",
    "summary_text",
    "verdict_sentences",
]

# Whether a constraint decides the result.
STATES = {True: "active: the two are equal", False: "not active"}
# Units of values that a stage gives in um, and the factor for a drive in metres.
PER_METRE = {"um/V": ("um/um", 1e-6), "1/V": ("1/um", 1e-6)}


def summary_text(fit: Identification) -> str:
    """Write a result as a table.

    Parameters
    ----------
    fit : Identification
        Result of an identification.

    Returns
    -------
    str
        Several lines.
    """
    lines = _of_several(fit) if len(fit.records) > 1 else _of_one(fit)
    lines += [f"      {one}" for one in search_sentences(fit)]
    lines += _trials(fit)
    lines += [*(f"note  {note}" for note in fit_notes(fit)), ""]
    return "\n".join([*lines, *_parameters(fit)])


def _parameters(fit: Identification) -> list[str]:
    """List the parameters, and what is known of them."""
    if fit.model.info.searched:
        return _estimates(fit)
    return [*_values(fit), *_certainty(fit)]


def search_sentences(fit: Identification) -> list[str]:
    """Write how a model was found.

    Parameters
    ----------
    fit : Identification
        Result of an identification.

    Returns
    -------
    list of str
        Method, effort, why it ended, and whether several runs agree.
    """
    method, search = fit.method, fit.search
    if isinstance(method, LeastSquares) or search is None:
        return [f"least squares, {fit.nfev} simulations"]
    lines = []
    if search.cost_with_priors is not None:
        lines.append(f"{1e6 * search.cost_with_priors:.4g} um with the priors was minimised")
    iterations = f"{search.nit} iterations, " if isinstance(method, ParticleSwarm) else ""
    lines.append(f"{iterations}{fit.nfev} simulations, seed {method.seed}: {fit.message}")
    lines += _runs(search, method)
    least = min((run.cost for run in search.runs), default=0.0)
    if isinstance(method, ParticleSwarm) and fit.cost < (1.0 - GAIN) * least:
        history = fit.start.history if fit.start else ""
        lines.append(
            f"as of a stage that never moved; descents from there with "
            f"history={history!r} end at {fit.cost_um:.4g} um"
        )
    return lines


def model_text(model: IdentifiedModel) -> str:
    """Write a model without its record, as one from a file, as a table.

    Parameters
    ----------
    model : IdentifiedModel
        The model.

    Returns
    -------
    str
        Several lines.
    """
    info, origin = model.model.info, model.details.get("provenance") or {}
    source = (origin.get("data") or {}).get("source") or "a record"
    lines = [
        f"{info.title}: stage identified from {source}, stroke {1e6 * model.stroke:.4g} um",
        *rows([*of_stage(model), *of_sensor(model), *errors_of_file(model)]),
        "",
    ]
    return "\n".join([*lines, *_values(model)])


def _of_one(fit: Identification) -> list[str]:
    """Say from which record, and what is left of it."""
    data, record = fit.data, fit.records[0]
    of_record = [*of_sensor(record, data), *errors_of(fit, 0), *predicted(fit)]
    return [
        f"{fit.model.info.title}: stage identified from {data.source or 'a record'}",
        *rows([*of_stage(fit), *of_record, ("record", _size(data))]),
    ]


def _of_several(fit: Identification) -> list[str]:
    """Say from which records, what is left of each, and what each has of its own."""
    rms = (
        f"{length_text(fit.cost, 3)} of all ({fit.cost_percent:.3g} % of the largest stroke), "
        f"fit {fit.fit_percent:.4g} %"
    )
    lines = [
        f"{fit.model.info.title}: stage identified from {len(fit.records)} records",
        *rows([*of_stage(fit), ("rms error", rms), *predicted(fit)]),
    ]
    for i, record in enumerate(fit.records):
        if record.data is None:
            continue
        weight = "" if record.weight == 1.0 else f", weight {record.weight:g}"
        lines += [
            f"  {i + 1:>2}  {record.data.source or 'unnamed'}, {_size(record.data)}{weight}",
            *rows([*of_sensor(record, record.data), *errors_of(fit, i)], indent=6),
        ]
    return lines


def _size(data: Dataset) -> str:
    """Write the size of a record, as it was measured."""
    data = data.measured
    return (
        f"{len(data)} samples, {data.duration:.4g} s at {1 / data.dt:.6g} Hz, "
        f"stroke {1e6 * data.stroke:.4g} um"
    )


def _trials(fit: Identification) -> list[str]:
    """List the models that were tried, and on what they were judged."""
    chosen = fit.selection
    if chosen is None:
        return []
    width = max(len(trial.title) for trial in chosen.trials)
    return [
        f"      models fitted up to {chosen.fitted_until:.4g} s, by their rms after it:",
        *(
            f"        {trial.title:<{width}}  {100 * trial.rms / fit.stroke:7.3g} %"
            f"  {trial.seconds:5.1f} s"
            for trial in chosen.trials
        ),
    ]


def _estimates(fit: Identification) -> list[str]:
    """List what the data determine, and every parameter with its standard deviation."""
    lines = [*_known(fit), ""]
    if fit.scale_assumed:
        first, second = _assumed(fit)
        lines += [f"parameters, {first}", second]
    else:
        lines.append("parameters")
    width = 1 + max(3, *(len(estimate.symbol) for estimate in fit.parameters.values()))
    lines.append(f"  {'':<18}{'':<{width}}{'value':>13}  {'':<9}{'standard deviation'}")
    lines += [_row(fit, name, estimate, width) for name, estimate in fit.parameters.items()]
    lines += [*(f"  {one}" for one in list_sentences(fit)), *_constraints(fit), *_certainty(fit)]
    lines += [line for sentence in _undetermined(fit) for line in ("", sentence)]
    return lines


def _assumed(fit: Identification) -> tuple[str, str]:
    """Say that the scale of the forces was assumed."""
    return (
        "scale assumed: a log of drive and displacement determines no force, so",
        f"K = {fit.model.stiffness:g} N/m was assumed. {fit.model.info.force_symbols} scale "
        "with it; for real values give the stiffness.",
    )


def _undetermined(fit: Identification) -> list[str]:
    """Name the parameters that the records do not determine, and simulations that diverged."""
    which = "this record" if len(fit.records) == 1 else "these records"
    lines = []
    if unclear := [n for n, e in fit.parameters.items() if not (e.identified or e.from_prior)]:
        lines.append(
            f"Not determined by {which}: {', '.join(unclear)}.\n"
            "Drive to record next: piezotrack suggest, in Python pt.suggest_drive."
        )
    if known := [n for n, e in fit.parameters.items() if e.from_prior]:
        lines.append(f"Known by their priors, not by {which}: " + ", ".join(known) + ".")
    if fit.search and fit.search.nfail:
        lines.append(f"{fit.search.nfail} simulations diverged; their cost counted as infinite.")
    return lines


def verdict_sentences(fit: Identification) -> list[str]:
    """Write what the data of a search determine, and how far its deviations can be trusted.

    Parameters
    ----------
    fit : Identification
        Result of an identification.

    Returns
    -------
    list of str
        Sentences; after least squares only how many values the error of the model decides.
    """
    if not fit.parameters:
        return [one for one in _certainty(fit) if one]
    known, _ = determined(fit)
    values = ", ".join(f"{symbol} = {value:.6g} {unit}".rstrip() for symbol, value, unit in known)
    lines = [f"The data determine {values or 'no parameter'}."]
    if fit.scale_assumed:
        lines.append("Parameters: " + " ".join(_assumed(fit)))
    lines += [f"Constraint {one.text}: {STATES[one.active]}." for one in fit.constraints]
    return [*lines, *(one for one in _certainty(fit) if one), *_undetermined(fit)]


def _values(fit: IdentifiedModel) -> list[str]:
    """List the values of the parameters, and the names of those that are lists."""
    lines = ["parameters"]
    for parameter in fit.model.info.parameters:
        value = getattr(fit.model, parameter.name)
        if value is not None and not parameter.is_list:
            unit, scale = shown_unit(of_drive(parameter.unit, fit.drive_unit))
            row = f"  {parameter.name:<22}{parameter.symbol:<6}{scale * value:>12.6g}  {unit}"
            lines.append(row.rstrip())
    return [*lines, *(f"  {one}" for one in list_sentences(fit))]


def list_sentences(fit: IdentifiedModel) -> list[str]:
    """Name the parameters that are lists, whose values are in the file of the model."""
    counted: dict[int, list[str]] = {}
    for one in fit.model.info.parameters:
        if one.is_list and (values := getattr(fit.model, one.name)):
            counted.setdefault(len(values), []).append(f"{one.name} {one.symbol}")
    return [
        f"{count} value{'s' * (count > 1)} each, in the model file: {', '.join(names)}"
        for count, names in counted.items()
    ]


def _certainty(fit: Identification) -> list[str]:
    """Say which values the error of the model decides, and which are known as a combination."""
    covariance = fit.covariance
    if covariance is None:
        return []
    lines: list[str] = []
    decided = covariance.decided_by_model
    if decided:
        # Weights of plays by their number only.
        count = f"{len(decided)} of {len(covariance.names)} values"
        which = ", ".join(decided) if set(decided) <= set(fit.parameters) else count
        lines.append(f"The error of the model, not the noise, decides {which}.")
    pairs = [
        f"{first} and {second} ({correlation:.2f})"
        for first, second, correlation in covariance.correlated
        if {first, second} <= set(fit.parameters)
    ]
    if pairs:
        lines.append(f"Correlated, so that a combination is known better: {', '.join(pairs)}.")
    return ["", *lines] if lines else []


def _runs(search: SearchRun, method: Descents | ParticleSwarm) -> list[str]:
    """Say whether several runs agree, and what the others found."""
    costs = sorted(1e6 * run.cost for run in search.runs)
    if isinstance(method, Descents):
        text = (
            f"{search.agreeing_runs} of {len(costs)} descents end within 0.1 % of the lowest cost"
        )
        others = costs[search.agreeing_runs :]
        if others and others[0] < math.inf:
            most = max(cost for cost in others if cost < math.inf)
            text += f", the others at {others[0]:.4g} to {most:.4g} um"
        return [text]
    if len(costs) == 1:
        return ["one run: runs=4 would show whether there are other local minima"]
    more = ", ..." if len(costs) > 4 else ""
    verdict = f"{search.agreeing_runs} of {len(costs)} runs end within 0.1 % of the best"
    return [f"{verdict}: {', '.join(f'{cost:.4g}' for cost in costs[:4])}{more} um"]


def determined(fit: Identification) -> tuple[list[tuple[str, float, str]], list[str]]:
    """Return the quantities that the data determine at any scale of the forces, and the others.

    Parameters
    ----------
    fit : Identification
        Result of a search.

    Returns
    -------
    known : list of (str, float, str)
        Symbol, value and unit.
    unknown : list of str
        Symbols.
    """
    ratios = _ratios(fit)
    if "delay" in fit.parameters:
        ratios.append(("delay", "delay", 1e3 * fit.delay, "ms"))
    # A ratio to a stiffness that was searched is determined where both are; a stiffness on its
    # bound makes the others uncertain.
    whole = fit.parameters["stiffness"]
    known: list[tuple[str, float, str]] = []
    unknown: list[str] = []
    for name, symbol, value, unit in ratios:
        estimate = fit.parameters[name]
        no_ratio = "/" not in symbol
        moves = estimate.free or (estimate.tie is not None and estimate.deviation != 0.0)
        held = not moves and (not whole.free or no_ratio)
        sure = estimate.identified and (whole.precise or no_ratio)
        if not held and sure:
            known.append((symbol, value, unit))
        elif not held:
            unknown.append(symbol)
    return known, unknown


def _known(fit: Identification) -> list[str]:
    """List the quantities that the data determine at any scale of the forces, and the others."""
    known, unknown = determined(fit)
    lines = ["determined by the data" if known else "the data determine no parameter"]
    lines += [f"  {symbol:<10} {value:>12.6g}  {unit}".rstrip() for symbol, value, unit in known]
    if unknown:
        lines.append("not determined: " + ", ".join(unknown))
    return lines


def _ratios(fit: Identification) -> list[tuple[str, str, float, str]]:
    """Parameter, symbol, value and unit of what does not depend on the scale of the forces."""
    ratios = fit.model.force_ratios()
    if fit.data.drive_unit == "m":
        per_metre = [PER_METRE.get(unit, (unit, 1.0)) for *_, unit in ratios]
        ratios = [(*r[:2], s * r[2], unit) for r, (unit, s) in zip(ratios, per_metre, strict=True)]
    # Friction that is 0 and was not searched is left out.
    return [r for r in ratios if r[0] != "b0" or fit.parameters["b0"].free or r[2]]


def _constraints(fit: Identification) -> list[str]:
    """List the inequalities, and which of them decide the result."""
    if not fit.constraints:
        return []
    wide = max(len(one.text) for one in fit.constraints)
    rows = [f"  {one.text:<{wide}}  {STATES[one.active]}" for one in fit.constraints]
    return ["", "constraints", *rows]


def parameter_notes(fit: Identification, name: str) -> str:
    """Write scale, tie, prior and active bound of a parameter.

    Parameters
    ----------
    fit : Identification
        Result of an identification.
    name : str
        The parameter.

    Returns
    -------
    str
        Behind a standard deviation, beginning with a comma; empty where there is nothing.
    """
    estimate, notes = fit.parameters[name], []
    if estimate.at_bound:
        on = any(one.active and name in (one.lower, one.upper) for one in fit.constraints)
        notes.append("on a constraint" if on else "on a bound")
    if not estimate.free and estimate.deviation == math.inf and fit.covariance is not None:
        notes.append("intervals allow for it")
    if fit.search and name in fit.search.scales:
        notes.append(f"{fit.search.scales[name]} scale")
    if estimate.tie is not None:
        notes.append(f"tied: {estimate.tie}")
    if estimate.prior is not None:
        mean, width = estimate.prior
        notes.append(f"prior {mean:.6g} +- {width:.4g} {estimate.unit}".rstrip())
    return "".join(f", {one}" for one in notes)


def _row(fit: Identification, name: str, estimate: Estimate, width: int) -> str:
    if not estimate.free and estimate.tie is None:
        note = "held" if estimate.deviation is None else "held: no effect on the data"
    elif estimate.deviation == 0.0:
        note = "held"
    elif estimate.deviation is None:
        note = "" if estimate.at_bound else "unknown"
    elif not math.isfinite(estimate.deviation):
        note = "no effect on the data"
    else:
        share = 100 * estimate.deviation / abs(estimate.value) if estimate.value else math.inf
        digits = f"{share:.2g}" if share < 10 else f"{share:.0f}"
        note = f"{digits} %" if share < 100 else "larger than the value"
    note = (note + parameter_notes(fit, name)).removeprefix(", ")
    return (
        f"  {name:<18}{estimate.symbol:<{width}}{estimate.value:>13.6g}  {estimate.unit:<9}{note}"
    ).rstrip()
