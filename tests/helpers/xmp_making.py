"""XMP packets as makers write them, and photos that have one, for tests."""

from __future__ import annotations

import io

from PIL import Image

XMP_HEADER = b"http://ns.adobe.com/xap/1.0/\0"


def packet(*, attributes: str = "", elements: str = "") -> bytes:
    """XMP with these attributes and elements in its description."""
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
        '<x:xmpmeta xmlns:x="adobe:ns:meta/">\n'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">\n'
        '<rdf:Description rdf:about="" xmlns:tiff="http://ns.adobe.com/tiff/1.0/" '
        'xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/" '
        f'xmlns:Camera="http://pix4d.com/camera/1.0/" {attributes}>{elements}'
        "</rdf:Description>\n</rdf:RDF>\n</x:xmpmeta>\n"
        '<?xpacket end="w"?>'
    ).encode()


def dji(**properties: str) -> bytes:
    """XMP with these properties of DJI as attributes."""
    return packet(
        attributes=" ".join(f'drone-dji:{name}="{text}"' for name, text in properties.items())
    )


def jpeg(xmp: bytes, exif: bytes = b"") -> bytes:
    """A JPEG file with a segment of its own for XMP, which cameras write behind that of EXIF."""
    buffer = io.BytesIO()
    Image.new("RGB", (160, 120), (90, 120, 30)).save(buffer, "JPEG", exif=exif)
    data = buffer.getvalue()
    # Behind the segments of JFIF and EXIF, both of which are optional.
    at = 2
    while data[at + 1] in (0xE0, 0xE1):
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    content = XMP_HEADER + xmp
    segment = b"\xff\xe1" + (len(content) + 2).to_bytes(2, "big") + content
    return data[:at] + segment + data[at:]
