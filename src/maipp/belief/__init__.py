"""Gaussian-process belief: kernel, posterior, high-interest area."""

from maipp.belief.interest import Interest, mutual_information, rmse, to_rank, trace
from maipp.belief.kernel import KERNELS, Kernel, Matern12, Matern32, Matern52, SquaredExponential
from maipp.belief.posterior import Belief, condition, extend
from maipp.belief.prior_samples import PriorSamples
from maipp.belief.window import condition_near

__all__ = [
    "Belief",
    "Interest",
    "KERNELS",
    "Kernel",
    "Matern12",
    "Matern32",
    "Matern52",
    "PriorSamples",
    "SquaredExponential",
    "condition",
    "condition_near",
    "extend",
    "mutual_information",
    "rmse",
    "to_rank",
    "trace",
]
