"""How far the robots of a survey are from where they may end."""

import numpy as np

from maipp.scenario import Scenario

Pair = tuple[float, float]


def distances_home(scenario: Scenario) -> list[tuple[Pair | None, float | None]]:
    """Of each robot the nearest place where it may end and the shortest way there from its start, domain units.

    None for a robot that may end anywhere; the way is inf where zones leave none. Starts must be given.
    """
    found: list[tuple[Pair | None, float | None]] = []
    starts = scenario.starts or ()
    every = scenario.ends_from(starts) if scenario.homes else ((),) * len(starts)
    for start, ends in zip(starts, every, strict=True):
        ways = [(_length(scenario, start, end), end) for end in ends]
        way, end = min(ways, default=(None, None))
        found.append((end, way))
    return found


def _length(scenario: Scenario, start: Pair, end: Pair) -> float:
    if not scenario.obstacles:
        return float(np.hypot(start[0] - end[0], start[1] - end[1]))
    from maipp.roadmap import zones  # imports JAX, which a mission without ends can be checked without

    return zones.free_space(scenario.obstacles, scenario.extent).length_between(np.array(start), np.array(end))
