import unicodedata

import numpy as np
import pytest
from hypothesis import strategies as st

from maipp.route_files import Route, RoutePlan

LAKE = np.array([[4.1, 51.8], [4.3, 51.8], [4.3, 52.0], [4.2, 51.95], [4.1, 52.0]])
ISLAND = np.array([[4.22, 51.9], [4.22, 51.91], [4.23, 51.91], [4.23, 51.9], [4.22, 51.9]])
# Every character that a name may hold, the awkward ones often.
characters = st.characters(exclude_categories=("Cc", "Cs", "Zl", "Zp"), exclude_characters="\ufffe\uffff")
texts = st.text(st.one_of(st.sampled_from("<>&\"'/\\.,;:=|?*%{}[] é船\u0301"), characters), max_size=20)
names = texts.filter(lambda name: bool(name) and name == name.strip())


@st.composite
def plan_values(draw, geographic):
    """The arguments of routes and plan: coordinates of all sizes, names and texts that need escaping."""
    limits = (180.0, 90.0) if geographic else (1e6, 1e6)
    # Half the range in x, so that no leg goes more than half way round.
    west = draw(st.floats(-limits[0], 0.0))
    place = st.tuples(st.floats(west, west + limits[0]), st.floats(-limits[1], limits[1]))
    routes = []
    for name in draw(st.lists(names, min_size=1, max_size=3, unique_by=_normal)):
        points = np.array(draw(st.lists(place, min_size=1, max_size=6)))
        times = np.sort(draw(st.lists(st.floats(0, 1e6), min_size=len(points), max_size=len(points))))
        measured = np.reshape(draw(st.lists(place, max_size=4)), (-1, 2))
        routes.append((name, points, times, draw(st.floats(0.01, 100.0)), measured))
    scale = 1.0 if geographic else 1e3
    quantity, unit = draw(st.none() | texts), draw(st.none() | texts)
    return routes, draw(texts), (LAKE * scale, (ISLAND * scale,), geographic, quantity, unit)


def _normal(name):
    return unicodedata.normalize("NFC", name)


def two_boats(geographic=True):
    """A small plan whose files are compared with those in golden/."""
    points = np.array([[4.2, 51.9], [4.21, 51.905], [4.2071234567, 51.93]])
    measured = points[:1] * 0.5 + points[1:2] * 0.5
    shift = np.zeros(2) if geographic else np.array([4.1, 51.8])
    scale = 1.0 if geographic else 70_000.0
    routes = (
        Route("Nord/Süd 1", (points - shift) * scale, np.array([0, 737.5, 3050.129]), 1.2, (measured - shift) * scale),
        Route("south & east", (points[:1] - shift) * scale, np.zeros(1), 0.8),
    )
    no_go = ((ISLAND - shift) * scale,)
    return RoutePlan("Lake <1>", routes, (LAKE - shift) * scale, no_go, geographic, "chlorophyll", "µg/L")


@pytest.fixture(scope="session")  # as Hypothesis asks
def any_plan():
    """`any_plan(data, geographic)`: a plan drawn by Hypothesis."""

    def draw(data, geographic=True):
        # Made here, not in the strategy: beartype, which checks what is made, draws random numbers of its own.
        routes, title, rest = data.draw(plan_values(geographic))
        return RoutePlan(title, tuple(Route(*values) for values in routes), *rest)

    return draw


@pytest.fixture
def plan():
    return two_boats()


@pytest.fixture
def plan_in_metres():
    return two_boats(geographic=False)
