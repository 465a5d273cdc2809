"""Section of the report with what repeats a fit: hashes, versions, command and call."""

from __future__ import annotations

import platform
from dataclasses import fields
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np

from .... import _core
from ...._support.display.table import words
from ...._support.files.writing import document_text
from ...._support.page.parts import Listing, Section
from ....data import datasets
from ...methods.least_squares import LeastSquares

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...._support.page.parts import Part
    from ....data.dataset import Dataset
    from ...fitted.identification import Identification

__all__ = ["again_section", "python_call"]


def again_section(fit: Identification, command: str | None = None) -> Section:
    """Write hashes, versions, and the command and the call that repeat a fit.

    Parameters
    ----------
    fit : Identification
        The fit.
    command : str, optional
        The command, where there was one.

    Returns
    -------
    Section
        Table and listings.
    """
    data = [one.data for one in fit.records if one.data is not None]
    several = len(data) > 1
    rows = [
        (f"record {i + 1}, sha256" if several else "record, sha256", one.sha256)
        for i, one in enumerate(data)
    ]
    rows += [
        ("model file, sha256", sha256(document_text(fit.document()).encode()).hexdigest()),
        ("piezotrack", _core.__version__),
        ("Python", platform.python_version()),
        ("NumPy", np.__version__),
    ]
    parts: list[Part] = [words("", rows)]
    if command is not None:
        parts.append(Listing(command))
    return Section("To repeat it", (*parts, Listing(python_call(fit))))


def python_call(fit: Identification) -> str:
    """Write the call that repeats a fit.

    Parameters
    ----------
    fit : Identification
        The fit.

    Returns
    -------
    str
        Lines of Python. A record from a file is read with the default columns, so that its hash has
        to be compared; one from an array has no line that makes it.
    """
    given = dict((fit.details.get("provenance") or {}).get("arguments", {}))
    data = [one.data for one in fit.records if one.data is not None]
    each = given.pop("records", None)
    names = ["log"] if len(data) == 1 else [f"log_{i + 1}" for i in range(len(data))]
    lines = [f"{name} = {_read(one)}" for name, one in zip(names, data, strict=True)]
    shown = names
    if each is not None:
        shown = [
            f"pt.Record({', '.join([name, *_keywords(of_record)])})"
            for name, of_record in zip(names, each, strict=True)
        ]
    first = shown[0] if len(shown) == 1 else f"[{', '.join(shown)}]"
    arguments = [first]
    if fit.selection is None:
        arguments.append(f'"{fit.model.info.name}"')
    arguments += _keywords(given)
    if method := _method(fit):
        arguments.append(f"method={method}")
    call = f"fit = pt.identify({', '.join(arguments)})"
    if len(call) > 88:
        call = "fit = pt.identify(\n" + "".join(f"    {one},\n" for one in arguments) + ")"
    return "\n".join(["import piezotrack as pt", "", *lines, call])


def _read(data: Dataset) -> str:
    """Write how a record is read, and its window."""
    source = data.source
    window = f"[{float(data.t[0]):.9g}:{float(data.t[-1]) + data.dt:.9g}]"
    if source in datasets.__all__:
        return f"pt.datasets.{source}(){window}"
    return f"{f'pt.read({source!r})' if source else '...'}{window}"


def _keywords(given: Mapping[str, Any]) -> list[str]:
    """Write arguments by their names."""
    written = []
    for name, value in given.items():
        if name == "parameters":
            entries = (f"{key!r}: {_parameter(entry)}" for key, entry in value.items())
            written.append(f"parameters={{{', '.join(entries)}}}")
        else:
            written.append(f"{name}={_plain(value)}")
    return written


def _parameter(entry: Mapping[str, Any]) -> str:
    """Write a parameter as shortly as `identify` takes it."""
    if list(entry) in (["value"], ["bounds"], ["tie"]):
        return _plain(*entry.values())
    return f"pt.Parameter({', '.join(f'{key}={_plain(value)}' for key, value in entry.items())})"


def _plain(value: Any) -> str:
    """Write numbers, texts and sequences; pairs are tuples."""
    if isinstance(value, (list, tuple)) and value and not isinstance(value[0], str):
        return repr(tuple(value))
    return repr(value)


def _method(fit: Identification) -> str:
    """Write the method by those settings that are not the default, and its seed."""
    method = fit.method
    usual = type(method)()
    given = [
        f"{one.name}={getattr(method, one.name)!r}"
        for one in fields(method)
        if one.name == "seed" or getattr(method, one.name) != getattr(usual, one.name)
    ]
    if isinstance(method, LeastSquares) and not given:
        return ""
    return f"pt.{type(method).__name__}({', '.join(given)})"
