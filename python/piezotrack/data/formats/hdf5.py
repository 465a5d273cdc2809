"""HDF5 with h5py: datasets with units as attributes, and the arrays of MAT v7.3."""

from __future__ import annotations

import math
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .hdf5_heaps import check_heaps
from .table import Channel, ChannelTable, Format, split_matrix, stated_interval

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from .source import Source

__all__ = ["FORMAT", "open_matlab"]

# Attributes that state a unit.
UNIT_NAMES = ("units", "unit", "Units", "Unit", "UNITS", "unit_string")
# Most objects that are looked at.
MOST_OBJECTS = 100_000
EXTRA = "hdf5"


def _opens(source: Source) -> ChannelTable:
    h5py = source.library("h5py", EXTRA)
    check_heaps(source)
    with source.decoding("HDF5"), h5py.File(source.path, "r") as file:
        channels: list[Channel] = []
        for path, dataset in _datasets(h5py, file):
            group, _, name = path.rpartition("/")
            unit = _unit(dataset.attrs)
            channels += _of_dataset(source, h5py, dataset, group, name, unit)
            channels += _constants(dataset.attrs, group)
        channels += _constants(file.attrs, "")
    return ChannelTable(source, channels)


def open_matlab(source: Source) -> ChannelTable:
    """Open a MAT file of version 7.3.

    Parameters
    ----------
    source : Source
        The file.

    Returns
    -------
    ChannelTable
        Its numbers; structures are groups, and units are those of a structure ``units`` beside
        the variables.
    """
    h5py = source.library("h5py", "mat")
    check_heaps(source)
    with source.decoding("MAT v7.3"), h5py.File(source.path, "r") as file:
        channels: list[Channel] = []
        numbers = {}
        texts: dict[str, str] = {}
        for path, dataset in _datasets(h5py, file):
            kind = _text(dataset.attrs.get("MATLAB_class", ""))
            if path.startswith("#") or "MATLAB_empty" in dataset.attrs:
                continue
            if kind == "char" and dataset.size <= 1000 and dataset.dtype.kind in "ui":
                letters = np.asarray(dataset[()]).ravel(order="F").tolist()
                texts[path] = "".join(map(chr, letters))
            elif kind not in ("char", "cell"):
                numbers[path] = dataset
        for path, dataset in numbers.items():
            group, _, name = path.rpartition("/")
            beside = f"{group}/" if group else ""
            unit = texts.get(f"{beside}units/{name}", texts.get(f"{beside}unit/{name}"))
            channels += _of_dataset(source, h5py, dataset, group, name, unit)
    return ChannelTable(source, channels)


def _datasets(h5py: Any, file: Any) -> Iterator[tuple[str, Any]]:
    """Find the datasets of a file; links to other files are not followed."""
    paths: list[str] = []

    def visit(path: str, thing: Any) -> bool | None:
        if isinstance(thing, h5py.Dataset):
            paths.append(path)
        return True if len(paths) > MOST_OBJECTS else None

    file.visititems(visit)
    return ((path, file[path]) for path in paths)


def _of_dataset(
    source: Source, h5py: Any, dataset: Any, group: str, name: str, unit: str | None
) -> Iterator[Channel]:
    """Divide a dataset into channels; texts, references and samples in other files are none."""
    if dataset.shape is None or dataset.is_virtual or dataset.external:
        return
    _check(source, dataset)
    read = _reader(source, h5py, dataset.name)
    names = dataset.dtype.names
    if names is not None:
        group = f"{group}/{name}" if group else name
        for part in names:
            inner = dataset.dtype[part]
            if inner.kind in "biuf" and not inner.shape and len(dataset.shape) == 1:
                yield Channel(part, dataset.shape[0], partial(_part, read, part), group)
    elif dataset.dtype.kind in "biuf":
        dt = _interval(dataset.attrs, group)
        for column, place, count in split_matrix(name, dataset.shape):
            yield Channel(column, count, partial(_part, read, place), group, unit, dt)


def _check(source: Source, dataset: Any) -> None:
    """Refuse a dataset whose samples are not in the file."""
    declared = math.prod(dataset.shape) * dataset.dtype.itemsize
    stored = dataset.id.get_storage_size()
    what = f"dataset {dataset.name!r}"
    if stored == 0 and declared:
        # Never written: the library would make up its samples.
        source.check_size(what, declared, stored=0)
    source.check_size(what, stored, stored=source.size)
    if dataset.chunks is None:
        source.check_size(what, declared, stored=source.size)
    source.check_size(what, declared)
    if dataset.chunks is not None:
        source.check_size(what, math.prod(dataset.chunks) * dataset.dtype.itemsize)


def _reader(source: Source, h5py: Any, path: str) -> Callable[[], Any]:
    # Once for all columns of a dataset.
    @cache
    def read() -> Any:
        with source.decoding("HDF5"), h5py.File(source.path, "r") as file:
            return np.asarray(file[path][()])

    return read


def _part(read: Callable[[], Any], place: Any) -> Any:
    return read()[place]


def _unit(attributes: Mapping[str, Any]) -> str | None:
    for name in UNIT_NAMES:
        if name in attributes:
            return _text(attributes[name])
    return None


def _text(value: Any) -> str:
    """Return a text attribute, which is bytes, text or an array of one of them."""
    array = np.asarray(value)
    if array.size != 1:
        return ""
    one = array.reshape(-1)[0]
    return one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one)


def _constants(attributes: Mapping[str, Any], group: str) -> Iterator[Channel]:
    """Take numbers among the attributes as constants, as ``sample_rate_Hz``."""
    for name in attributes:
        value = attributes[name]
        if np.asarray(value).dtype.kind in "iuf" and np.asarray(value).size == 1:
            yield Channel(name, 1, partial(np.asarray, value), group)


def _interval(attributes: Mapping[str, Any], group: str) -> float | None:
    return stated_interval(_constants(attributes, group))


FORMAT = Format(
    name="HDF5",
    endings=(".h5", ".hdf5", ".hdf", ".he5", ".nc"),
    opens=_opens,
    begins=lambda head: head.startswith(b"\x89HDF\r\n\x1a\n"),
)
