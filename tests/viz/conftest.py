"""A survey made by hand: two agents on straight routes over a field of one bump."""

import numpy as np
import pytest

from maipp.engine.episode import AgentRecord, Episode
from maipp.geo import GeoReference
from maipp.scenario import Scenario

SCENARIO = Scenario.create(
    agents=2, budget=0.8, grid=9, extent=[1.0, 0.5], start=[0.1, 0.1], obstacles=[[[0.7, 0.3], [0.9, 0.3], [0.8, 0.45]]]
)


def agent(end: tuple[float, float]) -> AgentRecord:
    start, stop = np.array([0.1, 0.1], np.float32), np.array(end, np.float32)
    distance = float(np.linalg.norm(stop - start))
    times = np.arange(0.2, distance + 1e-6, 0.2, dtype=np.float32)
    spots = start + (stop - start) * (times / distance)[:, None]
    return AgentRecord(
        start=start,
        budget=0.8,
        speed=1.0,
        distance=distance,
        decisions=2,
        route=np.stack([start, stop]),
        route_time=np.array([0.0, distance], np.float32),
        measurement_x=spots.astype(np.float32),
        measurement_y=bump(spots),
        measurement_time=times,
        known=np.full(2, len(times)),
    )


def bump(points: np.ndarray) -> np.ndarray:
    return np.exp(-20 * ((points - [0.4, 0.3]) ** 2).sum(axis=-1)).astype(np.float32)


def by_hand() -> Episode:
    """The survey."""
    x, y = np.linspace(0, 1.0, 9), np.linspace(0, 0.5, 9)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    agents = (agent((0.8, 0.2)), agent((0.1, 0.48)))
    inside = np.ones(81, bool)
    inside[-20:] = False
    return Episode(SCENARIO, "by-hand", {}, 0, 0, agents, bump(grid), inside, 0)


@pytest.fixture(scope="session")
def episode() -> Episode:
    return by_hand()


@pytest.fixture(scope="session")
def mapping() -> GeoReference:
    """A file in degrees whose low values are the interesting ones."""
    return GeoReference((10.0, 60.0), (2.0, 0.5), (1.0, 0.5), 30.0, 10.0, "longitude", "latitude", "temperature")
