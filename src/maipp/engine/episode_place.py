"""The place and the units of a recorded survey, read from its file (docs/episode.md, `mapping`)."""

import numpy as np

from maipp.engine.checked_json import Key
from maipp.geo import PLANE, Crs, GeoReference
from maipp.scenario import Scenario


def read_reference(key: Key, scenario: Scenario) -> GeoReference | None:
    """The reference of a record; None where it is in domain units. Raises `InputError` for one that leads nowhere.

    What records of earlier versions lack is not known of them: the systems, and how long a unit is on the ground.
    """
    if key.value is None:
        return None
    origin, size, domain = (_pair(key[name]) for name in ("origin", "size", "domain"))
    zero, one = key["value_at_zero"].number(), key["value_at_one"].number()
    for name, sides in (("size", size), ("domain", domain)):
        if min(sides) <= 0:
            key[name].wrong(f"is {list(sides)}; both must be above 0")
    if domain != scenario.extent:
        key["domain"].wrong(f"is {list(domain)}, but scenario.extent is {list(scenario.extent)}")
    if zero == one:
        key["value_at_one"].wrong("is the same as value_at_zero")
    names = [
        key[name].text() if key[name].value is not None else other
        for name, other in (("x_name", "x"), ("y_name", "y"), ("value_name", "value"))
    ]
    later = key.mapping()
    return GeoReference(
        origin,
        size,
        domain,
        zero,
        one,
        *names,
        plane=_crs(key["plane"]) if "plane" in later else PLANE,
        user=_crs(key["user"]) if later.get("user") is not None else None,
        metres_per_unit=_positive(key["metres_per_unit"]) if "metres_per_unit" in later else None,
    )


def _pair(key: Key) -> tuple[float, float]:
    first, second = key.numbers(np.dtype(np.float64), 2).tolist()
    return first, second


def _positive(key: Key) -> float | None:
    if key.value is None:
        return None
    number = key.number()
    if number <= 0:
        key.wrong(f"is {number}; it must be above 0")
    return number


def _crs(key: Key) -> Crs:
    geographic = key["geographic"].value
    if not isinstance(geographic, bool):
        key["geographic"].wrong("must be true or false")
    name = None if key["crs"].value is None else key["crs"].text()
    return Crs(name, geographic, _positive(key["metres"]))
