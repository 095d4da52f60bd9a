"""Numbers of a recorded survey, read from its file."""

from typing import Annotated, Any

import numpy as np

from maipp.engine.episode_keys import Numbers
from maipp.records import Value, Within
from maipp.typing import Float, Int


def numbers(key: Value, real: np.dtype, count: int | None = None, *, empty: str = "") -> Float[np.ndarray, " n"]:
    """The list of finite numbers, of which there must be `count`, at precision `real`.

    Raises `FieldError` for anything else, and where `empty` says why it may not be so.
    """
    values = _list(key, Numbers, "", count)
    if empty and not values:
        key.wrong(f"is empty; {empty}")
    with np.errstate(over="ignore"):  # told below, in words
        array = np.array(values).astype(real)
    if not np.isfinite(array).all():
        key.at(f"[{int(np.flatnonzero(~np.isfinite(array))[0])}]").wrong(f"is too large for {real}")
    return array


def wholes(key: Value, most: int = 2**63 - 1, count: int | None = None) -> Int[np.ndarray, " n"]:
    """The list of whole numbers from 0 to `most`, of which there must be `count`."""
    whole = Annotated[int, Within(0, most=most, wide=True)]
    return np.array(_list(key, tuple[whole, ...], f"whole numbers from 0 to {most}", count), np.int64)


def _list(key: Value, annotation: Any, allowed: str, count: int | None) -> tuple[Any, ...]:
    values = key.fit(annotation, allowed)
    if count is not None and len(values) != count:
        key.wrong(f"has {len(values)} entries; give {count}")
    return values
