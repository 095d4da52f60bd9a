import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from maipp.engine.polyline import shortened
from maipp.live.detour import keep_out
from maipp.roadmap import Obstacles
from maipp.scenario import Scenario

SQUARE = ((0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6))
ZONE = Scenario(obstacles=(SQUARE,))
ZONES = Obstacles((SQUARE,))
CORNERS = np.array([[0.35, 0.35], [0.65, 0.35], [0.65, 0.65], [0.35, 0.65]])
AXIS = st.floats(0, 1)


def test_a_free_leg_stays():
    leg = np.array([[0.1, 0.1], [0.3, 0.9], [0.9, 0.9]])
    assert keep_out(ZONE, leg, CORNERS) is leg
    assert keep_out(Scenario(), np.array([[0.1, 0.5], [0.9, 0.5]]), None) is not None


def test_a_leg_across_a_zone_goes_by_a_node():
    leg = np.array([[0.3, 0.45], [0.55, 0.35]])
    np.testing.assert_array_equal(keep_out(ZONE, leg, CORNERS), [leg[0], CORNERS[0], leg[1]])
    assert keep_out(ZONE, leg, None) is None
    assert keep_out(ZONE, np.array([[0.3, 0.5], [0.7, 0.5]]), CORNERS) is None  # one node is not enough


@given(x=AXIS, y=AXIS, to_x=AXIS, to_y=AXIS)
def test_no_leg_crosses_a_zone_but_to_leave_it(x, y, to_x, to_y):
    leg = np.array([[x, y], [to_x, to_y]])
    assume(ZONES.free(leg[1:])[0])
    kept = keep_out(ZONE, leg, CORNERS)
    if kept is None:
        return
    np.testing.assert_array_equal(kept[[0, -1]], leg)
    drifted = not ZONES.free(leg[:1])[0]
    assert not ZONES.crosses(kept[drifted:-1], kept[1 + drifted :]).any()
    if drifted:
        assert np.hypot(*(kept[1] - kept[0])) <= 0.1 + 1e-4  # half the square's side is the farthest way out


@given(length=st.floats(0, 3))
def test_cut_to_a_length(length):
    line = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    kept = shortened(line, length)
    assert np.hypot(*np.diff(kept, axis=0).T).sum() == pytest.approx(min(length, 2.0))
    np.testing.assert_array_equal(kept[0], line[0])
