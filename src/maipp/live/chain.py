"""Lines of JSON that are chained: each begins with a checksum of itself and of the line before it.

So a line that was damaged, removed or moved is found, and two records that parted ways are told apart by one checksum.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from maipp.errors import InputError

PREFIX = b'{"sum":"'
_DIGITS = 16  # of a checksum: 64 bits
_HEAD = len(PREFIX) + _DIGITS + len(b'",')


def link(chain: bytes, seq: int, record: dict[str, Any]) -> tuple[bytes, bytes]:
    """The line, without its end, that follows a line with the checksum `chain` (empty: none), and its checksum."""
    body = json.dumps({"seq": seq} | record, allow_nan=False, separators=(",", ":")).encode("ascii")[1:]
    sum_ = _checksum(chain, body)
    return PREFIX + sum_ + b'",' + body, sum_


def follow(chain: bytes, line: bytes) -> tuple[bytes, bytes]:
    """The JSON of a line, and its checksum. Raises `ValueError` where it does not follow one with this `chain`."""
    body = line[_HEAD:]
    if not (line.startswith(PREFIX) and line[_HEAD - 2 : _HEAD] == b'",'):
        raise ValueError("is no line of a journal")
    sum_ = _checksum(chain, body)
    if line[len(PREFIX) : _HEAD - 2] != sum_:
        raise ValueError("is damaged, or lines before it are missing")
    return b"{" + body, sum_


def sum_of(line: bytes) -> bytes:
    """The checksum that a line says it has."""
    return line[len(PREFIX) : _HEAD - 2]


def records_of(content: bytes, path: Path) -> tuple[list[dict[str, Any]], bytes]:
    """The records of whole lines, and the checksum of the last. Raises `InputError` that names the first wrong line."""
    records, chain = [], b""
    for line in content.split(b"\n")[:-1]:
        where = f"{path}: line {len(records) + 1}"
        try:
            body, chain = follow(chain, line)
        except ValueError as error:
            raise InputError(f"{where} {error}; put back a copy of the file, or give another one") from None
        try:
            records.append(json.loads(body))
        except (ValueError, RecursionError):
            raise InputError(f"{where} is no JSON; put back a copy of the file, or give another one") from None
    return records, chain


def _checksum(chain: bytes, body: bytes) -> bytes:
    return hashlib.sha256(chain + body).hexdigest()[:_DIGITS].encode("ascii")
