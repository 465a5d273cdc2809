"""Decoupling of several axes: matrices at rest, and drives along a reference that repeats."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.arguments import expect, in_range, one_of, positive
from ..._support.arrays import real_array
from ...errors import DataError, NumericalError, ShapeError
from ..modal_model import MultiAxisModel
from ..virtual import VirtualAxes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..modal_terms import ModalTerms

    Array = NDArray[np.float64]

__all__ = ["DECOUPLINGS", "decoupling_matrix", "repeating_drive", "terms_of"]

DECOUPLINGS = ("static", "diagonal")
# Largest condition number of the gains at rest that are inverted.
CONDITION = 1e8


def terms_of(stage: MultiAxisModel | VirtualAxes, level: float | None) -> ModalTerms:
    """Return the modes of a model or of a stage whose modes are known."""
    expect("model", stage, (MultiAxisModel, VirtualAxes), "a MultiAxisModel or a VirtualAxes")
    return stage.terms if isinstance(stage, VirtualAxes) else stage.at(level)


def decoupling_matrix(
    model: MultiAxisModel | VirtualAxes, kind: str = "static", *, level: float | None = None
) -> Array:
    r"""Return the matrix from wanted displacements to drives.

    .. math:: T = G(1)^{+} \quad \text{or} \quad T = \mathrm{diag}(G_{ii}(1))^{-1}

    Parameters
    ----------
    model : MultiAxisModel or VirtualAxes
        The axes.
    kind : {"static", "diagonal"}, optional
        Inverse of all gains at rest, least squares where there are more sensors than drives; or of
        the gains of each axis by itself, which leaves the coupling as it is.
    level : float, optional
        Level of the drives [V rms] at which the gains are taken, as of `MultiAxisModel.at`.

    Returns
    -------
    ndarray, shape (drives, sensors)
        T [V/m].

    Raises
    ------
    ParameterError
        `kind` is none of these.
    ShapeError
        The axes cannot be taken one by one, as there are not as many drives as sensors.
    NumericalError
        The gains at rest have no inverse.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.multiaxis.VirtualAxes.three()
    >>> matrix = pt.multiaxis.decoupling_matrix(stage)
    >>> abs(stage.static_gain @ matrix).round(9).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    one_of("kind", kind, DECOUPLINGS)
    gain = terms_of(model, level).response(np.ones(1, dtype=np.complex128))[0].real
    if kind == "diagonal":
        if gain.shape[0] != gain.shape[1]:
            raise ShapeError(
                "model", f"{gain.shape[1]} drives and {gain.shape[0]} sensors", "as many of both"
            )
        gain = np.diag(np.diag(gain))
    if not np.linalg.cond(gain) < CONDITION:
        raise NumericalError("the gains at rest have no inverse: expected independent axes")
    return np.asarray(np.linalg.pinv(gain))


def repeating_drive(
    model: MultiAxisModel | VirtualAxes,
    reference: ArrayLike,
    *,
    level: float | None = None,
    regularisation: float = 1e-3,
    highest: float | None = None,
) -> Array:
    r"""Return the drives under which the axes follow a reference that repeats.

    .. math:: U = G^H (G G^H + \lambda^2 I)^{-1} R

    at each line, with :math:`\lambda` relative to the largest gain at rest: the inverse of all
    responses, which takes no notice of what is not minimum phase, as it knows all of the period.

    Parameters
    ----------
    model : MultiAxisModel or VirtualAxes
        The axes.
    reference : array_like, shape (samples, sensors)
        Wanted displacements over a period [m].
    level : float, optional
        Level of the drives [V rms] of the modes, as of `MultiAxisModel.at`.
    regularisation : float, optional
        Ratio of lambda to the largest gain at rest; larger ones need smaller drives.
    highest : float, optional
        Frequency above which the reference is left out [Hz]; half the sampling rate by default.

    Returns
    -------
    ndarray, shape (samples, drives)
        Drives over a period, about the operating point [V].

    Raises
    ------
    ShapeError
        The reference has another number of axes.
    DataError
        A sample of the reference is not finite.
    ParameterError
        An argument is out of its range.
    """
    terms = terms_of(model, level)
    sensors = terms.direct.shape[0]
    wanted = reference_of(reference, sensors)
    count = len(wanted)
    frequency = np.arange(count // 2 + 1) / (count * model.dt)
    response = terms.response(np.exp(2j * np.pi * frequency * model.dt))
    size = float(np.linalg.norm(response[0], 2))
    small = in_range("regularisation", regularisation, 1e9, "gains at rest") * size
    spectrum = np.fft.rfft(wanted, axis=0)
    if highest is not None:
        spectrum[frequency > positive("highest", highest, "Hz")] = 0.0
    adjoint = response.conj().transpose(0, 2, 1)
    # Of as many drives as sensors or more; fewer are solved by least squares.
    if terms.direct.shape[1] >= sensors:
        gram = response @ adjoint + small * small * np.eye(sensors)
        drives = (adjoint @ np.linalg.solve(gram, spectrum[:, :, np.newaxis]))[:, :, 0]
    else:
        gram = adjoint @ response + small * small * np.eye(terms.direct.shape[1])
        drives = np.linalg.solve(gram, adjoint @ spectrum[:, :, np.newaxis])[:, :, 0]
    return np.asarray(np.fft.irfft(drives, count, axis=0))


def reference_of(reference: ArrayLike, sensors: int) -> Array:
    """Return a reference as an array, samples x sensors, after its checks."""
    wanted = real_array("reference", reference)
    if wanted.ndim != 2 or wanted.shape[1] != sensors or len(wanted) < 2:
        raise ShapeError(
            "reference",
            f"the shape {wanted.shape}",
            f"samples x {sensors} axes, two samples or more",
        )
    if not np.abs(wanted).max() < _core.LARGEST:
        raise DataError("reference: expected finite numbers only")
    return wanted
