from typing import Any

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.route_files import Route, RoutePlan

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
GOOD = {"name": "a", "points": [[0.0, 0.0], [1.0, 1.0]], "times": [0.0, 2.0], "speed": 1.0}


def route(**changes):
    values: dict[str, Any] = {**GOOD, **changes}
    values |= {key: np.array(value) for key, value in values.items() if isinstance(value, list)}
    return Route(**values)


def plan(**changes):
    values = {"title": "t", "routes": (route(),), "area": SQUARE, "no_go": (), "geographic": True}
    return RoutePlan(**{**values, **changes})


def test_arrays_are_float64_and_cannot_be_changed():
    made = plan(no_go=(np.array([[1, 1], [3, 1], [3, 3], [1, 1]], np.int32),), geographic=False)
    for array in (made.routes[0].points, made.routes[0].times, made.routes[0].measurements, made.area, made.no_go[0]):
        assert array.dtype == np.float64 and not array.flags.writeable
    assert made.routes[0].measurements.shape == (0, 2)
    assert made.no_go[0].tolist() == [[1, 1], [3, 1], [3, 3]]  # open, though given closed


def test_the_arrays_given_stay_the_caller_s():
    points = np.array(GOOD["points"])
    made = route(points=points)
    points[0] = 7.0
    assert made.points[0].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"name": ""}, "is empty"),
        ({"name": " a"}, "begins or ends in a space"),
        ({"name": "a\nb"}, "U+000A"),
        ({"name": "a\x00"}, "U+0000"),
        ({"name": "a\ud800"}, "U+D800"),
        ({"name": "a\uffff"}, "U+FFFF"),
        ({"name": "a\u2028b"}, "U+2028"),
        ({"points": []}, "no points"),
        ({"points": [[0.0, np.nan], [1.0, 1.0]]}, "points: is nan at [0, 1]"),
        ({"points": [[0.0, np.inf], [1.0, 1.0]]}, "points: is inf"),
        ({"points": [[0.0, 1e12], [1.0, 1.0]]}, "no number may be beyond"),
        ({"points": [[0.0, 1.0, 2.0], [1.0, 1.0, 1.0]]}, "shape (2, 3); it must be (n, 2)"),
        ({"points": [["north", 1.0], [1.0, 1.0]]}, "not a table of numbers"),
        ({"points": [[10**400, 1.0], [1.0, 1.0]]}, "not a table of numbers"),
        ({"times": [0.0]}, "times: has shape (1,); it must be (2)"),
        ({"times": [1.0, 0.5]}, "must not fall"),
        ({"times": [-1.0, 0.5]}, "must not fall, nor begin below 0"),
        ({"speed": 0.0}, "speed is 0; give metres per second above 0"),
        ({"speed": np.nan}, "speed: is nan"),
        ({"measurements": [[0.0, np.nan]]}, "measurements: is nan"),
    ],
)
def test_what_no_route_can_be_is_told(changes, told):
    with pytest.raises(InputError) as caught:
        route(**changes)
    assert told in str(caught.value) and len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"routes": ()}, "at least one robot"),
        ({"routes": (route(), route())}, "2 robots have this name"),
        ({"routes": (route(name="é"), route(name="e\u0301"))}, "2 robots have this name"),
        ({"title": "a\tb"}, "the title"),
        ({"unit": "\x1b"}, "the unit"),
        ({"area": SQUARE[:2]}, "area: 2 vertices; a polygon has at least 3"),
        ({"area": SQUARE[[0, 2, 1, 3]]}, "area: no simple polygon: Self-intersection"),
        ({"area": np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])}, "no simple polygon"),
        ({"no_go": (SQUARE, SQUARE[:1])}, "no-go zone 2: 1 vertices"),
        ({"routes": (route(points=[[0.0, 91.0], [1.0, 1.0]]),)}, "points[0]: (0, 91) is no (longitude, latitude)"),
        ({"routes": (route(measurements=[[181.0, 0.0]]),)}, "measurements[0]"),
        ({"area": SQUARE * 500.0}, "area[1]: (500, 0) is no"),
        ({"routes": (route(points=[[179.0, 0.0], [-179.0, 0.0]]),)}, "crosses the 180th meridian"),
    ],
)
def test_what_no_plan_can_be_is_told(changes, told):
    with pytest.raises(InputError) as caught:
        plan(**changes)
    assert told in str(caught.value) and len(str(caught.value).splitlines()) == 1


def test_metres_may_be_beyond_degrees():
    made = plan(area=np.multiply(SQUARE, 5e5), routes=(route(points=[[-4e5, 91.0], [4e5, 1.0]]),), geographic=False)
    assert made.area.max() == 5e5
