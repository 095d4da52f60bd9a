"""Ground-truth fields: callables from points (n, 2) to values (n,)."""

from maipp.fields.mixture import GaussianMixture, evaluation_grid, sample_mixture

__all__ = ["GaussianMixture", "evaluation_grid", "sample_mixture"]
