"""The Matern 3/2 covariance: against scikit-learn, and the flat top that gradients need."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern

from maipp.belief import KERNELS, Matern32

A = np.random.default_rng(0).uniform(-1.0, 2.0, (7, 2))
B = np.random.default_rng(1).uniform(-1.0, 2.0, (5, 2))
SCALES = st.floats(0.05, 5.0)


def per_axis(along_x, along_y, variance):
    """The kernel with a length scale along each axis."""
    mean = (along_x * along_y) ** 0.5
    return Matern32(jnp.asarray(mean), variance, jnp.diag(jnp.asarray([mean / along_x, mean / along_y])))


@given(st.one_of(SCALES, st.tuples(SCALES, SCALES)), st.floats(0.1, 10.0))
def test_matrix_is_that_of_scikit_learn(length_scale, variance):
    reference = ConstantKernel(variance) * Matern(length_scale, nu=1.5)
    with jax.enable_x64(True):
        isotropic = isinstance(length_scale, float)
        kernel = Matern32(length_scale, variance) if isotropic else per_axis(length_scale[0], length_scale[1], variance)
        matrix = kernel.matrix(jnp.asarray(A), jnp.asarray(B))
        np.testing.assert_allclose(matrix, reference(A, B), rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(kernel(jnp.asarray(A[:5]), jnp.asarray(B)), np.diagonal(reference(A[:5], B)))


REFERENCES = {
    "matern12": lambda scale: Matern(scale, nu=0.5),
    "matern32": lambda scale: Matern(scale, nu=1.5),
    "matern52": lambda scale: Matern(scale, nu=2.5),
    "squared-exponential": RBF,
}


@pytest.mark.parametrize("name", KERNELS)
@given(along_x=SCALES, along_y=SCALES)
def test_every_kernel_is_that_of_scikit_learn_along_both_axes(name, along_x, along_y):
    mean = (along_x * along_y) ** 0.5
    with jax.enable_x64(True):
        warp = jnp.diag(jnp.asarray([mean / along_x, mean / along_y]))
        matrix = KERNELS[name](jnp.asarray(mean), 2.0, warp).matrix(jnp.asarray(A), jnp.asarray(B))
        reference = 2.0 * REFERENCES[name]((along_x, along_y))(A, B)
        np.testing.assert_allclose(matrix, reference, rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize("name", KERNELS)
def test_what_a_correlation_falls_by_is_its_slope(name):
    kernel, distance = KERNELS[name], jnp.asarray([0.01, 0.3, 1.0, 4.0])
    with jax.enable_x64(True):
        slope = jax.vmap(jax.grad(kernel.correlation))(distance.astype(float))
        np.testing.assert_allclose(kernel.fall(distance.astype(float)), -slope / distance, rtol=1e-6)
    assert kernel.correlation(jnp.zeros(())) == 1.0 and np.isfinite(kernel.fall(jnp.zeros(())))


@pytest.mark.parametrize("kernel", [Matern32(0.45, 2.0), per_axis(0.3, 0.9, 2.0)])
def test_gradient_at_distance_zero_is_zero(kernel):
    """The covariance is smooth at its top: a measurement moved onto another one must not turn gradients into NaN."""
    here = jnp.array([0.3, 0.7])
    np.testing.assert_array_equal(jax.grad(lambda p: kernel(p, here))(here), 0.0)
    assert kernel(here, here) == 2.0


def test_a_place_that_is_not_a_number_is_nowhere():
    """It must not pass for the same place as every other."""
    places = jnp.array([[jnp.nan, 0.5], [0.5, 0.5]])
    np.testing.assert_array_equal(np.isnan(Matern32(0.45).matrix(places, places)), [[True, True], [True, False]])


def test_gradient_is_that_of_finite_differences():
    with jax.enable_x64(True):
        kernel = Matern32(0.45)
        there = jnp.array([0.2, 0.5])
        point, step = np.array([0.3, 0.7]), 1e-6
        slope = [
            (kernel(jnp.asarray(point + d), there) - kernel(jnp.asarray(point - d), there)) / (2 * step)
            for d in step * np.eye(2)
        ]
        np.testing.assert_allclose(jax.grad(lambda p: kernel(p, there))(jnp.asarray(point)), slope, rtol=1e-7)
