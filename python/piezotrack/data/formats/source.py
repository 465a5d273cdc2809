"""A file to read: its name, size and first bytes, and errors that name it."""

from __future__ import annotations

import importlib
import io
import logging
import os
import warnings
from contextlib import contextmanager
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from ..._support.messages import quoted
from ...errors import DataError, ParameterError, PiezotrackError, ShapeError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["Source"]

# First bytes that are looked at.
HEAD = 1 << 16
# Bytes from which samples have to be backed by the file, and how often they may be more than it:
# noise compresses by a factor of two to ten.
BACKED, DENSEST = 100_000_000, 200
# How often a file may be read besides once for each of its bytes.
MOST_CALLS = 10_000


class _BoundedReader(io.BufferedReader):
    """A file that does not ask for memory for more than is left of it, nor is read without end."""

    calls = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """Read so many bytes, or those that are left."""
        length = os.fstat(self.fileno()).st_size
        self.calls += 1
        # A part has several bytes, and is read a few times; each may say where the next one is.
        if self.calls > MOST_CALLS + length:
            raise ValueError("its parts refer to each other in a circle")
        if size is None or size < 0:
            return super().read(size)
        return super().read(min(size, max(length - self.tell(), 0)))


class Source:
    """A file that is there and may be read.

    Parameters
    ----------
    path : path-like
        Its name.
    skip : int, optional
        Lines or rows at its beginning that are left out.

    Attributes
    ----------
    path : pathlib.Path
        The file.
    name : str
        Its name without the folder.
    size : int
        Its length [bytes].
    head : bytes
        Its first bytes.
    skip : int
        Lines or rows at its beginning that are left out.

    Raises
    ------
    ParameterError
        `path` is no name of a file.
    DataError
        There is no such file, it is a directory, or it cannot be read.
    """

    def __init__(self, path: str | os.PathLike[str], skip: int = 0) -> None:
        self.skip = _lines(skip)
        try:
            self.path = Path(path)
        except TypeError:
            raise ParameterError("path", quoted(path), "the name of a file") from None
        self.name = self.path.name or str(self.path)
        with self._opening():
            if self.path.is_dir():
                raise self.error("is a directory: expected a log")
            with self.path.open("rb") as opened:
                self.head = opened.read(HEAD)
            self.size = self.path.stat().st_size

    @property
    def ending(self) -> str:
        """Ending of the name, in small letters and with its dot."""
        return self.path.suffix.lower()

    def content(self) -> bytes:
        """Return all bytes."""
        with self._opening(), self.path.open("rb") as opened:
            return opened.read()

    def opened(self) -> BinaryIO:
        """Open the file for a library that may ask for any number of bytes of it."""
        return _BoundedReader(io.FileIO(self.path))

    def error(self, sentence: str, line: int | None = None) -> DataError:
        """Make an error about the content of the file."""
        return DataError(f"{self.name}:{line}: {sentence}" if line else f"{self.name}: {sentence}")

    @contextmanager
    def named(self, line: int | None = None) -> Iterator[None]:
        """Put the name of the file, and the line of a fault, before a message."""
        try:
            yield
        except DataError as error:
            raise self.error(str(error), line) from None
        except (ParameterError, ShapeError) as error:
            raise error.of(self.name) from None

    @contextmanager
    def decoding(self, kind: str, logger: str | None = None) -> Iterator[None]:
        """Turn whatever a library raises on a damaged file of a kind into a sentence.

        What it warns of, or writes to its `logger`, is not shown: a file is read, or it is not.
        """
        talking = _loggers(logger)
        for each in talking:
            each.disabled = True
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                yield
        except (PiezotrackError, MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
            raise
        # Parsers raise whatever they stumble over: IndexError, zlib.error, struct.error, and
        # afmformats a BaseException of its own.
        except BaseException as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            reason = reason.replace(str(self.path), self.name)
            raise self.error(
                f"is not a sound {kind} file, or is cut off ({quoted(reason)})"
            ) from None
        finally:
            for each in talking:
                each.disabled = False

    def library(self, module: str, extra: str) -> Any:
        """Import the library that reads a format.

        Parameters
        ----------
        module : str
            Its name in Python.
        extra : str
            The extra of piezotrack that installs it.

        Returns
        -------
        module
            The library.

        Raises
        ------
        DataError
            It is not installed.
        """
        try:
            return importlib.import_module(module)
        except ImportError:
            raise self.error(
                f"is read with {module.partition('.')[0]}, which is not installed: expected "
                f"pip install 'piezotrack[{extra}]'"
            ) from None

    def check_size(self, what: str, declared: int, *, stored: int | None = None) -> None:
        """Refuse samples that the file cannot hold, before memory is asked for.

        Parameters
        ----------
        what : str
            What holds them, for the message.
        declared : int
            Their size as the file says [bytes].
        stored : int, optional
            Bytes of the file that they take, where they are not compressed.

        Raises
        ------
        DataError
            The file is too small for them.
        """
        if stored is not None and declared > stored:
            raise self.error(
                f"{what} declares {declared} bytes: expected {stored} at most, in a file "
                f"of {self.size} bytes"
            )
        if declared > self.most:
            raise self.error(
                f"{what} declares {declared} bytes: expected {DENSEST * self.size} at most, "
                f"as measured samples in a file of {self.size} bytes"
            )

    @property
    def most(self) -> int:
        """Bytes of measured samples that the file can hold, compressed."""
        return max(BACKED, DENSEST * self.size)

    def latest(self, part: str, read: Callable[[], Any]) -> Any:
        """Return what was read last, where that is the same part of the file, or read it.

        Parameters
        ----------
        part : str
            What is read: the columns of an array are asked for one after the other.
        read : callable
            Reads it.

        Returns
        -------
        object
            What `read` gives. Only one part is kept, as a file may have any number of them.
        """
        if self._latest is None or self._latest[0] != part:
            self._latest = None
            self._latest = part, read()
        return self._latest[1]

    _latest: tuple[str, Any] | None = None

    @contextmanager
    def _opening(self) -> Iterator[None]:
        try:
            yield
        except FileNotFoundError:
            raise self.error(f"there is no such file in {quoted(str(self.path.parent))}") from None
        except PermissionError:
            raise self.error("no permission to read this file") from None
        except (OSError, ValueError) as error:
            if isinstance(error, PiezotrackError):
                raise
            raise self.error(f"cannot be read: {error}") from None


def _lines(skip: object) -> int:
    if isinstance(skip, bool) or not isinstance(skip, Integral) or int(skip) < 0:
        raise ParameterError("skip", quoted(skip), "a number of lines, 0 or more")
    return int(skip)


def _loggers(name: str | None) -> list[logging.Logger]:
    """Return the loggers of a library that are not disabled already."""
    if name is None:
        return []
    known = logging.Logger.manager.loggerDict.items()
    return [
        logger
        for key, logger in known
        if isinstance(logger, logging.Logger)
        and (key == name or key.startswith(f"{name}."))
        and not logger.disabled
    ]
