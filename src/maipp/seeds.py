"""Seeds: one range for everything that is random."""

import operator

from maipp.errors import InputError

# At JAX's default precision a key holds 32 bits of its seed: beyond, two seeds would draw the same worlds.
LARGEST_SEED = 2**32 - 1


def check_seed(seed: object, where: str = "seed") -> int:
    """The seed as a Python integer. Raises `InputError`, which begins with `where`, for what is none."""
    try:
        number = -1 if isinstance(seed, bool) else operator.index(seed)  # type: ignore[arg-type]  # tried
    except TypeError:
        number = -1
    if not 0 <= number <= LARGEST_SEED:
        raise InputError(f"{where}: {seed} is no seed; give a whole number from 0 to {LARGEST_SEED}")
    return number
