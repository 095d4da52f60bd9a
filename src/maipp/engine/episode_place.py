"""The place and the units of a recorded survey, read from its file (docs/episode.md, `mapping`)."""

from maipp.engine.episode_keys import MappingKeys, SystemKeys
from maipp.geo import PLANE, Crs, GeoReference
from maipp.records import Value
from maipp.scenario import Scenario


def read_reference(key: Value, scenario: Scenario) -> GeoReference | None:
    """The reference of a record; None where it is in domain units. Raises `InputError` for one that leads nowhere.

    What records of earlier versions lack is not known of them: the systems, and how long a unit is on the ground.
    """
    if key.value is None:
        return None
    origin, size, domain = (key.part(MappingKeys, name) for name in ("origin", "size", "domain"))
    zero, one = (key.part(MappingKeys, name) for name in ("value_at_zero", "value_at_one"))
    if domain != scenario.extent:
        key["domain"].wrong(f"is {list(domain)}, but scenario.extent is {list(scenario.extent)}")
    if zero == one:
        key["value_at_one"].wrong("is the same as value_at_zero")
    given = [key.part(MappingKeys, name) for name in ("x_name", "y_name", "value_name")]
    names = [name if told is None else told for name, told in zip(("x", "y", "value"), given, strict=True)]
    return GeoReference(
        origin,
        size,
        domain,
        zero,
        one,
        *names,
        plane=read_system(key["plane"]) if "plane" in key.mapping() else PLANE,
        user=read_system(key["user"]) if "user" in key else None,
        metres_per_unit=key.part(MappingKeys, "metres_per_unit") if "metres_per_unit" in key else None,
    )


def read_system(key: Value) -> Crs:
    """The coordinate reference system that `Crs.to_dict` wrote."""
    return Crs(*(key.part(SystemKeys, name) for name in ("crs", "geographic", "metres")))
