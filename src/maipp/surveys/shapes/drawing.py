"""What a file draws: polygons as written, and what it says of them."""

import re
from collections import Counter
from collections.abc import Iterable
from typing import Any, NamedTuple, NoReturn

from maipp.errors import InputError
from maipp.geo import Crs

# What marks a polygon as one to keep out of, as a word of its name or of a folder around it.
_CLOSED = {"island", "islands", "islet", "obstacle", "obstacles", "exclude", "excluded", "exclusion", "exclusions"}
_CLOSED |= {"nogo", "keepout", "forbidden", "prohibited", "restricted", "avoid", "hazard", "hazards"}
_CLOSED_PAIRS = {("no", "go"), ("keep", "out"), ("no", "entry"), ("off", "limits")}


class Rings(NamedTuple):
    """One polygon as written: its outer ring, then its holes; `where` says where, for errors."""

    where: str
    rings: list[Any]  # lists of positions
    crs: Crs | None = None  # what the positions are; None: what the mission says
    name: str = ""  # as the file has it
    closed: bool | None = None  # whether it must not be entered; None: the file does not say


class Drawing(NamedTuple):
    """All that a file draws."""

    source: str  # the file, or the place in the mission file
    polygons: tuple[Rings, ...]  # at least one
    notes: tuple[str, ...] = ()  # what was left out, or taken as something, for people to read
    home: tuple[float, float] | None = None  # where vehicles set out, in the polygons' system


def named_closed(*names: str) -> bool | None:
    """True where one of the names says that a polygon must not be entered, None where none says anything."""
    for name in names:
        words = re.findall(r"[^\W\d_]+", name.lower())
        if _CLOSED & set(words) or _CLOSED_PAIRS & set(zip(words, words[1:], strict=False)):
            return True
    return None


def drawing_of(source: str, polygons: Iterable[Rings], left_out: Iterable[str], give: str) -> Drawing:
    """The drawing with a note of what else, one word each, is in it. Raises `InputError` for one without polygons."""
    found, counts = tuple(polygons), Counter(left_out)
    listed = ", ".join(f"{count} {kind}{'s' if count > 1 else ''}" for kind, count in counts.items())
    if not found:
        wrong(source, f"holds no polygon{f', only {listed}' if listed else ''}; give {give}")
    return Drawing(source, found, (f"{source}: beside its polygons {listed}, left out",) if listed else ())


def wrong(where: str, problem: str) -> NoReturn:
    """Raises the error that this place has this problem."""
    raise InputError(f"{where}: {problem}")
