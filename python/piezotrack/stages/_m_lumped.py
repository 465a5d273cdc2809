"""What stages share whose parameters are plain numbers, mass, damping and stiffness among them."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from .. import _core

if TYPE_CHECKING:
    from .inverse import Inverse

__all__ = ["LumpedStage"]


class LumpedStage:
    """Base of the stages that a swarm can search: a dataclass of floats.

    A subclass says its name in the core and which parameters the core has for it.
    """

    _kind: ClassVar[str]
    _parameters: ClassVar[list[tuple[str, str, str]]]

    def __post_init__(self) -> None:
        for name in self.parameter_names():
            object.__setattr__(self, name, _core.as_number(name, getattr(self, name)))
        _core.stage_check(self._kind, self.theta)

    @property
    def theta(self) -> tuple[float, ...]:
        """The parameters in their order."""
        # Not dataclasses.astuple, which copies deeply and takes longer than a short simulation.
        return tuple(getattr(self, name) for name, _, _ in self._parameters)

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the parameters, in their order.

        Returns
        -------
        tuple of str
            As the constructor takes them.
        """
        return tuple(name for name, _, _ in cls._parameters)

    def inverse(
        self, *, playback: Literal["table", "online"] = "table", settle: int = 1
    ) -> Inverse:
        """Feedforward of the bare stage, as `Inverse` describes.

        Parameters
        ----------
        playback : {"table", "online"}, optional
            Whether one settled period is played again and again, or all is computed.
        settle : int, optional
            Periods before the one of the table.

        Returns
        -------
        Inverse
            For `Controller` or on its own.
        """
        from .inverse import Inverse

        # Which stages have an inverse is known there.
        return Inverse(stage=self, playback=playback, settle=settle)  # type: ignore[arg-type]
