import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.live.messages import describe, pack, unpack
from maipp.live.units import Units
from maipp.planners.announced.announcement import Announcement, TeamPlan
from maipp.team import Intent

OWN = Units((1.0, 1.0))
F = np.float32


def told_by(kind, *arrays):
    """A message as it comes from the device: host arrays in the planner's own type."""
    return kind(*arrays)


def legs():
    points = np.array([[0.1, 0.2], [0.3, 0.4], [0.0, 0.0]], F)
    return told_by(Announcement, points, np.array([0.5, 1.5, np.inf], F))


@given(st.binary(min_size=36, max_size=36))
def test_every_bit_comes_back(content):
    like = {"a": np.zeros((2, 3), F), "b": (np.zeros((), np.int32), np.zeros(8, bool))}
    numbers = np.frombuffer(content[:24], F).reshape(2, 3)
    tree = {
        "a": numbers,
        "b": (np.frombuffer(content[24:28], np.int32)[0], np.frombuffer(content[28:], np.uint8) > 127),
    }
    again = unpack(pack(tree), like)
    assert jax.tree.structure(again) == jax.tree.structure(like)
    for mine, other in zip(jax.tree.leaves(again), jax.tree.leaves(tree), strict=True):
        assert mine.tobytes() == np.asarray(other).tobytes()


def test_nothing_packs_to_nothing():
    assert pack(()) == "" and unpack("", ()) == () and describe((), OWN) is None


@pytest.mark.parametrize("text", ["AAAA", "A", "????", "é", ""])
def test_a_text_of_another_message_is_refused(text):
    with pytest.raises(InputError, match=r"^packed: "):
        unpack(text, np.zeros(2, F))


def test_an_intent_is_told_as_mean_and_covariance():
    intent = told_by(Intent, np.array([0.5, 0.25], F), np.array([0.04, 0.0, 0.01], F))
    told = describe(intent, OWN)
    assert told == {"mean": [0.5, 0.25], "covariance": [0.04, 0.0, 0.01], "packed": pack(intent)}
    assert describe(told_by(Intent, np.full(2, np.nan, F), np.full(3, np.nan, F)), OWN) is None


def test_announced_measurements_are_told_as_far_as_they_go():
    told = describe(legs(), OWN)
    assert told == {"points": [[0.1, 0.2], [0.3, 0.4]], "times": [0.5, 1.5], "packed": pack(legs())}
    joint = describe(told_by(TeamPlan, legs(), np.array(0.75, F)), OWN)
    assert joint is not None and told is not None and joint["remaining"] == 0.75 and joint["points"] == told["points"]
    assert describe(told_by(Announcement, np.zeros((3, 2), F), np.full(3, np.inf, F)), OWN) is None


def test_a_target_and_messages_of_other_planners():
    target = np.array([0.5, 0.25], F)
    assert describe(target, OWN) == {"points": [[0.5, 0.25]], "packed": pack(target)}
    assert describe(np.full(2, np.nan, F), OWN) is None
    other = describe({"level": np.array([1.0, np.inf], F), "step": np.array(3, np.int32)}, OWN)
    assert other is not None and other["arrays"] == [[1.0, None], 3]
