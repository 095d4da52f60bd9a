"""What goes over a link: a line of JSON, then bytes. Read strictly, within bounds, whoever sent it."""

import json
import zlib
from typing import Any

from maipp.fleet.log import Head, Origin, read_origin
from maipp.fleet.logs import LogSegment

# Largest frame, bytes as they come; largest part of a log, bytes unpacked.
LARGEST_FRAME, LARGEST_PART = 1 << 22, 1 << 24
_LONGEST_HEADER = 1 << 18
MOST_ORIGINS = 2000


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
    try:
        values = json.loads(header, parse_constant=_refuse)
    except RecursionError:
        raise ValueError("a header that is nested too deep") from None
    if not isinstance(values, dict):
        raise ValueError("a header that is no object")
    return values, body


def _refuse(name: str) -> None:
    raise ValueError(f"{name} is no number")


def encode_part(part: LogSegment) -> bytes:
    """A part of a log; what has more than one line is compressed."""
    text = b"\n".join(part.lines)
    packed = len(part.lines) > 1
    header = {"origin": str(part.origin), "start": part.start, "signature": part.signature.hex(), "packed": packed}
    return encode(header, zlib.compress(text, 6) if packed else text)


def decode_part(frame: bytes) -> LogSegment:
    """The part of a log that a frame holds. Raises `ValueError` for what is none."""
    header, body = decode(frame)
    origin, start = read_origin(_text(header, "origin")), _count(header, "start")
    signature = bytes.fromhex(_text(header, "signature"))
    if header.get("packed") is True:
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
    if not isinstance(values, dict) or len(values) > MOST_ORIGINS:
        raise ValueError("heads that are no object, or too many")
    heads = {}
    for name, head in values.items():
        match head:
            case [int(length), str(chain)] if length > 0 and not isinstance(length, bool) and len(chain) <= 64:
                heads[read_origin(name)] = Head(length, chain.encode("ascii"))
            case _:
                raise ValueError(f"the head of {name!r:.60} is none")
    return heads


def _text(values: dict[str, Any], key: str) -> str:
    value = values.get(key)
    if not isinstance(value, str):
        raise ValueError(f"{key} is no text")
    return value


def _count(values: dict[str, Any], key: str) -> int:
    value = values.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError(f"{key} is no number of lines")
    return value
