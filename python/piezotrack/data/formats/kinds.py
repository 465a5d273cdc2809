"""Files that are no logs, known by their first bytes."""

from __future__ import annotations

__all__ = ["kind_of"]

# How they begin, what they are, and what is expected in their place.
KINDS = (
    (b"PK\x03\x04", "a zip archive", "the log in it, unpacked"),
    (b"ARROW1", "a feather file", "Parquet, as DataFrame.to_parquet writes it"),
    (b"FEA1", "a feather file", "Parquet, as DataFrame.to_parquet writes it"),
    (b"\x1f\x8b", "compressed by gzip", "it unpacked"),
    (b"BZh", "compressed by bzip2", "it unpacked"),
    (b"\xfd7zXZ", "compressed by xz", "it unpacked"),
    (b"7z\xbc\xaf", "a 7z archive", "the log in it, unpacked"),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet of an old format (.xls)", "it saved as .xlsx or CSV"),
    (b"SQLite format 3", "a database", "a table of it exported as CSV"),
    (b"%PDF", "a PDF", "a log"),
    (b"\x89PNG", "a picture", "a log"),
    (b"\xff\xd8\xff", "a picture", "a log"),
)
# Protocols 2 to 5, and the instruction that ends or begins each.
PICKLES = tuple(b"\x80" + bytes([protocol]) for protocol in range(2, 6))


def kind_of(head: bytes) -> str | None:
    """Say what a file is that is no log, and what is expected; None where it is not known.

    Examples
    --------
    >>> kind_of(b"PK...."), kind_of(b"ARROW1..")
    (None, 'is a feather file: expected Parquet, as DataFrame.to_parquet writes it')
    """
    if head.startswith(PICKLES):
        return (
            "is a pickle of Python, which can run any program when it is read: expected CSV, NPZ "
            "or Parquet"
        )
    if b"opendocument.spreadsheet" in head[:100]:
        return "is a spreadsheet (.ods): expected it saved as .xlsx or CSV"
    for begins, what, wanted in KINDS:
        if head.startswith(begins):
            return f"is {what}: expected {wanted}"
    return None
