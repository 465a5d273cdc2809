"""A stage of another kind for a check of tuned gains, fitted to the record of the first."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from ....errors import PiezotrackError
from ....identification.fit import identify
from ....identification.fitted.identification import Identification
from ...running.track import track
from .followers import with_zero

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ....references.reference import Reference
    from ...controller.controller import Controller
    from ..problem import Axis

__all__ = ["OtherKind", "tried_on_other_kind"]

# Samples of the record that the other stage is fitted to, at most.
SAMPLES = 2000


class OtherKind(NamedTuple):
    """Loop with tuned gains on a stage of another kind, fitted to the same record.

    Attributes
    ----------
    model : str
        Name of its model.
    rms_error : float
        Rms error over all references [m].
    """

    model: str
    rms_error: float


def tried_on_other_kind(
    axis: Axis, controller: Controller, references: Sequence[Reference]
) -> OtherKind | None:
    """Try gains on a stage of another kind where the record of the first is known.

    A play or relay model is answered by a Bouc-Wen stage, any other by plays.

    Parameters
    ----------
    axis : Axis
        Stages, of which the first was identified, and timing.
    controller : Controller
        The tuned controller.
    references : sequence of Reference
        Motions.

    Returns
    -------
    OtherKind or None
        None where the first stage is no result of an identification, where the other model cannot
        be fitted to its record, and without a reference.
    """
    fit = axis.stages[0]
    if not (references and isinstance(fit, Identification)):
        return None
    plays = type(fit.model).__module__.split(".")[-2] in ("plays", "relays")
    model = "bouc-wen" if plays else "prandtl-ishlinskii"
    data = fit.data
    if len(data.t) > SAMPLES:
        data = data[float(data.t[0]) : float(data.t[SAMPLES])]
    try:
        other = identify(data, model, progress=False)
    except PiezotrackError:
        return None
    stage = with_zero(axis, other)
    squares = [
        track(
            stage, controller, one, timing=axis.timing, beyond_reach=True, unstable=True
        ).metrics.rms_error
        ** 2
        for one in references
    ]
    return OtherKind(model, math.sqrt(sum(squares) / len(squares)))
