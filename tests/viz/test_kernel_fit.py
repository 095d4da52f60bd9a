"""The picture of a fit shows the samples' variogram, the kernel's, and the likelihood over the length scale."""

import jax.numpy as jnp
import numpy as np
import pytest

from maipp.belief.fit import fit_kernel
from maipp.belief.fit_profile import likelihood_profile
from maipp.belief.variogram import empirical_variogram
from maipp.errors import InputError
from maipp.viz.kernel_fit import draw_kernel_fit, fitted_variogram
from maipp.viz.style import save_figure

RNG = np.random.default_rng(0)
X = RNG.uniform(0, 900, size=(60, 2))
Y = 12 + np.sin(X[:, 0] / 150) + 0.2 * RNG.normal(size=60)
FIT = fit_kernel(X, Y)


def drawn(axes, label=None):
    return [np.asarray(line.get_xydata()) for line in axes.lines if label in (None, line.get_label())]


def test_samples_and_kernel_are_drawn():
    figure = draw_kernel_fit(FIT, X, Y, length_unit="m", unit="ug/L", dpi=40)
    variogram, profile = figure.axes
    found = empirical_variogram(X, Y)
    (points,) = drawn(variogram, "samples (number of pairs)")
    np.testing.assert_allclose(points, np.stack([found.distance, found.semivariance], axis=1))
    assert [text.get_text() for text in variogram.texts] == [f"{pairs:,}" for pairs in found.pairs]
    (line,) = drawn(variogram, "fitted kernel")
    np.testing.assert_allclose(line[:, 1], fitted_variogram(FIT, line[:, 0]))
    assert variogram.get_xlabel() == "distance, m" and "(ug/L)²" in variogram.get_ylabel()
    expected = likelihood_profile(X, Y, also=FIT.length_scale)
    np.testing.assert_allclose(drawn(profile)[0], np.stack(expected[:2], axis=1))
    assert any((line[:, 0] == FIT.length_scale).all() for line in drawn(profile, "fitted length scale"))
    words = " ".join(text.get_text() for text in figure.texts)
    assert (
        "60 samples" in words
        and f"length scale {FIT.length_scale:.0f} ± 130 m" in words
        and f"mean {FIT.mean:.3g}" in words
    )


def test_the_kernel_s_variogram_is_that_of_its_covariance():
    distance = np.array([0.0, 50.0, 1e6])
    at = jnp.asarray(np.stack([distance, np.zeros(3)], axis=1), jnp.float32)
    covariance = np.asarray(FIT.kernel(at, jnp.zeros((1, 2), jnp.float32)))
    expected = FIT.noise_variance + FIT.signal_variance - covariance
    np.testing.assert_allclose(fitted_variogram(FIT, distance), expected, rtol=1e-4, atol=1e-5)


def test_warnings_stand_below():
    few = fit_kernel(X[:8], Y[:8])
    figure = draw_kernel_fit(few, X[:8], Y[:8], dpi=40)
    words = " ".join(text.get_text() for text in figure.texts)
    assert few.warnings and all(warning.split(";")[0] in words for warning in few.warnings)


def test_it_is_written_whole_or_told(tmp_path):
    figure = draw_kernel_fit(FIT, X, Y)
    save_figure(figure, tmp_path / "fit.png")
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError, match="cannot be written"):
        save_figure(figure, tmp_path / "none" / "fit.png")
