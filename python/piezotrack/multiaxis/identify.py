"""`identify_axes`: modes of several axes from periodic records at one level or several."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arguments import expect, has_entries
from .._support.messages import quoted
from ..errors import DataError, ParameterError
from .approximation import MultiAxisResponse, approximate_axes
from .distortion import MOST, Distortion, choose_distortion
from .modal_model import AxesLevel, MultiAxisModel
from .record import MultiAxisRecord, check_same
from .target import Target

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .modal_terms import ModalTerms

__all__ = ["identify_axes"]

# Most states by default, and at all.
CAP, MOST_STATES = 44, 120
# Ratio of two levels at least.
DISTINCT = 1.02
# Misfit in expected ones from which the modes do not describe a response.
APART = 1.3
# Power of the variance by which lines are weighted while modes are sought, and at the end where
# they describe the response: near the inverse, yet lines of small variance do not rule alone.
# Largest mean square error, in variances, for which they do.
VARIANCE, DESCRIBED = 0.75, 1.15
# Price of a departure from the modes of the level beside, in mean square errors of a number.
HELD = 100.0


def identify_axes(
    records: MultiAxisRecord | Sequence[MultiAxisRecord],
    *,
    states: int | None = None,
    most: int = CAP,
    distortion: bool | int = True,
) -> MultiAxisModel:
    """Identify the modes of a stage of several axes.

    The best linear approximation of each record is fitted by modes in parallel, each of rank one
    with one pole for all drives and sensors, by weighted least squares. Weights are near the
    inverse of the variance where the modes then describe the response within it; otherwise they
    are the power of the drives, so that the error of the displacement under such drives is least.
    Modes are sought at the middle level, and refined from there at the others, so that they are
    the same at all levels. Two runs give the same bits.

    Parameters
    ----------
    records : MultiAxisRecord or sequence of MultiAxisRecord
        Periodic records in steady state, one for each level.
    states : int, optional
        Number of states, even; by default chosen by the criterion of Schwarz (1978, doi
        10.1214/aos/1176344136), with twice its penalty.
    most : int, optional
        Most states where they are chosen.
    distortion : bool or int, optional
        Whether nonlinear functions of drives and elongations are sought that act on the modes; or
        the most numbers that describe what they do.

    Returns
    -------
    MultiAxisModel
        The modes at each level.

    Raises
    ------
    ParameterError
        An argument is out of its range, or records have the same level, or differ in their
        interval.
    ShapeError
        Records have different numbers of drives or sensors.
    DataError
        A record has fewer realisations than drives, or fewer lines than unknowns.
    NumericalError
        The responses do not change with the frequency.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.multiaxis.VirtualAxes.three(noise=1e-9, seed=1)
    >>> model = pt.multiaxis.identify_axes(stage.record())
    >>> model
    <MultiAxisModel: 3 x 3, 10 states, levels of 1 V rms>
    >>> model.frequencies().round(1).tolist()
    [180.0, 231.0, 262.0, 540.0, 720.0]
    """
    if isinstance(records, MultiAxisRecord):
        records = [records]
    if not has_entries(records):
        raise ParameterError("records", quoted(records), "a MultiAxisRecord or a list of them")
    records = list(records)
    if not records:
        raise ParameterError("records", "an empty list", "a record or more")
    for k, record in enumerate(records):
        expect("records", record, MultiAxisRecord, "a MultiAxisRecord or a list of them")
        check_same(records[0], record, k)
    records.sort(key=lambda one: one.level)
    for lower, upper in itertools.pairwise(records):
        if upper.level < DISTINCT * lower.level:
            raise ParameterError(
                "records",
                f"two of {lower.level:.4g} {lower.drive_unit} rms",
                "distinct levels; MultiAxisRecord.joined makes realisations of one of them",
                verb="have",
            )
    modes = _modes("most", most) if states is None else _modes("states", states)
    responses = [approximate_axes(record) for record in records]
    for response in responses:
        _check_lines(response, modes)
    middle = len(records) // 2
    scale = float(np.sqrt(np.mean(np.square(np.abs(responses[middle].value)))))
    target = Target(responses[middle], scale, VARIANCE)
    start = target.pursue(modes, fixed=states is not None)
    power = VARIANCE if target.misfit(start) < DESCRIBED * target.expected else 0.0
    targets = [Target(response, scale, power) for response in responses]
    found = {middle: targets[middle].refine(start)}
    # Outwards from the middle, each level from the one beside it.
    for k in [*range(middle - 1, -1, -1), *range(middle + 1, len(records))]:
        start = found[k + 1] if k < middle else found[k - 1]
        found[k] = targets[k].refine(start, held=HELD)
    levels = tuple(
        _level(response, targets[k], found[k], scale) for k, response in enumerate(responses)
    )
    chosen = Distortion()
    pairs = _pairs(distortion)
    if pairs:
        linear = [one.terms for one in levels]
        chosen, forced, shares = choose_distortion(records, responses, linear, most=pairs)
        levels = tuple(
            replace(one, terms=terms, distorted=left)
            for one, terms, left in zip(levels, forced, shares, strict=True)
        )
    notes = []
    for one, response in zip(levels, responses, strict=True):
        label = f"{one.level:.3g} {records[0].drive_unit}: " if len(levels) > 1 else ""
        notes += [label + note for note in response.notes]
        if one.misfit > APART * one.expected:
            notes.append(
                f"{label}the modes leave {100 * one.misfit:.2g} % of the response, where noise and "
                f"distortion explain {100 * one.expected:.2g} %"
            )
    return MultiAxisModel(
        levels=levels,
        dt=records[0].dt,
        drive_unit=records[0].drive_unit,
        output_unit=records[0].output_unit,
        distortion=chosen,
        responses=tuple(responses),
        source=records[0].source,
        notes=tuple(notes),
    )


def _pairs(distortion: bool | int) -> int:
    """Return the most forces, each of two numbers."""
    if isinstance(distortion, int) and not isinstance(distortion, bool):
        return min(_core.as_count("distortion", distortion) // 2, MOST)
    return MOST if _core.as_truth("distortion", distortion) else 0


def _modes(name: str, states: int) -> int:
    count = _core.as_count(name, states)
    if count % 2 or not 2 <= count <= MOST_STATES:
        raise ParameterError(name, states, f"an even number from 2 to {MOST_STATES}")
    return count // 2


def _check_lines(response: MultiAxisResponse, modes: int) -> None:
    """Refuse a response with fewer numbers than unknowns."""
    lines, sensors, drives = response.value.shape
    unknowns = modes * 2 * (drives + sensors) + drives * sensors
    if 2 * lines * sensors * drives <= unknowns or lines < 2:
        raise DataError(
            f"the record excites {lines} lines: expected more than "
            f"{unknowns // (2 * sensors * drives)} for {2 * modes} states"
        )


def _level(
    response: MultiAxisResponse, target: Target, terms: ModalTerms, scale: float
) -> AxesLevel:
    decay_sd, angle_sd = target.pole_deviations(terms)
    # Errors are those of the displacement, whichever weights were used.
    plain = Target(response, scale, 0.0)
    return AxesLevel(
        level=response.level,
        terms=terms.scaled(scale).balanced(),
        decay_sd=decay_sd,
        angle_sd=angle_sd,
        misfit=float(np.sqrt(plain.misfit(terms) / plain.size)),
        expected=float(np.sqrt(plain.expected / plain.size)),
        drive_mean=response.drive_mean,
        output_mean=response.output_mean,
    )
