"""Numbers and times as people read them."""

from __future__ import annotations

import re
from datetime import datetime, timezone

_MONTHS = (
    *("January", "February", "March", "April", "May", "June"),
    *("July", "August", "September", "October", "November", "December"),
)


_ENDS_OF_LINES = re.compile("[\n\r\x0b\x0c\x1c-\x1e\x85\u2028\u2029]")


def one_line(text: str) -> str:
    """With ends of lines spelled out: a photo may be called so that it seems to say something of
    its own."""
    return _ENDS_OF_LINES.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


def counted(count: int, noun: str) -> str:
    """One photo, two photos."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def capitalized(sentence: str) -> str:
    """With a capital at its beginning, and all else as it is."""
    return sentence[:1].upper() + sentence[1:]


def day_and_hour(seconds: float | None) -> str:
    """Of a moment in seconds since 1970: 19:56:12 UTC on 30 November."""
    at = datetime.fromtimestamp(seconds or 0.0, timezone.utc)
    return f"{at:%H:%M:%S} UTC on {at.day} {_MONTHS[at.month - 1]}"


def clock(seconds: float) -> str:
    """Minutes and seconds, or hours as well: 1:05, 2:00:07."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
