"""Log marginal likelihood of a Matern 3/2 kernel with its gradient, in float64 on the host.

The mean and the signal variance that fit best are known in closed form for given length scales and a given ratio of
noise to signal variance (Rasmussen & Williams 2006, Sec. 2.7 and 5.4.1; the ratio form e.g. in Santner et al. 2003,
Sec. 3.3), so that only these are searched for. NumPy, not JAX, since float64 there is a switch of the whole process.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import cholesky, eigh, solve_triangular
from scipy.linalg.lapack import dpotri  # pyright: ignore[reportAttributeAccessIssue]


class Likelihood(NamedTuple):
    """The likelihood for given length scales and ratio, with the mean and signal variance that maximise it."""

    value: float  # log marginal likelihood
    gradient: Float[np.ndarray, " p"]  # with respect to the log length scales and the log ratio
    mean: float
    mean_factor: float  # variance of the mean over the signal variance
    variance: float  # signal variance


def squared_differences(x: Float[np.ndarray, "n 2"], per_axis: bool) -> Float[np.ndarray, "k n n"]:
    """Squared distances between all points: one matrix, or with `per_axis` one along each axis."""
    along = np.stack([(column[:, None] - column[None, :]) ** 2 for column in x.T])
    return along if per_axis else along.sum(axis=0, keepdims=True)


def correlation(
    squared: Float[np.ndarray, "k n m"], scales: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, "n m"], Float[np.ndarray, "n m"], Float[np.ndarray, "k n m"]]:
    """Matern 3/2 correlations, `exp(-s)`, and the terms of s^2 = 3 sum(d^2 / l^2); d correlation / d log l is the
    product of the last two."""
    terms = squared * (3.0 / scales**2)[:, None, None]
    s = np.sqrt(terms.sum(axis=0))
    decay = np.exp(-s)
    return (1.0 + s) * decay, decay, terms


def profile_likelihood(
    parameters: Float[np.ndarray, " p"],
    squared: Float[np.ndarray, "k n n"],
    y: Float[np.ndarray, " n"],
    mean: float | None = None,
) -> Likelihood:
    """The likelihood at k log length scales and, last, the log ratio of noise to signal variance.

    `mean` fixes the mean; None takes the generalised least squares one.
    """
    count, ratio = len(y), float(np.exp(parameters[-1]))
    matrix, decay, terms = correlation(squared, np.exp(parameters[:-1]))
    matrix[np.diag_indices(count)] += ratio
    factor = cholesky(matrix, lower=True, overwrite_a=True, check_finite=False)
    whitened = solve_triangular(factor, np.stack([np.ones(count), y], axis=1), lower=True, check_finite=False)
    ones, values = whitened.T
    precision = float(ones @ ones)
    centre = float(ones @ values) / precision if mean is None else mean
    rest = values - centre * ones
    variance = float(rest @ rest) / count
    value = -0.5 * (count * (np.log(2 * np.pi * variance) + 1.0)) - np.log(np.diag(factor)).sum()
    alpha = solve_triangular(factor, rest, lower=True, trans=1, check_finite=False)
    inverse = np.tril(dpotri(factor, lower=1, overwrite_c=1)[0])
    gradient = np.empty(len(parameters))
    for axis, term in enumerate(terms):
        slope = decay * term  # symmetric with a diagonal of zeros: twice the lower half is the trace
        gradient[axis] = alpha @ (slope @ alpha) / (2 * variance) - np.einsum("ij,ij->", inverse, slope)
    gradient[-1] = 0.5 * ratio * (alpha @ alpha / variance - np.trace(inverse))
    return Likelihood(float(value), gradient, centre, 1.0 / precision, variance)


def best_ratio(
    log_scale: float,
    squared: Float[np.ndarray, "1 n n"],
    y: Float[np.ndarray, " n"],
    log_ratios: Float[np.ndarray, " g"],
    mean: float | None = None,
) -> tuple[float, float]:
    """The highest likelihood at one log length scale over these log ratios, and the ratio that has it.

    One eigendecomposition serves all ratios.
    """
    matrix = correlation(squared, np.exp(np.array([log_scale])))[0]
    eigenvalues, vectors = eigh(matrix, check_finite=False)
    ones, values = vectors.sum(axis=0), y @ vectors
    weights = np.maximum(eigenvalues, 0.0) + np.exp(log_ratios)[:, None]
    centre = (ones * values / weights).sum(axis=1) / (ones**2 / weights).sum(axis=1) if mean is None else mean
    rest = values - np.reshape(centre, (-1, 1)) * ones
    variance = (rest**2 / weights).mean(axis=1)
    likelihood = -0.5 * (len(y) * (np.log(2 * np.pi * variance) + 1.0) + np.log(weights).sum(axis=1))
    best = int(np.argmax(likelihood))
    return float(likelihood[best]), float(log_ratios[best])


def information(
    squared: Float[np.ndarray, "1 n n"], scale: float, variance: float, noise: float
) -> Float[np.ndarray, "3 3"]:
    """Fisher information of log length scale, log signal variance and log noise variance: `tr(K^-1 K_i K^-1 K_j) / 2`.

    Source: Mardia & Marshall 1984, "Maximum likelihood estimation of models for residual covariance".
    """
    matrix, decay, terms = correlation(squared, np.array([scale]))
    covariance = variance * matrix
    covariance[np.diag_indices(len(matrix))] += noise
    inverse = dpotri(cholesky(covariance, lower=True, overwrite_a=True, check_finite=False), lower=1)[0]
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
    of_noise = noise * inverse
    parts = [inverse @ (variance * decay * terms[0]), np.eye(len(matrix)) - of_noise, of_noise]
    return np.array([[0.5 * np.einsum("ij,ji->", a, b) for b in parts] for a in parts])
