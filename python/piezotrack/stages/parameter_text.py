"""Docstrings of the stage classes, with the parameters that several models share."""

from __future__ import annotations

import inspect
import re
import textwrap

from .model_info import MECHANICS, ModelInfo, Parameter

__all__ = ["with_shared_parameters"]

# By name, behind symbol and unit.
SHARED = {
    "mass": ", above 0.",
    "damping": ", 0 or above.",
    "stiffness": ", above 0.",
    "piezo_coefficient": ", not 0.",
    "creep_weights": (
        ", final contribution of each relaxation of the creep as a share, 0 or above; 8 at most."
    ),
    "creep_times": ", as many: see `Stage`.",
    "time_constant": " of a first-order lag.",
    "frequency": ", undamped frequency of a mode; not with `time_constant`.",
    "damping_ratio": ", damping ratio of that mode.",
    "mode_weights": ", each between -1 and 1, of further modes in parallel with it; 3 at most.",
    "mode_frequencies": ", undamped frequency of each.",
    "mode_damping_ratios": ", damping ratio of each.",
}
HEAD = "Parameters\n----------\n"
NAMES = re.compile(r"^(\w.*) : ", re.MULTILINE)
WIDTH = 92


def with_shared_parameters(text: str, model: ModelInfo) -> str:
    """Add the shared parameters that a docstring does not explain itself.

    Parameters
    ----------
    text : str
        Docstring of the class, with a section of the parameters that only the model has; no blank
        line is between them.
    model : ModelInfo
        The model.

    Returns
    -------
    str
        The docstring with an entry for every parameter, those of the mechanics first.
    """
    above, head, below = inspect.cleandoc(text).partition(HEAD)
    if not head:  # under python -OO
        return text
    entries, blank, sections = below.partition("\n\n")
    explained = ", ".join(NAMES.findall(entries)).split(", ")
    missing = [one for one in model.parameters if one.name in SHARED and one.name not in explained]
    mechanics = [_entry(one) for one in missing if one.name in MECHANICS]
    others = [_entry(one) for one in missing if one.name not in MECHANICS]
    return above + head + "\n".join([*mechanics, entries, *others]) + blank + sections


def _entry(parameter: Parameter) -> str:
    kind = "sequence of float" if parameter.is_list else "float"
    optional = "" if parameter.name in MECHANICS else ", optional"
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    sentence = textwrap.fill(f"{parameter.symbol}{unit}{SHARED[parameter.name]}", WIDTH)
    return f"{parameter.name} : {kind}{optional}\n{textwrap.indent(sentence, '    ')}"
