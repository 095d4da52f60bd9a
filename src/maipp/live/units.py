"""The caller's coordinates and units on one side, domain units and standardised values on the other."""

import math
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon

from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.live.scaled_measurement import LARGEST_VALUE
from maipp.roadmap import Obstacles
from maipp.surveys.systems import PIECES
from maipp.typing import Float

Pair = tuple[float, float]

# What float32 can work with. Positions may lie this many domain units outside of the domain: robots drift.
_OUTSIDE = 1.0
_LARGEST_LENGTH = 1e4  # domain units
_LARGEST_TIME = 1e8  # seconds
_STRAIGHT = 1e-7  # domain units: vertices off a straight line by less are on it
_SPEEDS = (1e-6, 1e4)  # domain units per unit of time
_FARTHEST = 100.0  # prior standard deviations that a threshold may be from the prior mean, as in mission files


@dataclass(frozen=True)
class Units:
    """Without a frame the caller's units are the domain's own: domain units, standardised values.

    The caller's times are seconds, 0 of the scenario's time being the `epoch`; `extent` is the domain's. What the
    caller gives raises an `InputError` where it is too far off to compute with.
    """

    extent: Pair
    frame: GeoReference | None = None
    epoch: float = 0.0  # the caller's time of the survey's start, s
    seconds_per_time: float = 1.0  # seconds in the scenario's unit of time

    @property
    def names(self) -> dict[str, str | None]:
        """What positions, lengths and values are given in."""
        frame = self.frame
        if frame is None:
            return {"position": "domain units", "length": "domain units", "value": None, "time": "s"}
        position = "degrees (longitude, latitude)" if frame.geographic else "m"
        return {"position": position, "length": "m", "value": frame.unit, "time": "s"}

    def position(self, key: str, point: Pair) -> Pair:
        """Domain position of the caller's point."""
        if self.frame is None:
            x, y = point
        else:
            if self.frame.geographic and not (-180 <= point[0] <= 360 and -90 <= point[1] <= 90):
                raise InputError(f"{key}: {list(point)} is not [longitude, latitude] in degrees")
            x, y = self.frame.to_domain(np.array(point)).tolist()
        beyond = max(-x, -y, x - self.extent[0], y - self.extent[1])
        if not beyond <= _OUTSIDE:
            swapped = " (longitude comes first)" if self.frame is not None and self.frame.geographic else ""
            raise InputError(f"{key}: {list(point)} is far outside of the survey's area{swapped}")
        return x + 0.0, y + 0.0

    def polygon(self, key: str, ring: tuple[Pair, ...]) -> tuple[Pair, ...]:
        """Domain positions around the caller's polygon, whose edges are straight in the caller's coordinates.

        Raises `InputError` for one that crosses itself, has no area, or does not meet the domain.
        """
        inner = [self.position(f"{key}[{index}]", point) for index, point in enumerate(ring)]
        try:
            (polygon,) = Obstacles([inner]).polygons
        except InputError as error:
            raise InputError(str(error).replace("obstacle 0", key, 1)) from None
        if self.frame is not None and self.frame.geographic:
            drawn = Polygon(ring)
            west, south, east, north = drawn.bounds
            dense = shapely.segmentize(drawn, max(east - west, north - south) / PIECES)
            polygon = Polygon(self.frame.to_domain(shapely.get_coordinates(dense))).simplify(_STRAIGHT)
        if shapely.intersection(polygon, shapely.box(0.0, 0.0, *self.extent)).area <= 0:
            raise InputError(f"{key}: lies outside of the survey's area and would change nothing")
        return tuple((x + 0.0, y + 0.0) for x, y in shapely.get_coordinates(polygon)[:-1].tolist())

    def speed(self, key: str, speed: float) -> float:
        """The scenario's speed of the caller's lengths per second."""
        inner = speed / self._scale * self.seconds_per_time
        if not _SPEEDS[0] <= inner <= _SPEEDS[1]:
            raise InputError(f"{key}: {speed:g} is no speed of a robot here, in {self.names['length']} per second")
        return inner

    def threshold(self, key: str, value: float) -> float:
        """Standardised value of the caller's threshold."""
        inner = value if self.frame is None else float(self.frame.to_domain_values(value))
        if not abs(inner) <= _FARTHEST:
            raise InputError(
                f"{key}: {value:g} lies more than {_FARTHEST:g} prior standard deviations from the prior mean; give a "
                "threshold that values can reach"
            )
        return inner + 0.0

    def value(self, key: str, value: float, *, gated: bool = False) -> float:
        """Standardised value of the caller's value; of one that a gate judges any finite number will do."""
        inner = value if self.frame is None else float(self.frame.to_domain_values(value))
        if not (math.isfinite(inner) if gated else abs(inner) <= LARGEST_VALUE):
            raise InputError(f"{key}: {value:g} is more than {LARGEST_VALUE:g} standard deviations from the mean")
        return inner + 0.0

    def length(self, key: str, length: float) -> float:
        """Domain length of the caller's length."""
        inner = length / self._scale
        if not inner <= _LARGEST_LENGTH:
            raise InputError(f"{key}: {length:g} is more than {_LARGEST_LENGTH:g} times the area's longest side")
        return inner

    def time(self, key: str, time: float) -> float:
        """The scenario's time of the caller's time."""
        seconds = time - self.epoch
        if not 0 <= seconds <= _LARGEST_TIME:
            hint = "" if self.epoch else "; for Unix time, give the survey's start as the epoch"
            raise InputError(f"{key}: {time:.12g} is not between the epoch ({self.epoch:.12g}) and 3 years later{hint}")
        return seconds / self.seconds_per_time

    def points_out(self, points: Float[np.ndarray, "n 2"]) -> list[list[float]]:
        """The caller's coordinates of domain positions."""
        if self.frame is None:
            return [[_short(x), _short(y)] for x, y in points]
        digits = 9 if self.frame.geographic else 4  # 0.1 mm
        return [[round(x, digits), round(y, digits)] for x, y in self.frame.to_user(points).tolist()]

    def values_out(self, values: Float[np.ndarray, " n"]) -> list[float]:
        """The caller's values of standardised ones."""
        return [_short(v) for v in (values if self.frame is None else self.frame.to_user_values(values))]

    def std_out(self, std: Float[np.ndarray, " n"]) -> list[float]:
        """Standard deviations in the caller's unit."""
        return [_short(v) for v in (std if self.frame is None else self.frame.to_user_std(std))]

    def length_out(self, length: float) -> float:
        """The caller's length of a domain length."""
        return round(length, 7) if self.frame is None else round(length * self._scale, 4)

    def covariance_out(self, covariance: Float[np.ndarray, "3"]) -> list[float]:
        """xx, xy, yy in squared lengths of the caller's."""
        return [_short(float(entry) * self._scale**2) for entry in covariance]

    def speed_out(self, speed: float) -> float:
        """The caller's lengths per second of the scenario's speed."""
        return self.length_out(speed / self.seconds_per_time)

    def time_out(self, time: float) -> float:
        """The caller's time of the scenario's; with a frame to the millisecond."""
        return round(time * self.seconds_per_time + self.epoch, 7 if self.frame is None else 3)

    @property
    def _scale(self) -> float:
        return 1.0 if self.frame is None else self.frame.scale


def _short(number: np.floating | float) -> float:
    """The number with as few digits as tell it from its neighbours in float32, which is what is computed with."""
    return float(str(np.float32(number)))
