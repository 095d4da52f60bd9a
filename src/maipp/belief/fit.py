"""A kernel from data: mean, length scale, signal and noise variance that make old samples most likely."""

import dataclasses
import math

import numpy as np
from jaxtyping import Array, Bool, Float

from maipp.belief.fit_samples import checked_samples, thinned
from maipp.belief.fit_search import Optimum, search, search_per_axis
from maipp.belief.fit_warnings import fit_warnings
from maipp.belief.kernel_fit import KernelFit
from maipp.belief.likelihood import information, squared_differences
from maipp.errors import InputError

MOST_SAMPLES = 2000  # a fit to more would take minutes; beyond, they are thinned

# Length scales per axis are a diagnostic: they are fitted to this many samples at most.
_DIAGNOSTIC_SAMPLES = 400

# Samples whose spread across a line is below this part of the one along it lie on the line.
_ON_A_LINE = 1e-3


def fit_kernel(
    x: Float[np.ndarray | Array, "n 2"],
    y: Float[np.ndarray | Array, " n"],
    *,
    mean: float | None = None,
    most: int = MOST_SAMPLES,
) -> KernelFit:
    """The kernel that maximises the log marginal likelihood of samples `y` at `x`.

    Both axes of `x` must have the same unit of length (metres, not degrees). The mean is the generalised least squares
    one unless `mean` fixes it. More than `most` samples are thinned by place (`belief/fit_samples.py`). Computes in
    float64 whatever JAX's precision. Raises InputError for samples that tell nothing: fewer than 5, in fewer than 5
    places, values all the same or not finite.
    Source: Rasmussen & Williams 2006, Sec. 5.4.1.
    """
    if mean is not None and not math.isfinite(mean):
        raise InputError(f"mean: {mean} is not a finite number; leave it out to have it fitted")
    samples = checked_samples(np.asarray(x), np.asarray(y), most)
    # Searched in units of the samples' own spread, so that no result depends on the units that they came in.
    size, level, spread = float(np.ptp(samples.x, axis=0).max()), float(samples.y.mean()), float(samples.y.std())
    at, values = (samples.x - samples.x.min(axis=0)) / size, (samples.y - level) / spread
    fixed = None if mean is None else (mean - level) / spread
    best = search(at, values, fixed)
    axes, gain = _per_axis(at, values, best, fixed)
    scale, ratio = (float(p) for p in np.exp(best.parameters))
    variance = best.likelihood.variance
    errors = _errors(at, best)
    fit = KernelFit(
        mean=level + spread * best.likelihood.mean if mean is None else mean,
        length_scale=size * scale,
        signal_variance=spread**2 * variance,
        noise_variance=spread**2 * ratio * variance,
        log_marginal_likelihood=best.likelihood.value - len(values) * math.log(spread),
        samples=len(values),
        samples_given=samples.given,
        mean_error=spread * math.sqrt(variance * best.likelihood.mean_factor) if mean is None else 0.0,
        length_scale_error=None if errors[0] is None else size * scale * errors[0],
        signal_variance_error=None if errors[1] is None else spread**2 * variance * errors[1],
        noise_variance_error=None if errors[2] is None else spread**2 * ratio * variance * errors[2],
        axis_length_scales=None if axes is None else (size * axes[0], size * axes[1]),
        anisotropy_gain=gain,
        on_bound=_on_bound(best),
        extent=size,
    )
    return dataclasses.replace(fit, warnings=fit_warnings(fit))


def _per_axis(
    x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], best: Optimum, mean: float | None
) -> tuple[tuple[float, float] | None, float | None]:
    """Length scales along x and y, and what they add to the log marginal likelihood; None for samples on a line."""
    spread = np.linalg.svd(x - x.mean(axis=0), compute_uv=False)
    if spread[1] < _ON_A_LINE * spread[0]:
        return None, None
    few = thinned(x, _DIAGNOSTIC_SAMPLES)
    isotropic = best if len(few) == len(x) else search(x[few], y[few], mean)
    found = search_per_axis(x[few], y[few], isotropic, mean)
    along_x, along_y, _ = (float(p) for p in np.exp(found.parameters))
    return (along_x, along_y), max(0.0, found.likelihood.value - isotropic.likelihood.value)


def _errors(x: Float[np.ndarray, "n 2"], best: Optimum) -> tuple[float | None, float | None, float | None]:
    """Standard errors of the logs of length scale, signal and noise variance; None on a bound."""
    scale, ratio = (float(p) for p in np.exp(best.parameters))
    variance = best.likelihood.variance
    known = information(squared_differences(x, per_axis=False), scale, variance, ratio * variance)
    bound = [low or high for low, high in zip(best.low, best.high, strict=True)]
    free = np.array([not bound[0], True, not bound[1]])
    errors = _inverse_roots(known, free)
    return errors[0], errors[1], errors[2]


def _inverse_roots(known: Float[np.ndarray, "p p"], free: Bool[np.ndarray, " p"]) -> list[float | None]:
    """Roots of the diagonal of the inverse information of the free parameters; None for the others."""
    found: list[float | None] = [None] * len(free)
    try:
        variances = np.diag(np.linalg.inv(known[np.ix_(free, free)]))
    except np.linalg.LinAlgError:
        return found
    for index, variance in zip(np.flatnonzero(free), variances, strict=True):
        if np.isfinite(variance) and variance > 0:
            found[index] = float(np.sqrt(variance))
    return found


def _on_bound(best: Optimum) -> tuple[str, ...]:
    names = ("length_scale", "noise")
    low = [f"{name}_low" for name, there in zip(names, best.low, strict=True) if there]
    high = [f"{name}_high" for name, there in zip(names, best.high, strict=True) if there]
    return tuple(low + high)
