"""Lines of about one length."""

from __future__ import annotations

from textwrap import wrap

__all__ = ["folded"]


def folded(words: str, width: int) -> str:
    """Break lines that are too long, into parts of about one length."""
    return "\n".join(part for line in words.splitlines() for part in _evenly(line, width))


def _evenly(line: str, width: int) -> list[str]:
    def parts(most: int) -> list[str]:
        return wrap(line, most, break_long_words=False, break_on_hyphens=False)

    # The shortest lines of which there are as few; no single word on the last one.
    needed = len(parts(width))
    widths = range(min(20, width), width + 1)
    return next((parts(most) for most in widths if len(parts(most)) == needed), [line])
