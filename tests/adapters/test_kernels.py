"""Programs in few kernels: the same results, and the operations between two calls of LAPACK compiled as one."""

from importlib.metadata import version

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.adapters.kernels import OPTIONS, few_kernels

ROWS = 6


def program(x, which, empty, unread):
    """Cuts by LAPACK, scatters and loops that hold them; a branch, a key, and arguments that tell nothing."""
    gram = x @ x.T + jnp.eye(ROWS)
    tries = jax.lax.while_loop(lambda n: ~jnp.isfinite(jnp.linalg.cholesky(gram + n)).all(), lambda n: n + 1.0, 0.0)
    factor = jnp.linalg.cholesky(gram + tries)
    solved = jax.lax.linalg.triangular_solve(factor, x, left_side=True, lower=True)
    marked = solved.at[which].set(7.0)
    marked = jax.vmap(lambda row: jax.lax.fori_loop(0, 3, lambda i, r: r.at[i + which].max(row[i]), row))(marked)
    chosen = jax.lax.cond(which > 2, jnp.sin, jnp.cos, marked)
    noise = jax.random.uniform(jax.random.key(3), (ROWS,))
    dead = jnp.where(jnp.asarray(False), unread, chosen[:, 0] + noise)
    return {"sum": jnp.nansum(chosen), "most": jnp.argmax(dead), "same": x, "dead": dead, "empty": empty * 2}


def _entry(compiled):
    """The lines of the compiled program outside of what it calls."""
    return (compiled.as_text() or "").split("ENTRY")[1].splitlines()


def _fusions(lines):
    return sum(" fusion(" in line for line in lines)


@pytest.mark.skipif(
    jax.default_backend() != "cpu" or not version("jaxlib").startswith("0.10."),
    reason="elsewhere the program is as it was",
)
def test_results_are_the_same_and_what_can_be_is_one_kernel():
    x = np.random.default_rng(0).normal(size=(ROWS, ROWS)).astype(np.float32)
    given = x, np.int32(4), np.zeros((0, 2), np.float32), np.ones(ROWS, np.float32)
    compiled = jax.jit(few_kernels(program), compiler_options=OPTIONS).lower(*given).compile()
    plain = jax.jit(program)(*given)
    # Rounding: six rows, numbers of the order of one to ten.
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5), compiled(*given), plain)
    entry, before = (_entry(each) for each in (compiled, jax.jit(program).lower(*given).compile()))
    assert sum(" call(" in line and "xla_cpu_small_call" in line for line in entry) >= 2
    assert _fusions(entry) < _fusions(before)
