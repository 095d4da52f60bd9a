"""Beliefs of one shape, drawn at random, and what they must be: shared so that each function compiles once."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st
from sklearn.gaussian_process.kernels import Matern

from maipp.belief import Matern32, condition, extend

SEEDS = st.integers(0, 2**32 - 1)
LENGTH_SCALE = 0.45
KERNEL = Matern32(LENGTH_SCALE)
SLOTS, NEW = 10, 4
QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 6)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)

# One shape for the whole module, so that each of these compiles once per precision.
condition_ = eqx.filter_jit(condition)
extend_ = eqx.filter_jit(extend)
on_ = eqx.filter_jit(lambda belief, points: belief.on(points))


def exact(x, y, query, noise):
    """The posterior in NumPy, by solving the normal equations: no Cholesky factor, no masks."""
    matern = Matern(LENGTH_SCALE, nu=1.5)
    cross = matern(x, query)
    weights = np.linalg.solve(matern(x, x) + noise * np.eye(len(x)), cross)
    return y @ weights, 1.0 - np.sum(cross * weights, axis=0)


def draw(seed):
    """Random slots: positions, values, mask, more positions and values."""
    rng = np.random.default_rng(seed)
    x, y, mask = rng.random((SLOTS, 2)), rng.normal(size=SLOTS), rng.random(SLOTS) < 0.6
    return rng, x, y, mask, rng.random((NEW, 2)), rng.normal(size=NEW)


def belief_of(x, y, mask, noise: float | jax.Array = 1e-6):
    """The belief at the precision JAX is in."""
    real = jnp.result_type(float)
    x, y, query = (jnp.asarray(a, real) for a in (x, y, QUERY))
    return condition_(KERNEL, x, y, jnp.asarray(mask), query, noise)
