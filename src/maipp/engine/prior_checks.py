"""What is wrong with the samples that a mission is to be drawn with, before anything is computed from them."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from maipp.errors import InputError


def prior_arrays(prior: Any, noise: Any = None) -> dict[str, np.ndarray]:
    """The arrays `prior_x`, `prior_y` and, if given, `prior_noise` of a mission; empty where there are no samples.

    They lie on the host and have JAX's precision. Raises InputError for shapes that do not match, numbers that are not
    finite at that precision, and noise below 0.
    """
    if prior is None or not np.size(prior[1]):
        return {}
    x, y = (np.asarray(array, np.float64) for array in prior)
    if y.ndim != 1 or x.shape != (len(y), 2):
        raise InputError(f"prior: positions {x.shape} and values {y.shape} do not match; give (p, 2) and (p,)")
    arrays = {"prior_x": x, "prior_y": y}
    if noise is not None:
        variance = np.asarray(noise, np.float64)
        if variance.shape not in ((), y.shape):
            raise InputError(
                f"prior_noise: has shape {variance.shape}; give one number, or one for each of the {len(y)}"
            )
        if (variance < 0).any():
            raise InputError("prior_noise: goes below 0; it is the variance of a sample's noise")
        arrays["prior_noise"] = np.broadcast_to(variance, y.shape)
    return {name: _finite(name, array) for name, array in arrays.items()}


def _finite(name: str, array: np.ndarray) -> np.ndarray:
    """The array at JAX's precision, all of it finite."""
    with np.errstate(over="ignore"):  # told below, in words
        single = array.astype(jnp.result_type(float))
    wrong = np.argwhere(~np.isfinite(single))
    if len(wrong):
        raise InputError(f"{name}: sample {wrong[0][0]} is not a finite number; leave out samples without a value")
    return single
