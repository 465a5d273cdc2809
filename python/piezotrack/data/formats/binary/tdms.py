"""TDMS of LabVIEW and DAQmx, with npTDMS: unit from ``unit_string``, rate from ``wf_increment``."""

from __future__ import annotations

from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, BinaryIO

from ...._support.messages import listed
from ..table import Channel, ChannelTable, Format

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..source import Source

__all__ = ["FORMAT"]


def _opens(source: Source) -> ChannelTable:
    nptdms = source.library("nptdms", "tdms")
    with _opened(source) as content:
        try:
            file = nptdms.TdmsFile.read_metadata(content)
        except MemoryError:
            raise source.error(
                "is not a sound TDMS file: expected metadata that fit into memory"
            ) from None
        status = file.file_status
        channels = [
            _channel(source, nptdms, channel)
            for group in file.groups()
            for channel in group.channels()
            if channel.dtype is not None and channel.dtype.kind in "biufM"
        ]
    if status.incomplete_final_segment:
        raise source.error(
            "is cut off in its last segment, as when the program that wrote it was ended: expected "
            "a whole file, as LabVIEW's TDMS Defragment makes it"
        )
    _check_counts(source, file)
    return ChannelTable(source, channels)


@contextmanager
def _opened(source: Source) -> Iterator[BinaryIO]:
    # Not by its name: an index beside it may be that of another file.
    with source.decoding("TDMS", "nptdms"), source.opened() as content:
        yield content


def _check_counts(source: Source, file: Any) -> None:
    """Refuse more samples than there are, for which npTDMS would take those of other channels."""
    for segment in getattr(getattr(file, "_reader", None), "_segments", None) or ():
        if segment.num_chunks == 1 and getattr(segment, "final_chunk_lengths_override", None):
            counts = [one.number_values for one in segment.ordered_objects if one.has_data]
            stored = segment.next_segment_pos - segment.data_position
            raise source.error(
                f"channels of a segment are said to have {listed(counts)} samples: expected "
                f"{stored} bytes of samples, as it holds"
            )


def _channel(source: Source, nptdms: Any, channel: Any) -> Channel:
    path = f"{channel.group_name}/{channel.name}"
    # Raw values have a byte at least, and are not compressed.
    size = getattr(channel.data_type, "size", None) or 1
    source.check_size(f"channel {path!r}", len(channel) * size, stored=source.size)
    unit, increment = channel.properties.get("unit_string"), channel.properties.get("wf_increment")
    return Channel(
        name=channel.name,
        count=len(channel),
        read=partial(_read, source, nptdms, channel.group_name, channel.name),
        group=channel.group_name,
        unit=unit if isinstance(unit, str) and unit.strip() else None,
        dt=float(increment) if isinstance(increment, (int, float)) and increment > 0.0 else None,
    )


def _read(source: Source, nptdms: Any, group: str, name: str) -> Any:
    with _opened(source) as content, nptdms.TdmsFile.open(content) as file:
        return file[group][name][:]


FORMAT = Format(
    name="TDMS",
    endings=(".tdms",),
    opens=_opens,
    begins=lambda head: head.startswith(b"TDSm"),
)
