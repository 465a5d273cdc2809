"""HDF5 with h5py: datasets with units as attributes, and the arrays of MAT v7.3."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..apart import read_apart
from ..table import Channel, ChannelTable, Format, names_interval, split_matrix, stated_interval

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from ..source import Source

__all__ = ["FORMAT", "open_matlab"]

# Attributes that state a unit.
UNIT_NAMES = ("units", "unit", "Units", "Unit", "UNITS", "unit_string")
# Most objects that are looked at.
MOST_OBJECTS = 100_000
# Bytes of an attribute that is a number or a text of fixed length, at most.
LONGEST = 10_000
EXTRA = "hdf5"


@read_apart("h5py", EXTRA)
def _opens(source: Source) -> ChannelTable:
    h5py = source.library("h5py", EXTRA)
    with source.decoding("HDF5"), h5py.File(source.path, "r") as file:
        channels: list[Channel] = []
        for path, dataset in _datasets(h5py, file):
            group, _, name = path.rpartition("/")
            unit = _unit(h5py, dataset.attrs)
            channels += _of_dataset(source, h5py, dataset, group, name, unit)
            channels += _constants(h5py, dataset.attrs, group)
        channels += _constants(h5py, file.attrs, "")
    notes = [f"{source.name} is HDF5 without MATLAB's header: it is read as HDF5"]
    return ChannelTable(source, channels, notes=notes if source.ending == ".mat" else [])


@read_apart("h5py", "mat")
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
    with source.decoding("MAT v7.3"), h5py.File(source.path, "r") as file:
        channels: list[Channel] = []
        numbers = {}
        texts: dict[str, str] = {}
        for path, dataset in _datasets(h5py, file):
            kind = _text(_attribute(h5py, dataset.attrs, "MATLAB_class"))
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
    kind = dataset.id.get_type()
    if dataset.shape is None or dataset.is_virtual or dataset.external or not _is_sound(h5py, kind):
        return
    _check(source, dataset)
    names = dataset.dtype.names
    if names is not None:
        group = f"{group}/{name}" if group else name
        inner = {part: dataset.dtype[part] for part in names}
        columns = [one for one in names if inner[one].kind in "biuf" and not inner[one].shape]
        read = _reader(source, h5py, dataset.name, columns)
        for part in columns if len(dataset.shape) == 1 else ():
            yield Channel(part, dataset.shape[0], partial(_part, source, read, part), group)
    elif dataset.dtype.kind in "biuf":
        read = _reader(source, h5py, dataset.name)
        dt = _interval(h5py, dataset.attrs, group)
        for column, place, count in split_matrix(name, dataset.shape):
            yield Channel(column, count, partial(_part, source, read, place), group, unit, dt)


def _is_sound(h5py: Any, kind: Any, *, alone: bool = True) -> bool:
    """Whether a type is made of numbers and texts: libhdf5 ends the process on a damaged one.

    A text of variable length may be part of a row, and is not read then.
    """
    h5t = h5py.h5t
    what = kind.get_class()
    if what == h5t.COMPOUND:
        parts = range(kind.get_nmembers())
        return all(_is_sound(h5py, kind.get_member_type(k), alone=False) for k in parts)
    if what in (h5t.ENUM, h5t.ARRAY):
        return _is_sound(h5py, kind.get_super(), alone=False)
    if what == h5t.STRING:
        return not (alone and kind.is_variable_str())
    return what in (h5t.INTEGER, h5t.FLOAT, h5t.BITFIELD, h5t.OPAQUE)


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


def _reader(
    source: Source, h5py: Any, path: str, parts: Sequence[str] | None = None
) -> Callable[[], Any]:
    def read() -> Any:
        with source.decoding("HDF5"), h5py.File(source.path, "r") as file:
            dataset = file[path]
            return np.asarray(dataset[()] if parts is None else dataset.fields(parts)[()])

    # Once for all columns of a dataset.
    return partial(source.latest, path, read)


def _part(source: Source, read: Callable[[], Any], place: Any) -> Any:
    # The rows may lack a part that their damaged type has.
    with source.decoding("HDF5"):
        return read()[place]


def _unit(h5py: Any, attributes: Any) -> str | None:
    for name in UNIT_NAMES:
        if name in attributes:
            return _text(_attribute(h5py, attributes, name))
    return None


def _attribute(h5py: Any, attributes: Any, name: str) -> Any:
    """Read an attribute that is one number or text; an empty text where it is none."""
    if name not in attributes:
        return ""
    attribute = attributes.get_id(name)
    kind, h5t = attribute.get_type(), h5py.h5t
    kinds = (h5t.INTEGER, h5t.FLOAT, h5t.STRING)
    if kind.get_class() not in kinds or kind.get_size() > LONGEST:
        return ""
    return attributes[name] if attribute.get_space().get_simple_extent_npoints() == 1 else ""


def _text(value: Any) -> str:
    """Return a text attribute, which is bytes, text or an array of one of them."""
    array = np.asarray(value)
    if array.size != 1:
        return ""
    one = array.reshape(-1)[0]
    return one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one)


def _constants(h5py: Any, attributes: Any, group: str) -> Iterator[Channel]:
    """Take attributes that may be the sampling interval, as ``sample_rate_Hz``, as constants."""
    for name in attributes:
        if names_interval(name):
            value = _attribute(h5py, attributes, name)
            yield Channel(name, 1, partial(np.asarray, value), group)


def _interval(h5py: Any, attributes: Any, group: str) -> float | None:
    return stated_interval(_constants(h5py, attributes, group))


FORMAT = Format(
    name="HDF5",
    endings=(".h5", ".hdf5", ".hdf", ".he5", ".nc"),
    opens=_opens,
    begins=lambda head: head.startswith(b"\x89HDF\r\n\x1a\n"),
)
