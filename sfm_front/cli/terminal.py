"""What a terminal shows: colours where they are wanted, and names that do no harm to it."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, TextIO

from sfm_front.reports.words import one_line

if TYPE_CHECKING:  # It is read before anything heavy may be loaded.
    from sfm_front.reports.lights import Level

ERASE = "\r\x1b[K"
"""Takes back what stands in the line."""

# What moves the cursor, changes colours or the title, or turns the direction of writing. A photo
# may be called anything.
_HARMFUL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
_COLORS = {"good": "32", "fair": "33", "bad": "31"}


def is_terminal(stream: TextIO) -> bool:
    """Whether a line can be taken back there."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def printable(text: str) -> str:
    """Text whose control characters, but for ends of lines and tabs, are spelled out."""
    return _HARMFUL.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


def printable_line(text: str) -> str:
    """The same on one line, ends of lines spelled out, too."""
    return printable(one_line(text))


def painted(text: str, level: Level, stream: TextIO) -> str:
    """In the colour of a verdict, unless NO_COLOR is set or nobody would see it.

    https://no-color.org
    """
    color = _COLORS.get(level.value)
    if color is None or os.environ.get("NO_COLOR") or not is_terminal(stream):
        return text
    return f"\x1b[1;{color}m{text}\x1b[0m"
