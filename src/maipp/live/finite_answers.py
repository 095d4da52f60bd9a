"""Answers hold finite numbers only: what is none is told before anything is kept or sent."""

import math
from collections.abc import Iterator
from typing import Any

from maipp.errors import InputError


def whole(answer: dict[str, Any]) -> dict[str, Any]:
    """The answer. Raises InputError that names the first number in it that is not finite."""
    for where, value in _numbers(answer, ""):
        if not math.isfinite(value):
            raise InputError(
                f"{where}: the answer would be {value}, not a finite number; nothing was changed. The belief cannot be "
                "computed from what was measured, or the planner names no place"
            )
    return answer


def _numbers(value: Any, where: str) -> Iterator[tuple[str, float]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _numbers(item, f"{where}.{key}" if where else key)
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            yield from _numbers(item, f"{where}[{index}]")
    elif isinstance(value, float):
        yield where, value
