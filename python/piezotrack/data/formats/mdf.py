"""MDF4 and MDF3 of measuring and calibration systems, with asammdf."""

from __future__ import annotations

from collections import Counter
from contextlib import contextmanager
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from .table import Channel, ChannelTable, Format

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .source import Source

__all__ = ["FORMAT"]


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
        read = _reader(source, asammdf, number, len(part.channels), file.masters_db.get(number))
        for index, channel in enumerate(part.channels):
            _check_place(source, number, part.channel_group, channel)
            unit = file.get_channel_unit(group=number, index=index)
            yield Channel(channel.name, count, partial(_part, read, index), group, unit or None)


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
    with source.decoding("MDF", "asammdf"), source.path.open("rb") as content:
        try:
            file = asammdf.MDF(content)
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


def _reader(
    source: Source, asammdf: Any, group: int, count: int, master: int | None
) -> Callable[[], list[Any]]:
    # Once for all channels of a group: opening a file is what takes long.
    @cache
    def read() -> list[Any]:
        with _opened(source, asammdf) as file:
            signals = [file.get(group=group, index=index) for index in range(count)]
            # Copied, as the file is closed.
            return [
                (one.timestamps if index == master else one.samples).copy()
                for index, one in enumerate(signals)
            ]

    return read


def _part(read: Callable[[], list[Any]], index: int) -> Any:
    return read()[index]


FORMAT = Format(
    name="MDF",
    endings=(".mf4", ".mdf"),
    opens=_opens,
    begins=lambda head: head.startswith((b"MDF     ", b"UnFinMF ")),
)
