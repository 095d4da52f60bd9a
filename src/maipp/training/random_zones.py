"""No-go zones drawn at random, for worlds to train in."""

import numpy as np

# Distances of a zone's corners from its middle, parts of the unit square's side, and how many corners it has.
_SIZE, _CORNERS = (0.06, 0.25), (3, 6)


def random_zones(random: np.random.Generator, count: tuple[int, int]) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Polygons around places of the unit square, from `count[0]` to `count[1]` of them.

    They may overlap and reach beyond the square; none crosses itself.
    """
    return tuple(_zone(random) for _ in range(random.integers(count[0], count[1] + 1)))


def _zone(random: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Corners in order of their angle around a middle that they enclose."""
    corners = random.integers(_CORNERS[0], _CORNERS[1] + 1)
    # Each in a sector of its own, so that no two directions are half a turn apart or alike.
    angle = 2.0 * np.pi * (np.arange(corners) + random.uniform(0.1, 0.4, corners)) / corners
    offset = random.uniform(*_SIZE, corners)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = random.uniform(0.0, 1.0, 2) + offset
    return tuple((float(x), float(y)) for x, y in np.round(points, 4))
