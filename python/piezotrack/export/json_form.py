"""The linear parts of a controller as coefficients, for those who write their own step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .. import _core
from .c99.parts import coefficients_of, shape_of

if TYPE_CHECKING:
    from ..control.controller.controller import Controller

__all__ = ["coefficients_document"]

SLIDING = ("switching", "gain", "integral", "derivative", "fresh")
DISTURBANCE = ("fresh", "pole", "inverse")
DAHL = ("pole", "fresh", "correction", "a1", "a2", "gain", "longest")


def coefficients_document(
    controller: Controller, table: list[float] | None = None
) -> dict[str, Any]:
    """Write the coefficients of a controller: biquads, state space, taps.

    Parameters
    ----------
    controller : Controller
        The controller.
    table : list of float, optional
        One period of the feedforward.

    Returns
    -------
    dict
        Of numbers, texts, lists and dicts only.

    Raises
    ------
    ParameterError
        The feedback law is not made of coefficients.
    """
    # A feedforward without a table is left out: its inverse is not linear.
    laws = shape_of(controller, table if controller.feedforward is None else table or [])
    numbers, unit = coefficients_of(controller), controller.drive_unit
    low, high = controller.limits
    return {
        "format": "piezotrack-coefficients",
        "schema_version": 1,
        "dt_s": float(controller.dt),
        f"limits_{unit}": [low, high],
        "span_m": numbers["span"],
        "filters": [_biquad(one[:3], [1.0, *one[3:]]) for one in numbers["filters"]],
        "feedback": _feedback(numbers, unit) if laws.law else None,
        "repetitive": _repetitive(numbers, unit),
        f"feedforward_table_{unit}": table,
        "provenance": {"package": "piezotrack", "version": _core.__version__},
    }


def _biquad(b: list[float], a: list[float]) -> dict[str, Any]:
    return {
        "equation": "a[0] y[k] = b[0] x[k] + b[1] x[k-1] + b[2] x[k-2] - a[1] y[k-1] - a[2] y[k-2]",
        "b": b,
        "a": a,
    }


def _feedback(numbers: dict[str, Any], unit: str) -> dict[str, Any]:
    """Coefficients of the law, and of the one inside of it."""
    if "b" in numbers:
        n = len(numbers["b"])
        return {
            "kind": "state-space",
            "equation": "u[k] = C x[k] + D e[k], x[k+1] = A x[k] + B e[k] + l (v[k] - u[k])",
            "a": [numbers["a"][i * n : i * n + n] for i in range(n)],
            "b": numbers["b"],
            "c": numbers["c"],
            f"d_{unit}_per_m": numbers["d"][0],
            "back": numbers.get("back"),
        }
    if "sliding-mode" in numbers:
        inside: dict[str, Any] = {"kind": "sliding-mode"}
        inside |= dict(zip(SLIDING, numbers["sliding-mode"], strict=True))
    else:
        kp, ki, kd, tracking = numbers["pid"]
        inside = {"kind": "pid", "tracking": tracking} | _biquad(
            [kp + ki + kd, -(kp + 2.0 * kd), kd], [1.0, -1.0, 0.0]
        )
    for kind, names in (("disturbance-observer", DISTURBANCE), ("dahl-observer", DAHL)):
        if kind in numbers:
            around = dict(zip(names, numbers[kind], strict=True))
            return {"kind": kind} | around | {"inside": inside}
    if "damping" in numbers:
        b0, b1, b2, *a = numbers["damping"]
        measured = _biquad([b0, b1, b2], [1.0, *a])
        return {"kind": "damping", "of_measurement": measured, "inside": inside}
    return inside


def _repetitive(numbers: dict[str, Any], unit: str) -> dict[str, Any] | None:
    if "repetitive" not in numbers:
        return None
    pole, gain, period, pause = numbers["repetitive"]
    lead, nearest, *_ = (int(one) for one in numbers["repetitive lengths"])
    taps = numbers["taps"]
    return {
        "equation": "uRC[k] = pole uRC[k-1] + sum of tap (uRC[k-n] + gain e[k-n+lead]), "
        "n from its delay",
        "period_samples": period,
        "pole": pole,
        f"gain_{unit}_per_m": gain,
        "lead_samples": lead,
        "taps": taps,
        "delays_samples": [nearest + len(taps) - 1 - i for i in range(len(taps))],
        "pause": bool(pause),
    }
