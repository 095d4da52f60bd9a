"""The search over plans: it finds the lowest score, and never takes NaN for one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.planners.search.optimiser import Finalists, SearchOptions, search

OPTIONS = SearchOptions(candidates=64, elites=4, steps=10, rate=0.1)


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
