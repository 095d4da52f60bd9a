"""The search over plans: it finds the lowest score, and never takes NaN for one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.planners.search.optimiser import Finalists, SearchOptions, search

OPTIONS = SearchOptions(candidates=64, elites=4, steps=10, rate=0.1, survivors=2)


@pytest.mark.parametrize("broken", [False, True])
def test_the_best_plan_has_the_lowest_score(broken):
    """The score is the distance from three headings of 0.3; with NaN for every plan that begins to the left."""

    def score(plans):
        far = jnp.sum((plans - 0.3) ** 2, axis=1)
        return jnp.where(broken & (jnp.cos(plans[:, 0]) < 0), jnp.nan, far)

    last = jnp.array([jnp.pi, 0.0, 0.0])  # a plan to the left competes, and others near it
    found = search(jax.random.key(0), last, score=score, final=score, options=OPTIONS)
    assert np.isnan(score(last[None])).all() == broken
    assert np.isfinite(found.values).all()
    assert float(score(found.best[None])[0]) == float(found.values.min()) < 0.5


def test_a_rough_score_chooses_and_the_score_has_the_last_word():
    """The rough one is least at 0.3, the score at 0.4: survivors leave what the rough one led them to."""
    seen = []

    def near(middle, name):
        def score(plans):
            seen.append((name, plans.shape[0]))
            return jnp.sum((plans - middle) ** 2, axis=1)

        return score

    score = near(0.4, "score")
    found = search(
        jax.random.key(0),
        jnp.zeros(3),
        score=score,
        final=near(0.4, "final"),
        rough=near(0.3, "rough"),
        options=OPTIONS,
    )
    # 64 candidates, 4 elites and the better half of them by the rough score, the survivors by the other; both forms of
    # these are finalists.
    assert {("rough", 64), ("rough", 4), ("rough", 2), ("score", 2), ("final", 4)} == set(seen)
    assert found.plans.shape == (4, 3)
    assert float(found.values.min()) < 0.01 and np.abs(found.best - 0.4).max() < 0.1


def test_a_search_that_only_meets_nan_gives_some_plan():
    found = search(
        jax.random.key(0),
        jnp.zeros(3),
        score=lambda plans: jnp.nan * plans[:, 0],
        final=lambda plans: jnp.nan * plans[:, 0],
        options=OPTIONS,
    )
    assert np.isfinite(found.best).all()


def test_a_finalist_of_nan_is_not_the_best():
    plans = jnp.arange(4.0)[:, None]
    assert Finalists(plans, jnp.array([3.0, jnp.nan, 1.0, 2.0])).best == 2.0
