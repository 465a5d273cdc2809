"""The list of stage models by name, with their classes and what the core lists of them."""

from __future__ import annotations

from importlib import import_module

from .._support.messages import quoted
from ..errors import ParameterError
from .base import REGISTERED, Stage
from .model_info import LISTED, ModelInfo

__all__ = ["MODELS", "ModelInfo", "Stage", "model_named", "model_of", "stage_class"]

# The models as the core lists them, in its order.
MODELS: tuple[ModelInfo, ...] = tuple(LISTED.values())


def model_named(name: object) -> ModelInfo:
    """Find the model of a name.

    Parameters
    ----------
    name : object
        Argument of the caller.

    Returns
    -------
    ModelInfo
        The model.

    Raises
    ------
    ParameterError
        There is no such model.
    """
    for model in MODELS:
        if model.name == name:
            return model
    expected = " or ".join(repr(model.name) for model in MODELS)
    raise ParameterError(f"model is {quoted(name)}: expected {expected}")


def stage_class(model: ModelInfo) -> type[Stage]:
    """Find the class of a model, in the module of the same name.

    Parameters
    ----------
    model : ModelInfo
        The model.

    Returns
    -------
    type
        The class of its stages.
    """
    if model.name not in REGISTERED:
        import_module(f".{model.name.replace('-', '_')}", __package__)
    return REGISTERED[model.name]


def model_of(stage: object, argument: str = "model") -> ModelInfo:
    """Return the model of a stage; `argument` names it in errors.

    Parameters
    ----------
    stage : object
        The stage.
    argument : str, optional
        The argument, for the message.

    Returns
    -------
    ModelInfo
        The model.

    Raises
    ------
    ParameterError
        It is not a stage.
    """
    if isinstance(stage, Stage):
        return stage.info
    raise ParameterError(
        f"{argument} is {type(stage).__name__}: expected a stage, as a pt.DahlStage"
    )
