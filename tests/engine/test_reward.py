"""What decisions are worth: by hand, by the sum, and alike inside and outside of compiled code."""

import math
from typing import Any, get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.engine.reward import RewardKind, final_reward, reward

traces = st.floats(0, 1e4, width=32)


def test_the_paper_s_reward_is_the_relative_drop_and_a_price_for_the_rest():
    # Yang et al. 2023, Sec. IV-C: r_t = (Tr(P_t-1) - Tr(P_t)) / Tr(P_t-1), r_f = -0.02 Tr(P_f).
    assert float(reward("paper", 80.0, 60.0)) == 0.25
    assert float(reward("paper", 60.0, 80.0)) == pytest.approx(-1 / 3)
    assert float(final_reward("paper", 60.0)) == pytest.approx(-1.2)


@given(seen=st.lists(st.floats(2**-9, 1e4, width=32), min_size=2, max_size=20))
def test_drops_of_the_logarithm_sum_to_that_of_the_mission(seen):
    total = sum(float(reward("log-trace", a, b)) for a, b in zip(seen, seen[1:], strict=False))
    total += float(final_reward("log-trace", seen[-1]))
    assert total == pytest.approx(math.log(seen[0]) - math.log(seen[-1]), abs=1e-4)


@pytest.mark.parametrize("kind", get_args(RewardKind))
def test_what_is_left_of_nothing_is_worth_nothing(kind):
    assert float(reward(kind, 0.0, 0.0)) == 0.0 and float(final_reward(kind, 0.0)) == 0.0
    assert abs(float(reward(kind, 1e-6, 5e-4))) < 1.0


@pytest.mark.parametrize("kind", get_args(RewardKind))
@given(before=st.lists(traces, min_size=3, max_size=3), after=st.lists(traces, min_size=3, max_size=3))
def test_arrays_floats_and_compiled_code_agree(kind, before, after):
    compiled: Any = jax.jit(lambda a, b: (reward(kind, a, b), final_reward(kind, b)))
    gains, finals = compiled(jnp.asarray(before), jnp.asarray(after))
    assert gains.shape == finals.shape == (3,)
    np.testing.assert_allclose(gains, [reward(kind, a, b) for a, b in zip(before, after, strict=True)], rtol=1e-5)
    np.testing.assert_allclose(finals, [final_reward(kind, b) for b in after], rtol=1e-6)
