"""What goes over a link: a line of JSON, then bytes. Read strictly, within bounds, whoever sent it."""

import json
import zlib
from typing import Annotated, Any

from maipp.fleet.log import Head, Origin, read_origin
from maipp.fleet.logs import LogSegment
from maipp.records import Length, Value, Within, read_json
from maipp.records.kinds import AtLeast1

# Largest frame, bytes as they come; largest part of a log, bytes unpacked.
LARGEST_FRAME, LARGEST_PART = 1 << 22, 1 << 24
_LONGEST_HEADER = 1 << 18
MOST_ORIGINS = 2000

_Start = Annotated[int, Within(0, wide=True), "a number of lines"]
_Head = tuple[AtLeast1, Annotated[str, Length(most=64)]]


def encode(header: dict[str, Any], body: bytes = b"") -> bytes:
    """The frame of a header and what follows it."""
    return json.dumps(header, allow_nan=False, separators=(",", ":")).encode("ascii") + b"\n" + body


def decode(frame: bytes) -> tuple[dict[str, Any], bytes]:
    """Header and body. Raises `ValueError` for what is no frame."""
    if len(frame) > LARGEST_FRAME:
        raise ValueError(f"a frame of {len(frame)} bytes")
    header, _, body = frame.partition(b"\n")
    if len(header) > _LONGEST_HEADER:
        raise ValueError(f"a header of {len(header)} bytes")
    return read_json(header, "header", strict=True).mapping(), body


def encode_part(part: LogSegment) -> bytes:
    """A part of a log; what has more than one line is compressed."""
    text = b"\n".join(part.lines)
    packed = len(part.lines) > 1
    header = {"origin": str(part.origin), "start": part.start, "signature": part.signature.hex(), "packed": packed}
    return encode(header, zlib.compress(text, 6) if packed else text)


def decode_part(frame: bytes) -> LogSegment:
    """The part of a log that a frame holds. Raises `ValueError` for what is none."""
    values, body = decode(frame)
    header = Value(values, "header")
    origin, start = read_origin(header["origin"].fit(str)), header["start"].fit(_Start)
    signature = bytes.fromhex(header["signature"].fit(str))
    if "packed" in header and header["packed"].fit(bool):
        try:
            stream = zlib.decompressobj()
            body = stream.decompress(body, LARGEST_PART)
        except zlib.error as error:
            raise ValueError(str(error)) from None
        if not stream.eof or stream.unused_data:
            raise ValueError("a part that is cut short, or too large")
    return LogSegment(origin, start, body.split(b"\n"), signature)


def encode_heads(heads: dict[Origin, Head]) -> dict[str, Any]:
    """How far logs go, as JSON."""
    return {str(origin): [head.length, head.chain.decode("ascii")] for origin, head in heads.items()}


def decode_heads(values: Any) -> dict[Origin, Head]:
    """How far logs go, from JSON. Raises `ValueError` for what is no such thing."""
    told = Value(values, "heads")
    if len(told.mapping()) > MOST_ORIGINS:
        raise ValueError(f"heads of {len(values)} logs")
    heads = {}
    for name in values:
        length, chain = told[name].fit(_Head, "a number of lines and a checksum")
        heads[read_origin(name)] = Head(length, chain.encode("ascii"))
    return heads
