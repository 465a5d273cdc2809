"""The tree of C sources: what an export needs of it, joined."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from importlib.resources.abc import Traversable

__all__ = ["CHOICES", "choices_of", "choices_text", "filled", "joined", "source_of"]

# What `#if` in the tree asks for: each is 0 or 1.
CHOICES = (
    *("SINGLE", "TUNED", "FILTERED", "JUMPS", "REPEATS", "PAUSES", "LEADS"),
    *("FORWARD_TABLE", "FORWARD_ONLINE", "DELAYED", "DAHL_OPERATOR"),
    *("LAW_ANY", "LAW_PID", "LAW_SPACE", "LAW_SLIDING", "LAW_DISTURBANCE", "LAW_DAHL"),
    *(
        "CLOSED",
        "LAW_DAMPED",
        "FOLLOWS",
        "BACK",
        "TOLD_MEASURED",
        "TOLD_APPLIED",
        "TOLD_FEEDFORWARD",
    ),
)
# Headers that are written for the choices, where the tree is compiled as it is.
CHOSEN = ("choices.h", "constants.h")
DIRECTIVE = re.compile(r"#(ifdef|ifndef|if|elif|else|endif)\b(.*)")
INCLUDE = re.compile(r'#include "(.*)"')


def source_of(package: str) -> Traversable:
    """Return the folder with the C sources of a package."""
    return files(package).joinpath("source")


@cache
def _text(package: str, file: str) -> str:
    """Read a file of a tree."""
    return source_of(package).joinpath(*file.split("/")).read_text(encoding="utf-8")


def choices_of(chosen: Iterable[str]) -> dict[str, bool]:
    """Give every choice its value."""
    made = set(chosen)
    assert made <= set(CHOICES), made
    return {name: name in made for name in CHOICES}


def choices_text(choices: Mapping[str, bool]) -> str:
    """Write the header of what was chosen, for the tree as it is."""
    return "".join(f"#define {name} {int(value)}\n" for name, value in choices.items())


def filled(text: str, pieces: Mapping[str, str]) -> str:
    """Put pieces in the places of their keys."""
    for key, piece in pieces.items():
        text = text.replace(key, piece)
    return text


def joined(
    file: str,
    choices: Mapping[str, bool],
    given: Mapping[str, str],
    package: str = __package__,
) -> str:
    """Join a file of the tree with those that it includes, for some choices.

    Parameters
    ----------
    file : str
        The file.
    choices : mapping
        Values of the choices; the other conditions stay.
    given : mapping
        Texts for headers that are not in the tree; for a file of the tree, what comes below its
        title. Other headers stay included.
    package : str, optional
        Package of the tree.

    Returns
    -------
    str
        The text, without the conditions and inclusions that are decided.
    """
    lines: list[str] = []
    for line in _resolved(_text(package, file).splitlines(), choices):
        included = INCLUDE.fullmatch(line)
        name = included[1] if included else ""
        if name in CHOSEN:
            continue
        if name.endswith(".c"):
            title, *rest = joined(name, choices, given, package).splitlines()
            lines += [title, *([""] if given.get(name) else []), *given.get(name, "").splitlines()]
            lines += rest
        else:
            lines += given[name].splitlines() if name in given else [line]
    text = re.sub(r"\n{3,}", "\n\n", "\n".join(lines))
    return re.sub(r"\{\n\n", "{\n", text).strip("\n") + "\n"


def _resolved(lines: list[str], choices: Mapping[str, bool]) -> list[str]:
    """Decide the conditions that are made of choices."""
    kept: list[str] = []
    # Of each condition that is open: whether it is one of ours, was taken, is taken now.
    opened: list[tuple[bool, bool, bool]] = []
    for line in lines:
        directive = DIRECTIVE.match(line)
        kind, condition = (directive[1], directive[2]) if directive else ("", "")
        ours = False
        if kind.startswith("if"):
            asked = _asked(condition, choices) if kind == "if" else None
            ours = asked is not None
            beginning = (ours, bool(asked), bool(asked))
        elif kind:
            ours, taken, now = opened.pop()
            if ours and kind != "endif":
                now = not taken and (kind == "else" or _asked(condition, choices) is True)
            beginning = (ours, taken or now, now)
        if not ours and all(now for own, _, now in opened if own):
            kept.append(line)
        if kind and kind != "endif":
            opened.append(beginning)
    return kept


def _asked(condition: str, choices: Mapping[str, bool]) -> bool | None:
    """Decide a condition; None where it is not made of choices."""
    words = set(re.findall(r"\w+", condition))
    if not words <= set(choices):
        return None
    return any(
        all(_one(word.strip(), choices) for word in part.split("&&"))
        for part in condition.split("||")
    )


def _one(word: str, choices: Mapping[str, bool]) -> bool:
    return not choices[word[1:]] if word.startswith("!") else choices[word]
