"""The list of stage models by name, with their classes and what the core lists of them."""

from __future__ import annotations

import re
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec

from .._support.messages import quoted
from ..errors import ParameterError
from .base import REGISTERED, Stage
from .model_info import LISTED, ModelInfo

__all__ = ["MODELS", "ModelInfo", "Stage", "model_named", "model_of", "stage_class"]

# The models as the core lists them, in its order.
MODELS: tuple[ModelInfo, ...] = tuple(LISTED.values())
# The packages of their modules.
FAMILIES = ("feedback", "input", "plays", "relays")
# A longer text is no misspelt name.
LONGEST_NAME = 100


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
        There is no such model. The message names the one that is probably meant.
    """
    for model in MODELS:
        if isinstance(name, str) and model.name == name:
            return model
    if (near := _meant(name)) is not None:
        raise ParameterError("model", quoted(name), f"the name of one (did you mean {near!r}?)")
    expected = ", ".join(repr(model.name) for model in MODELS)
    raise ParameterError("model", quoted(name), f"one of {expected}")


def _meant(name: object) -> str | None:
    """Return the model that a wrong name is nearest to: its initials, as PI, or almost its name."""
    if not isinstance(name, str) or len(name) > LONGEST_NAME:
        return None
    plain = "-".join(re.split(r"[\s_-]+", name.strip().lower()))
    names = [model.name for model in MODELS]
    initials = ["".join(word[0] for word in name.split("-")) for name in names]
    if plain in initials:
        return names[initials.index(plain)]
    begun = [name for name in names if len(plain) > 2 and name.startswith(plain)]
    return next(iter(begun or get_close_matches(plain, names, n=1)), None)


def stage_class(model: ModelInfo) -> type[Stage]:
    """Find the class of a model, in the module of the same name of a family.

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
        homes = [f"{__package__}.{one}.{model.name.replace('-', '_')}" for one in FAMILIES]
        import_module(next(home for home in homes if find_spec(home)))
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
    raise ParameterError(argument, quoted(stage), "a stage, as a pt.DahlStage")
