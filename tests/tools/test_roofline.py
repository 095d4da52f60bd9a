"""The count of operations: products by their sizes, loops as often as they run, nothing of what no result needs."""

import jax
import jax.numpy as jnp
import pytest
from jax import lax

from tests.tools.roofline import operations


def test_a_product_in_a_loop_counts_as_often_as_the_loop_runs():
    a, b = jnp.ones((3, 4)), jnp.ones((4, 4))

    def seven(a, b):
        return lax.scan(lambda carry, _: (carry @ b, None), a, length=7)[0]

    assert operations(seven, a, b) == 7 * 2 * 3 * 4 * 4
    assert operations(jax.jit(seven), a, b) == 7 * 2 * 3 * 4 * 4


def test_what_no_result_needs_is_not_counted():
    a = jnp.ones((5, 5))
    assert operations(lambda a: (a @ a, a + 1.0)[1], a) == 25


def test_a_factor_takes_a_third_of_the_cube_and_a_solution_its_square():
    a, b = jnp.eye(300), jnp.ones((300, 2))
    factored = operations(lambda a: lax.linalg.cholesky(a, symmetrize_input=False), a)
    assert factored == pytest.approx(300**3 / 3, rel=0.05)  # and the zeros above the diagonal
    assert operations(lambda a, b: lax.linalg.triangular_solve(a, b, left_side=True, lower=True), a, b) == 300**2 * 2
