"""The area found: recall and precision by their definitions, of batches and of records."""

import dataclasses
from typing import Any

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import precision_score, recall_score

from maipp.engine import draw_missions, run_missions
from maipp.engine.area_found import area_found, found_by
from maipp.engine.episode import Episode
from maipp.planners.random_walk import RandomWalk
from maipp.scenario import Scenario

WALL = ((0.4, 0.2), (0.6, 0.2), (0.6, 0.6), (0.4, 0.6))
SCENARIO = Scenario.create(agents=2, budget=1.0, grid=8, nodes=20, neighbours=5, threshold=0.3, obstacles=(WALL,))
VACUOUS: dict[str, Any] = {"zero_division": 1.0}


@pytest.fixture(scope="module")
def finished():
    prior = np.array([[0.0, 1.0], [0.7, 0.7], [0.9, 0.1]]), np.array([0.1, 0.6, 0.2])  # the first on the grid
    missions = draw_missions(SCENARIO, seed=5, instances=3, prior=prior)
    return missions, run_missions(RandomWalk(SCENARIO), missions, jax.random.key(5))


@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.floats(0, 1))
def test_shares_are_scikit_learn_s(seed, likely, guessed):
    rng = np.random.default_rng(seed)
    true, predicted = rng.random(30) < likely, rng.random((4, 30)) < guessed
    inside = rng.random(30) < 0.8
    found = area_found(true, predicted, inside)
    for row in range(4):
        pair = true[inside], predicted[row, inside]
        assert found.recall[row] == pytest.approx(recall_score(*pair, **VACUOUS))
        assert found.precision[row] == pytest.approx(precision_score(*pair, **VACUOUS))
        count = max(inside.sum(), 1)
        assert found.true[row] == pytest.approx(pair[0].sum() / count)
        assert found.predicted[row] == pytest.approx(pair[1].sum() / count)


def test_where_there_is_nothing_nothing_is_missed():
    nothing = np.zeros(5, bool)
    found = area_found(nothing, nothing, nothing)
    assert (found.true, found.predicted, found.both) == (0, 0, 0)
    assert found.recall == found.precision == 1.0
    assert area_found(nothing, ~nothing, ~nothing).precision == 0.0
    assert area_found(~nothing, nothing, ~nothing).recall == 0.0


@pytest.mark.parametrize("rule", ["bound", "mean"])
def test_a_survey_has_found_what_its_record_says(finished, rule):
    for index in range(3):
        episode = Episode.from_state(SCENARIO, "random", {}, 5, *finished, index=index)
        found = found_by(episode, rule=rule)
        assert found.recall.shape == (1,)
        belief = episode.beliefs(np.array([np.inf]))
        high = belief.mean[0] + (np.sqrt(belief.variance[0]) if rule == "bound" else 0.0) >= 0.3
        true = episode.truth >= 0.3
        assert 0 < (high & episode.inside).sum() < episode.inside.sum()
        assert found.recall[0] == pytest.approx(recall_score(true[episode.inside], high[episode.inside]))


def test_in_the_beginning_everything_may_be_of_interest(finished):
    episode = Episode.from_state(SCENARIO, "random", {}, 5, *finished)
    found = found_by(dataclasses.replace(episode, prior=None), np.array([0.0, np.inf]))
    assert found.predicted[0] == found.recall[0] == 1.0
    assert found.precision[0] == pytest.approx(found.true[0]) and found.predicted[1] < 1.0
    assert found_by(episode, np.array([0.0])).predicted[0] < 1.0  # the samples rule something out
