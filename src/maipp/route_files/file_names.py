"""File names made of robots' names, that every operating system accepts."""

import re
import unicodedata
from collections.abc import Sequence

# What Windows, which is the strictest, does not allow in a name; and names it keeps for devices.
_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f\x7f]+')
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])(\..*)?", re.IGNORECASE)
_LONGEST = 100  # bytes; file systems stop at 255, and the suffix, a number and a temporary name want room


def file_stems(names: Sequence[str]) -> list[str]:
    """A file name without suffix for each robot name, all different even where upper and lower case are one.

    Letters of any script and spaces stay as they are; what a file system forbids becomes `_`; where two names come
    out alike, the later one gets `-2`, `-3` and so on.
    """
    taken: set[str] = set()
    stems = []
    for name in names:
        stem = original = _stem(name)
        count = 1
        while _same(stem) in taken:
            count += 1
            stem = f"{original}-{count}"
        taken.add(_same(stem))
        stems.append(stem)
    return stems


def _stem(name: str) -> str:
    """The name with what cannot stand in a file name replaced."""
    text = _FORBIDDEN.sub("_", unicodedata.normalize("NFC", name))
    text = text.encode("utf-8")[:_LONGEST].decode("utf-8", errors="ignore")
    text = text.strip().rstrip(". ")  # Windows drops these at the end
    if text.startswith(".") or _DEVICES.fullmatch(text):  # a dot hides the file
        text = "_" + text
    return text or "_"


def _same(stem: str) -> str:
    """What file systems that ignore case, or decompose letters, take the name for."""
    return unicodedata.normalize("NFD", unicodedata.normalize("NFD", stem).casefold())
