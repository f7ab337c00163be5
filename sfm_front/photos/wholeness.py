"""Whether a photo's file has been written to its end."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from sfm_front.photos.decoding import Undecodable, decode
from sfm_front.photos.formats import format_of

# What the last bytes of most whole files are: the others are parsed. JPEG: the end-of-image marker;
# PNG: the IEND chunk with its checksum.
_LAST_BYTES = {"JPEG": b"\xff\xd9", "PNG": b"IEND\xaeB`\x82"}


def is_whole(path: Path) -> bool:
    """Whether the file is an image of a known format that does not end too soon.

    A damaged image is whole if its end is there. False for what cannot be read, for now or for
    ever. Reads a few bytes of most files and all of the others; decodes BMP alone, in which nothing
    else shows the end.
    """
    try:
        # Opening a pipe would wait for ever.
        if not stat.S_ISREG(path.stat().st_mode):
            return False
        with path.open("rb") as file:
            head = file.read(12)
            image_format = format_of(head)
            if image_format is None:
                return False
            last_bytes = _LAST_BYTES.get(image_format.name)
            if last_bytes is not None:
                file.seek(-len(last_bytes), os.SEEK_END)
                if file.read() == last_bytes:
                    return True
            file.seek(0)
            data = file.read()
    except (OSError, ValueError, MemoryError):
        return False
    if image_format.name == "BMP":
        return not isinstance(decode(data, max_image_size=1), Undecodable)
    return not image_format.is_cut_short(data)
