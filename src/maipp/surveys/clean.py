"""Old samples fit to be planned with: repeats merged, what cannot belong to the field left out and named."""

from typing import Any, NamedTuple

import numpy as np

from maipp.belief.fit_samples import FEWEST, thinned
from maipp.belief.outliers import spikes, surprises
from maipp.fields.readings import told_lines
from maipp.typing import Float, Int

_SAME_PLACE = 1e-3  # metres
# Standard deviations from what the others lead to expect beyond which a sample is left out: two in a billion of
# Gaussian ones, 1 in 950 with the tails of Student's t with 4 degrees of freedom.
_BEYOND = 6.0
_ROUNDS = 4  # of fitting and leaving out
_MOST = 1000  # samples whose surprises are computed at once: a matrix of this size


class Cleaned(NamedTuple):
    """Samples, one a place, and the lines of the file that each began with."""

    x: Float[np.ndarray, "p 2"]  # metres
    y: Float[np.ndarray, " p"]  # values in the unit
    lines: Int[np.ndarray, " p"]
    notes: list[str]


def merged(x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], lines: Int[np.ndarray, " n"]) -> Cleaned:
    """One sample for each place, with the mean of its values: a receiver that stands still repeats its position."""
    _, first, inverse, counts = np.unique(
        np.round(x / _SAME_PLACE), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    if len(first) == len(y):
        return Cleaned(x, y, lines, [])
    values = np.bincount(inverse.ravel(), weights=y) / counts
    order = np.argsort(first)
    note = f"{len(y) - len(first)} of {len(y)} lines repeat a place; each of the {len(first)} places counts once"
    return Cleaned(x[first][order], values[order], lines[first][order], [note])


def without_spikes(samples: Cleaned) -> Cleaned:
    """The samples without those far off all their neighbours."""
    return _without(samples, spikes(samples.x, samples.y), "far off all values nearby")


def fitted(samples: Cleaned, fit: Any) -> tuple[Cleaned, Any]:
    """The samples without those that the others contradict, and the kernel that `fit` gives of the rest."""
    found = fit(samples.x, samples.y)
    for _ in range(_ROUNDS):
        few = thinned(samples.x, _MOST)
        away = np.zeros(len(samples.y))
        away[few] = np.abs(surprises(samples.x[few], samples.y[few], found))
        far = away > _BEYOND
        if not far.any() or (~far).sum() < FEWEST:
            break
        # A bad sample makes its neighbours look bad: those half as far wait for the next fit.
        samples = _without(samples, away > max(_BEYOND, away.max() / 2), "that the others contradict")
        found = fit(samples.x, samples.y)
    return samples, found


def _without(samples: Cleaned, far: np.ndarray, why: str) -> Cleaned:
    """The samples but those `far`, which are told; all where too few would be left."""
    if not far.any() or (~far).sum() < FEWEST:
        return samples
    held = ", ".join(f"{each:.4g}" for each in samples.y[far][:5])
    note = f"{told_lines(samples.lines[far].tolist())} with {held}, {why}; left out"
    return Cleaned(samples.x[~far], samples.y[~far], samples.lines[~far], [*samples.notes, note])
