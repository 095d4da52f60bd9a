"""What was changed of a survey under way: what decisions are made in now follows from it and the mission."""

from dataclasses import dataclass, replace
from typing import NamedTuple

Pair = tuple[float, float]
Ring = tuple[Pair, ...]  # around a polygon, its first vertex once


class ZoneSetting(NamedTuple):
    """What was said last of a zone: of several events the latest decides."""

    time: float  # the scenario's time
    event: str  # id of the event that said so
    ring: Ring | None  # domain units; None: there is none of that name
    told: Ring | None  # the same in the caller's coordinates


class ThresholdSetting(NamedTuple):
    """What was said last of the threshold; the latest decides."""

    time: float
    event: str
    value: float  # standardised
    told: float  # in the caller's unit


class Joiner(NamedTuple):
    """A robot that takes part although the mission does not have it."""

    name: str
    position: Pair  # domain units, where it began
    budget: float  # domain units
    speed: float  # domain units per unit of time
    ends: tuple[Pair, ...]  # it ends at any of these, domain units; none: anywhere
    time: float


@dataclass(frozen=True)
class Changes:
    """All changes so far. Hashable: worlds are kept by it.

    Zones and threshold depend on the set of events alone. Robots are numbered in the order in which they were told to
    join, and `anchors` depend on where the robots were.
    """

    zones: tuple[tuple[str, ZoneSetting], ...] = ()  # by name, in the order of names; removed ones too
    threshold: ThresholdSetting | None = None
    joined: tuple[Joiner, ...] = ()
    # Where the roadmap of each robot begins since zones or team changed, domain units; none: where the robot did
    anchors: tuple[Pair, ...] = ()

    @property
    def rings(self) -> dict[str, Ring]:
        """The zones that stand, domain units."""
        return {name: ruling.ring for name, ruling in self.zones if ruling.ring is not None}

    @property
    def geometry(self) -> "Changes":
        """What of the changes roadmaps and ways depend on."""
        standing = tuple((name, ZoneSetting(0.0, "", ring, None)) for name, ring in self.rings.items())
        return Changes(standing, None, self.joined, self.anchors)

    def zone(self, name: str) -> ZoneSetting | None:
        """What was said last of a zone."""
        return dict(self.zones).get(name)

    def with_zone(self, name: str, ruling: ZoneSetting) -> "Changes":
        """With what was said of a zone; the same where something later is known."""
        known = self.zone(name)
        if known is not None and ruling[:2] <= known[:2]:
            return self
        return replace(self, zones=tuple(sorted({**dict(self.zones), name: ruling}.items(), key=lambda each: each[0])))

    def with_threshold(self, level: ThresholdSetting) -> "Changes":
        """With another threshold; the same where a later one is known."""
        if self.threshold is not None and level <= self.threshold:
            return self
        return replace(self, threshold=level)

    def with_robot(self, joiner: Joiner) -> "Changes":
        """With another robot."""
        return replace(self, joined=(*self.joined, joiner))
