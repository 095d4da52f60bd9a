"""What many fields hold, for their annotations. Numbers are finite, and single precision holds them if not `wide`."""

from typing import Annotated, Any, TypeVar

from maipp.records.fit import Length, Within

T = TypeVar("T")


def rising(ends: tuple[Any, Any]) -> str | None:
    """What is wrong with the ends of a range."""
    return "is an empty range, its low end above its high end" if ends[0] > ends[1] else None


Real = Annotated[float, Within(), "a finite number"]
Positive = Annotated[float, Within(above=0.0)]
NotNegative = Annotated[float, Within(least=0.0)]
Count = Annotated[int, Within(least=1)]
AtLeast1 = Annotated[int, Within(1, wide=True)]
Finite = Annotated[float, Within(wide=True), "a finite number"]  # as float64 holds them
Each = Annotated[tuple[T, ...], Length(least=1)]  # a list with one entry at least
Ascending = Annotated[tuple[T, T], rising]  # a range, low end first
