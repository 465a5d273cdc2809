"""A record of the benchmark: the part that is fitted, and what the fit is judged on."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .._support.arguments import expect, positive
from .._support.messages import quoted
from ..data.dataset import Dataset
from ..errors import ParameterError
from ..identification.comparison.parts import parts_of
from ..identification.problem.fingerprint import hash_of, record_hash

__all__ = ["BenchmarkRecord", "checked_name"]

NAME = re.compile(r"[a-z0-9][a-z0-9._-]*")


def checked_name(argument: str, name: object) -> str:
    """Return a name that can be that of a file.

    Parameters
    ----------
    argument : str
        For the message.
    name : object
        The name.

    Returns
    -------
    str
        The name.

    Raises
    ------
    ParameterError
        It has other characters than small letters, digits, dots and hyphens.
    """
    if not isinstance(name, str) or not NAME.fullmatch(name) or len(name) > 80:
        raise ParameterError(
            argument, quoted(name), "up to 80 small letters, digits, dots and hyphens"
        )
    return name


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchmarkRecord:
    """A record of the benchmark.

    Parameters
    ----------
    name : str
        In files and on the command line: small letters, digits, dots and hyphens.
    fitted : Dataset
        The part that is fitted. Its warm-up is simulated, not scored.
    rest : Dataset, optional
        Another part of the same record; the state and the offset are carried over to it.
    others : mapping of str to Dataset, optional
        Other records of the same stage, by what they are.
    title : str, optional
        In tables; the name where not given.
    noise : float, optional
        Rms of the noise in the displacement [m] where it is known.
    own_offsets : bool, optional
        Whether each of the other records has an offset of its own.
    truth : mapping of str to float, optional
        Parameters of the stage that made the record, SI; a model that has all of them is compared.

    Raises
    ------
    ParameterError
        A name has other characters, a part is no Dataset, or the units of the drives differ.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> u = 5.0 * np.sin(np.arange(5000) / 500.0)
    >>> log = pt.Dataset(u=u, y=4e-6 * u, dt=0.005)
    >>> record = pt.BenchmarkRecord(name="my-stage", fitted=log[3.0:13.0], rest=log[13.0:])
    >>> [part for part, _ in record.parts()]
    ['fitted', 'rest']
    """

    name: str
    fitted: Dataset
    rest: Dataset | None = None
    others: Mapping[str, Dataset] = field(default_factory=dict)
    title: str = ""
    noise: float | None = None
    own_offsets: bool = True
    truth: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        checked_name("name", self.name)
        expect("others", self.others, Mapping, "records by what they are, as {'slow': log}")
        for part, data in self.parts():
            expect(part, data, Dataset, "a Dataset")
            if data.drive_unit != self.fitted.drive_unit:
                raise ParameterError(
                    part,
                    f"a drive in {data.drive_unit}",
                    f"{self.fitted.drive_unit}, as that of the part fitted",
                    verb="has",
                )
        if self.noise is not None:
            positive("noise", self.noise, "m")
        if not self.title:
            object.__setattr__(self, "title", self.name)

    @classmethod
    def of_log(
        cls,
        log: Dataset,
        *,
        name: str | None = None,
        train: tuple[float | None, float | None] | None = None,
        test: tuple[float | None, float | None] | None = None,
        other: Dataset | None = None,
    ) -> BenchmarkRecord:
        """Make a record of a log, with the parts that `compare` would take.

        Parameters
        ----------
        log : Dataset
            The log.
        name : str, optional
            Name of the record; that of the log's file where not given.
        train : (float, float), optional
            Window to fit [s]; by default the first half, or all of it beside another log.
        test : (float, float), optional
            Window of the same log to judge on [s]; by default what follows.
        other : Dataset, optional
            Another log of the same stage to judge on.

        Returns
        -------
        BenchmarkRecord
            The record.

        Raises
        ------
        ParameterError
            A window is out of the log, or both overlap.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> u = 5.0 * np.sin(np.arange(5000) / 500.0)
        >>> log = pt.Dataset(u=u, y=4e-6 * u, dt=0.005)
        >>> record = pt.BenchmarkRecord.of_log(log, name="my-stage", train=(3.0, 13.0))
        >>> record.fitted.duration, record.rest.duration
        (10.0, 12.0)
        """
        expect("log", log, Dataset, "a Dataset")
        title = log.source or "log"
        plain = re.sub(r"[^a-z0-9._]+", "-", title.rpartition("/")[2].lower()).strip("-._")
        rest: Dataset | None = None
        if other is not None and test is None:
            open_end = train is None or train[1] is None
            fitted, _, _ = parts_of(log, train, other)
            rest = None if open_end else parts_of(log, train, None)[1]
        else:
            fitted, rest, _ = parts_of(log, train, test)
        return cls(
            name=plain or "log" if name is None else name,
            title=title if name is None else name,
            fitted=fitted,
            rest=rest,
            others={} if other is None else {"other log": other},
        )

    def parts(self) -> list[tuple[str, Dataset]]:
        """Every part, the fitted one first.

        Returns
        -------
        list of (str, Dataset)
            What it is, and its samples.
        """
        rest = [] if self.rest is None else [("rest", self.rest)]
        return [("fitted", self.fitted), *rest, *self.others.items()]

    @property
    def drive_unit(self) -> str:
        """Unit of the drive."""
        return self.fitted.drive_unit

    @property
    def key(self) -> str:
        """Hash of all parts: another one where a sample or a window is another."""
        parts: list[Any] = [[part, record_hash(data)] for part, data in self.parts()]
        return hash_of([parts, self.own_offsets])

    def document(self) -> dict[str, Any]:
        """Content of a result's file about the record.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "name": self.name,
            "title": self.title,
            "key": self.key,
            "samples": len(self.fitted),
            "window_s": [float(self.fitted.t[0]), float(self.fitted.t[-1])],
            "stroke_m": self.fitted.stroke,
            "drive_unit": self.drive_unit,
            "noise_m": math.nan if self.noise is None else self.noise,
        }
