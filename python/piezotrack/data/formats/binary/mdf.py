"""MDF4 and MDF3 of measuring and calibration systems, with asammdf."""

from __future__ import annotations

import io
from collections import Counter
from contextlib import contextmanager, redirect_stdout
from functools import partial
from typing import TYPE_CHECKING, Any

from ...._support.messages import quoted
from ..apart import read_apart
from ..table import Channel, ChannelTable, Format

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from ..source import Source

__all__ = ["FORMAT"]

# Kinds of conversions that are carried out, in MDF4 and MDF3: none, linear, rational, tables.
# asammdf hands formulas to `eval`, or reads them raw.
CONVERTED = {4: {0, 1, 2, 4, 5, 6, 7, 8}, 3: {65535, 0, 1, 2, 6, 9, 11, 12}}
# Flag of a group whose times are those of another group.
REMOTE_MASTER = 8


@read_apart("asammdf", "mdf")
def _opens(source: Source) -> ChannelTable:
    # Byte 60: what is left to be done, which asammdf would try and print its failure.
    if b"UnFinMF" in source.head[:8] or source.head[60:62].strip(b"\0"):
        raise source.error(
            "was not finished by the program that wrote it: expected a finished MDF file"
        )
    asammdf = source.library("asammdf", "mdf")
    with _opened(source, asammdf) as file:
        channels = list(_channels(source, asammdf, file))
    return ChannelTable(source, channels)


def _channels(source: Source, asammdf: Any, file: Any) -> Iterator[Channel]:
    """Find the channels of all groups; each group has its own times."""
    parts = [(k, part) for k, part in enumerate(file.groups) if part.channel_group.cycles_nr]
    names = [str(getattr(part.channel_group, "acq_name", "") or "").strip() for _, part in parts]
    shared = Counter(names)
    for (number, part), name in zip(parts, names, strict=True):
        group = name if name and shared[name] == 1 else f"group {number}"
        group = group if len(parts) > 1 else ""
        count = int(part.channel_group.cycles_nr)
        size = int(part.channel_group.samples_byte_nr)
        source.check_size(f"channel group {number}", count * max(size, 1))
        source.check_size(f"channel group {number}", 8 * count)
        # Opening a file is what takes long, so all channels of a group are read at once; channels
        # may share their bytes.
        at_once = 8 * count * len(part.channels) <= source.most
        for index, channel in enumerate(part.channels):
            _check_place(source, number, part.channel_group, channel)
            # A structure or an array is no column; the channels in a structure are their own.
            if not part.channel_dependencies[index]:
                fault = _fault(file, number, index)
                unit = file.get_channel_unit(group=number, index=index)
                wanted = None if at_once else index
                read = partial(_read, source, asammdf, number, wanted)
                one = partial(_part, source, read, number, index, fault)
                yield Channel(channel.name, count, one, group, unit or None)


def _fault(file: Any, group: int, index: int) -> str:
    """Say why a channel is not converted to its unit; return an empty text where it is."""
    part = file.groups[group]
    channel = part.channels[index]
    if file.masters_db.get(group) == index and _flags(part) & REMOTE_MASTER:
        return f"has the times {quoted(channel.name)} in a group that takes those of another one"
    conversion = channel.conversion
    if conversion is None and channel.conversion_addr:
        return f"has a damaged conversion of {quoted(channel.name)}"
    kinds = CONVERTED[4 if str(file.version) >= "4" else 3]
    # Tables may refer to further conversions, and those to themselves.
    waiting, known = [conversion], set[int]()
    while waiting:
        conversion = waiting.pop()
        if isinstance(conversion, bytes) or conversion is None or id(conversion) in known:
            continue
        known.add(id(conversion))
        waiting += (getattr(conversion, "referenced_blocks", None) or {}).values()
        if conversion.conversion_type not in kinds:
            formula = getattr(conversion, "formula", "")
            by = (
                f"the formula {quoted(formula)}"
                if formula
                else f"kind {conversion.conversion_type}"
            )
            return f"converts {quoted(channel.name)} by {by}"
    return ""


def _flags(part: Any) -> int:
    return int(getattr(part.channel_group, "flags", 0))


def _check_place(source: Source, number: int, group: Any, channel: Any) -> None:
    """Refuse a channel that is beyond its record: asammdf would read beyond its memory there."""
    if hasattr(channel, "byte_offset"):
        first = 8 * int(channel.byte_offset) + int(channel.bit_offset)
    else:
        first = int(channel.start_offset) + 8 * int(getattr(channel, "additional_byte_offset", 0))
    bits = 8 * int(group.samples_byte_nr)
    if first + int(channel.bit_count) > bits:
        raise source.error(
            f"a channel of group {number} is said to end at bit {first + int(channel.bit_count)}: "
            f"expected {bits} at most, as its records have"
        )


@contextmanager
def _opened(source: Source, asammdf: Any) -> Iterator[Any]:
    # asammdf prints what it stumbles over.
    quiet = redirect_stdout(io.StringIO())
    with source.decoding("MDF", "asammdf"), quiet, source.opened() as content:
        try:
            # Frames of buses would be converted while the file is opened.
            file = asammdf.MDF(content, process_bus_logging=False)
        except Exception as error:
            _close_halves(error)
            raise
        with file:
            yield file


def _close_halves(error: BaseException) -> None:
    """Close what failed to open: asammdf's own `close` would fail on it, in `__del__`."""
    trace = error.__traceback__
    while trace is not None:
        half: Any = trace.tb_frame.f_locals.get("self")
        if hasattr(half, "_closed"):
            half._closed = True
            for name in ("_tempfile", "_mapped_file"):
                if (opened := getattr(half, name, None)) is not None:
                    opened.close()
        trace = trace.tb_next
    if error.__context__ is not None:
        _close_halves(error.__context__)


def _read(source: Source, asammdf: Any, group: int, wanted: int | None) -> dict[int, Any]:
    """Read a channel of a group, or all of them."""
    with _opened(source, asammdf) as file:
        sound = _disarm(file)
        master = file.masters_db.get(group)
        samples_of = {}
        for index in sound[group] if wanted is None else [wanted]:
            # Copied, as the file is closed.
            if index == master:
                samples_of[index] = file.get(group=group, index=index).timestamps.copy()
            else:
                samples, _ = file.get(group=group, index=index, samples_only=True)
                samples_of[index] = samples.copy()
        return samples_of


def _disarm(file: Any) -> list[list[int]]:
    """Take away what is not carried out from all channels of a file, and return the others.

    asammdf converts times, and those of other groups, with whatever channel is read.
    """
    sound: list[list[int]] = []
    for number, part in enumerate(file.groups):
        sound.append([])
        for index, channel in enumerate(part.channels):
            if hasattr(channel, "attachment"):
                # It may be any file of the machine.
                channel.attachment = None
            if _fault(file, number, index):
                channel.conversion = None
            elif not part.channel_dependencies[index]:
                sound[-1].append(index)
    return sound


def _part(
    source: Source, read: Callable[[], dict[int, Any]], group: int, index: int, fault: str
) -> Any:
    if fault:
        raise source.error(
            f"{fault}: expected a linear or rational conversion, or a table, as others are not "
            "carried out"
        )
    # Of a group that is not read at once there is only this one.
    found = source.latest(f"group {group}", read)
    return (found if index in found else read())[index]


FORMAT = Format(
    name="MDF",
    endings=(".mf4", ".mdf"),
    opens=_opens,
    begins=lambda head: head.startswith((b"MDF     ", b"UnFinMF ")),
)
