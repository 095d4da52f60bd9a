"""Malformed inputs made of good ones: the same number gives the same input on every machine."""

import random
import re
from collections.abc import Callable, Sequence

NUMBER = re.compile(rb"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?")
TOKEN = re.compile(rb"[\w.+-]+|[^\w\s]")

# What readers of numbers and texts stumble over.
NUMBERS = [
    *(b"0 -0 -0.0 -1 1e999 -1e999 1e308 1.8e308 5e-324 1e-400 0x10 1_000 1e 1.2.3 +-1 .5 5. 007 0o7".split()),
    *(b"nan NaN -nan .nan inf Infinity -Infinity .inf -.inf 1e5 2147483648 9223372036854775808 true null".split()),
    b"9" * 400,
    b"9" * 5000,
    b"1" + b"0" * 30,
    b"0." + b"0" * 400 + b"1",
    "٣".encode(),  # a digit to Python's float, not to a person
    "１２".encode(),
    b"",
    b" ",
]
TEXTS = [
    b"\x00",
    b"\xff\xfe",
    b"\xc3",  # UTF-8 cut short
    b"\xed\xa0\x80",  # a surrogate
    b"\xef\xbb\xbf",  # byte-order mark
    "\x85".encode(),  # line breaks to Python, not to everybody
    "\u2028".encode(),
    b"\x0b",
    b"\x0c",
    b"\x1c",
    b"\x1b[31m",
    b"\r",
    b"\r\n",
    b"\t",
    b"'",
    b'"',
    b"\\",
    b"%s{}",
    b"../../x",
    "é船".encode(),
    b"A" * 3000,
]
BYTES = [0, 1, 9, 10, 13, 32, 34, 44, 47, 58, 91, 93, 123, 125, 127, 128, 255]

Mutation = Callable[[bytes, random.Random], bytes]


def _span(data: bytes, rng: random.Random) -> tuple[int, int]:
    start = rng.randrange(len(data) + 1)
    return start, min(len(data), start + rng.choice((1, 2, 4, 16, 64, 400)))


def _flip_bit(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]


def _set_byte(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes([rng.choice(BYTES)]) + data[at + 1 :]


def _truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


def _delete(data: bytes, rng: random.Random) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def _repeat(data: bytes, rng: random.Random) -> bytes:
    start, end = _span(data, rng)
    return data[:end] + data[start:end] * rng.choice((1, 2, 5)) + data[end:]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(TEXTS) + data[at:]


def _noise(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.randbytes(rng.choice((1, 3, 10))) + data[at:]


def _replace(pattern: re.Pattern[bytes], by: Callable[[bytes, random.Random], bytes]) -> Mutation:
    def mutate(data: bytes, rng: random.Random) -> bytes:
        found = list(pattern.finditer(data))
        if not found:
            return data
        match = rng.choice(found)
        return data[: match.start()] + by(match[0], rng) + data[match.end() :]

    return mutate


def _nested(token: bytes, rng: random.Random) -> bytes:
    depth = rng.choice((1, 1, 2, 2, 5, 5, 30, 30, 2000, 20_000))
    opened, closed = rng.choice(((b"[", b"]"), (b"{", b"}"), (b'{"a":', b"}"), (b"(", b")"), (b"- ", b"")))
    return opened * depth + token + closed * rng.choice((depth, depth, depth - 1))


def _swap_tokens(data: bytes, rng: random.Random) -> bytes:
    found = list(TOKEN.finditer(data))
    if len(found) < 2:
        return data
    first, second = sorted(rng.sample(found, 2), key=lambda match: match.start())
    between = data[first.end() : second.start()]
    return data[: first.start()] + second[0] + between + first[0] + data[second.end() :]


def _move_line(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    line = lines.pop(rng.randrange(len(lines)))
    for _ in range(rng.choice((0, 1, 1, 2))):  # dropped, moved, or moved and doubled
        lines.insert(rng.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


def mutations(tokens: Sequence[bytes] = ()) -> list[Mutation]:
    """All of them, those that keep most of the structure several times; `tokens` are words of the format."""
    number = _replace(NUMBER, lambda _, rng: rng.choice(NUMBERS))
    words = [*NUMBERS, *TEXTS, *tokens]
    token = _replace(TOKEN, lambda _, rng: rng.choice(words))
    deeper = _replace(TOKEN, _nested)
    bare = [_flip_bit, _set_byte, _truncate, _delete, _repeat, _insert, _noise]
    return [*bare, number, number, number, token, token, token, deeper, _swap_tokens, _swap_tokens, _move_line]


def malformed(seeds: Sequence[bytes], number: int, tokens: Sequence[bytes] = ()) -> bytes:
    """The input with this number: one of the seeds, changed in one to eight places, now and then grown into another."""
    rng = random.Random(number)
    data = rng.choice(seeds)
    if rng.random() < 0.05:
        other = rng.choice(seeds)
        data = data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]
    kinds = mutations(tokens)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 5, 8))):
        if data:
            data = rng.choice(kinds)(data, rng)
    return data
