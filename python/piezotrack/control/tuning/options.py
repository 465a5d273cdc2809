"""The options of `tune` as types, for its overloads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypedDict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...stages.inverse import Inverse
    from ..parts.filters import LowPass, Notch
    from .margins import Margins, Spread
    from .structures import LawName

__all__ = ["TuneOptions"]


class TuneOptions(TypedDict, total=False):
    """What `tune` takes by name; see there."""

    dt: float | Sequence[float] | None
    limits: tuple[float, float] | None
    feedforward: Inverse | Sequence[Inverse | None] | Literal["inverse"] | None
    parts: Sequence[str] | str | None
    filters: Sequence[LowPass | Notch] | Sequence[Sequence[LowPass | Notch]]
    law: LawName
    margins: Margins | None
    spread: Spread | None
    figure: Literal["rms", "largest", "effort"]
    effort: float
    allowed: float
    slew: float
    clipped: float
    delay: float
    jitter: float
    visited: float | Sequence[float]
    error: Literal["measured", "true"]
    seeds: int
    particles: int
    iterations: int
    seed: int
    threads: int
