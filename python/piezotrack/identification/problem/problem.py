"""The problem of an identification: a model, records, and what is known of the parameters."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

from ..._support.arguments import as_numbers, has_entries
from ..._support.messages import quoted
from ...data.checks import diagnostics
from ...errors import ParameterError
from ...stages.registry import model_named
from .fingerprint import as_plain_data, record_hash
from .parameter import Parameter, parameters_of, plain_text
from .records import Record, labels_of, of_record

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...stages.model_info import ModelInfo

__all__ = ["AUTO", "Problem"]

# The name that stands for the model that suits the records best.
AUTO = "auto"
# Defaults of a record that are not part of the settings of a problem.
RECORD_DEFAULTS = {"offset": True, "delay": None, "drift": None, "history": None, "weight": 1.0}


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Problem of an identification: model, records and parameters, without the method.

    The compiled module reads its attributes.

    Attributes
    ----------
    model : str
        Name of the model, or ``"auto"``.
    records : tuple of Record
        At least one.
    parameters : mapping of str to Parameter
        The parameters of which something is said.
    constraints : tuple of str
        Inequalities between two parameters.
    creep : bool or tuple of float or None
        Whether the stage creeps, or its time constants [s].

    Raises
    ------
    ParameterError
        There is no such model, or an attribute does not apply to it.
    """

    model: str
    records: tuple[Record, ...]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    constraints: tuple[str, ...] = ()
    creep: bool | tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if isinstance(self.model, str) and self.model == AUTO:
            self._refuse_of_one_model()
        elif not self.info.searched:
            for name in ("parameters", "constraints", "creep"):
                if (value := getattr(self, name)) not in ({}, (), None):
                    raise ParameterError(
                        name,
                        quoted(value),
                        f"none with the model '{self.model}', whose parameters follow by least "
                        "squares",
                    )

    @classmethod
    def checked(
        cls,
        model: str,
        records: tuple[Record, ...],
        parameters: object,
        constraints: object,
        creep: object,
    ) -> Self:
        """Check the arguments of `identify`; None stands for what is not given."""
        return cls(
            model=model,
            records=records,
            parameters=parameters_of(parameters),
            constraints=_inequalities(constraints),
            creep=_creep_of(creep),
        )

    def _refuse_of_one_model(self) -> None:
        """Refuse what names parameters of one model; all that are searched have a stiffness."""
        others = {
            name: parameter
            for name, parameter in self.parameters.items()
            if name != "stiffness" or list(_stated(parameter)) != ["value"]
        }
        for name, value in (("parameters", others), ("constraints", self.constraints)):
            if value:
                raise ParameterError(
                    name,
                    quoted(value),
                    "none with model='auto'; name the model whose parameters these are, as "
                    "model='dahl'",
                )

    @property
    def info(self) -> ModelInfo:
        """The model; not of ``"auto"``."""
        return model_named(self.model)

    @property
    def is_searched(self) -> bool:
        """Whether parameters are searched, from a seed; of ``"auto"`` those of some models are."""
        return self.model == AUTO or self.info.searched

    @property
    def labels(self) -> tuple[str, ...]:
        """How messages call each record."""
        return labels_of(self.records)

    def of_model(self, info: ModelInfo) -> Problem:
        """Return the problem for a model, without what does not apply to it."""
        if info.searched:
            return replace(self, model=info.name)
        return Problem(model=info.name, records=self.records)

    def check_data(self) -> None:
        """Refuse records from which the parameters of a hysteresis cannot be searched.

        Raises
        ------
        DataError
            Neither drive nor displacement of a record ever reverses.
        """
        held = {name for name, one in self.parameters.items() if one.value is not None}
        for record, label in zip(self.records, self.labels, strict=True):
            with of_record(label):
                diagnostics.check_record(
                    record.data, searches_hysteresis=bool(set(self.info.hysteresis) - held)
                )

    def settings(self) -> dict[str, Any]:
        """Return all but the records as plain data, without defaults."""
        of_stage = {
            "parameters": {name: _stated(one) for name, one in self.parameters.items()},
            "constraints": list(self.constraints),
            "creep": self.creep,
        }
        return {"model": self.model} | {
            name: as_plain_data(name, value)
            for name, value in of_stage.items()
            if value not in ({}, [], None)
        }

    def record_settings(self) -> list[dict[str, Any]]:
        """Return what is said of each record alone as plain data, without defaults."""
        return [
            {
                name: as_plain_data(name, value)
                for name, default in RECORD_DEFAULTS.items()
                if (value := getattr(record, name)) != default
            }
            for record in self.records
        ]

    def content(self) -> list[Any]:
        """Return all that a solution depends on as plain data, records by their hashes."""
        hashes = [record_hash(one.data) for one in self.records]
        return [hashes, self.record_settings(), self.settings()]


def _stated(parameter: Parameter) -> dict[str, Any]:
    """Return what is said of a parameter."""
    return {name: value for name, value in vars(parameter).items() if value is not None}


def _inequalities(constraints: object) -> tuple[str, ...]:
    """Check the types of inequalities."""
    if constraints is None:
        return ()
    if not has_entries(constraints):
        raise ParameterError("constraints", quoted(constraints), "texts in a list, as ['a2 < b1']")
    texts = tuple(constraints)
    for text in texts:
        if not isinstance(text, str):
            raise ParameterError(
                "constraint", quoted(text), "a text, as 'a2 < b1'", argument="constraints"
            )
    return tuple(map(plain_text, texts))


def _creep_of(creep: object) -> bool | tuple[float, ...] | None:
    """Check the type of a creep."""
    if creep is None or isinstance(creep, bool):
        return creep
    if not has_entries(creep):
        raise ParameterError(
            "creep", quoted(creep), "True, False or time constants in seconds, as [0.1, 1.0]"
        )
    return as_numbers("creep", creep)
