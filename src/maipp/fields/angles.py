"""Longitudes and latitudes as people and receivers write them: degrees, minutes and seconds, and hemispheres."""

import re

_WORDS = {
    "N": ("n", "north", "nord", "norte"),
    "S": ("s", "south", "sud", "süd", "sur"),
    "E": ("e", "east", "est", "este", "ost"),
    "W": ("w", "west", "ouest", "oeste"),
}
_HEMISPHERES = {word: letter for letter, words in _WORDS.items() for word in words}
_UNITS = {"d", "deg", "degrees", "m", "min", "sec"}
_MARKS = str.maketrans(dict.fromkeys("°º˚'′’´\"″”:", " ") | {"−": "-"})
_TOKEN = re.compile(r"\s*([^\W\d_]+|[-+]?\d+(?:[.,]\d+)?)(?=[^\d.,]|$)")
_LONGEST = 40  # characters


def hemisphere(text: str, axis: str) -> float | None:
    """1 for north and east, -1 for south and west, written as a letter or a word; None where it is none of `axis`."""
    letter = _HEMISPHERES.get(text.strip().strip(".").lower())
    return None if letter is None or letter not in ("EW" if axis == "x" else "NS") else 1.0 if letter in "NE" else -1.0


def angle(text: str, axis: str) -> float | None:
    """Degrees of a longitude (`axis` x) or latitude (y), such as `13° 19.0951' E` or `53.41 north`; None for none.

    With a hemisphere four or more digits before the point are degrees and minutes (`5324.42 N`), as receivers
    transmit them (NMEA 0183).
    """
    tokens = _tokens(text)
    words = [token for token in tokens or () if token[0].isalpha()]
    numbers = [token for token in tokens or () if not token[0].isalpha()]
    if (
        not tokens
        or len(words) > 1
        or not 1 <= len(numbers) <= 3
        or (words and words[0] not in (tokens[0], tokens[-1]))
    ):
        return None
    turned = hemisphere(words[0], axis) if words else -1.0 if numbers[0][0] == "-" else 1.0
    signed = [number for number in numbers[0 if words else 1 :] if number[0] in "+-"]
    broken = [number for number in numbers[:-1] if not number.lstrip("+-").isdecimal()]
    if turned is None or signed or broken:
        return None
    degrees, *parts = (float(number.lstrip("+-").replace(",", ".")) for number in numbers)
    if words and not parts and degrees >= 1000:
        return turned * packed(degrees)
    if any(part >= 60 for part in parts):
        return None
    return turned * (degrees + sum(part / 60.0 ** (index + 1) for index, part in enumerate(parts)))


def packed(number: float) -> float:
    """Degrees of a number whose last two digits before the point are minutes."""
    degrees = number // 100
    return degrees + (number - 100 * degrees) / 60


def _tokens(text: str) -> list[str] | None:
    """The numbers and words of a text without marks and words of units; None where there is anything else."""
    text, found, at = text.translate(_MARKS).strip().rstrip("."), [], 0
    while at < len(text) <= _LONGEST:
        token = _TOKEN.match(text, at)
        if token is None:
            return None
        found.append(token[1])
        at = token.end()
    return [token for token in found if token.lower() not in _UNITS]
