"""When the kernel is fitted anew under way, and to what: a function of the measurements that count, in their order."""

import hashlib
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Annotated, Any

import numpy as np

from maipp.belief.refit import FEWEST, Hyperparameters, HyperPrior, refit
from maipp.live.incremental_posterior import IncrementalPosterior
from maipp.live.scaled_measurement import ScaledMeasurement
from maipp.records import Length
from maipp.records.kinds import Finite

_GROWTH = 1.1  # from one fit to the next there are so many times as many measurements, or one more
# Where nothing is known of the mean and the deviation, the first so many values tell them until there is a fit.
_FIRST, _NORMAL = 8, 0.6745
_NEAR = 4.0  # they are near each other, and the field varies more than they do
_ANY = 1e6  # times the guess of the deviation: of the first two, any value will do


class Refits:
    """Fits, and remembers what was found, by what it was found from."""

    def __init__(self, prior: HyperPrior) -> None:
        self.prior = prior
        self.known: dict[str, Hyperparameters] = {}
        self.fresh: list[str] = []  # digests of those that are not yet in the journal

    def start(self, samples: Sequence[ScaledMeasurement]) -> Hyperparameters:
        """The kernel before the first fit to these samples, which are in the order of time."""
        guess = self.prior.guess
        if self.prior.level_known:
            return guess
        values = [*islice((sample.value for sample in samples if not sample.stray), _FIRST)]
        if len(values) < 3:
            factor, mean = _ANY, guess.mean
        else:
            mean = float(np.median(values))
            spread = float(np.median(np.abs(np.subtract(values, mean)))) / _NORMAL
            factor = max(_NEAR * spread / guess.std, self.prior.weight**0.5)
        return guess._replace(mean=mean, std=factor * guess.std, noise=factor**2 * guess.noise)

    @staticmethod
    def due(before: int, now: int) -> bool:
        """Whether measurements have become so many that the kernel is fitted anew."""
        return any(count in _COUNTS for count in range(before + 1, now + 1))

    def after(self, seen: IncrementalPosterior) -> Hyperparameters:
        """The kernel of what is seen."""
        count = seen.count
        x, y, factors = seen.x[:count], seen.y[:count], seen.factors[:count]
        digest = hashlib.sha256()
        for array in (x, y, factors, np.array(seen.kernel)):
            digest.update(np.ascontiguousarray(array, np.float64).tobytes())
        name = digest.hexdigest()[:32]
        if name not in self.known:
            self.known[name] = refit(x, y, self.prior, factors, seen.kernel)
            self.fresh.append(name)
        return self.known[name]


# By the digest of what it is of, mean, standard deviation, length scale, noise, aspect, direction, measurements.
_Fit = Annotated[tuple[Finite, ...], Length(len(Hyperparameters._fields), len(Hyperparameters._fields))]
Fits = dict[str, _Fit]


def written(refits: Refits | None) -> dict[str, Any]:
    """The fits that the journal does not yet hold, as a part of a record; they count as written from now on."""
    if refits is None or not refits.fresh:
        return {}
    fits = {name: list(refits.known[name]) for name in refits.fresh}
    refits.fresh.clear()
    return {"kernels": fits}


def take_up(refits: Refits | None, fits: Mapping[str, Any]) -> None:
    """Remember the fits of a record, so that they are not made again."""
    if refits is not None:
        for name, values in fits.items():
            kernel = Hyperparameters(*values)
            refits.known[name] = kernel._replace(measurements=int(kernel.measurements))


def _counts() -> frozenset[int]:
    counts = [FEWEST]
    while counts[-1] < 100_000:
        counts.append(max(counts[-1] + 1, int(counts[-1] * _GROWTH)))
    return frozenset(counts)


_COUNTS = _counts()
