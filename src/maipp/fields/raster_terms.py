"""What grids and their axes go by in files, which of several is meant, and how large one may be."""

from maipp.errors import InputError

X_NAMES = ("x", "lon", "longitude", "easting")
Y_NAMES = ("y", "lat", "latitude", "northing")
VALUE_NAMES = ("value", "values", "z", "topo", "data", "depth", "elevation")
MOST_CELLS = 25_000_000  # 200 MB in float64


def choose(candidates: list[str], value: str | None, where: str, what: str) -> str:
    """The one candidate that the person named, that is alone, or that has a customary name."""
    listed = ", ".join(candidates) or "none"
    if value is not None:
        if value not in candidates:
            raise InputError(f"{where}no {what} named '{value}'; there is: {listed}")
        return value
    customary = candidates if len(candidates) == 1 else [c for c in candidates if c.lower() in VALUE_NAMES]
    if len(customary) == 1:
        return customary[0]
    if not candidates:
        raise InputError(f"{where}no {what} in it")
    raise InputError(f"{where}more than one {what} ({listed}); choose one with value=NAME")
