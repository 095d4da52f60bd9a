"""No number that is not finite passes for a result."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from maipp.errors import InputError


def refuse_non_finite(numbers: Mapping[str, Any], name: Callable[[int], str]) -> None:
    """Raise InputError for the first entry (along the first axis) of the arrays that is not finite.

    `name` says which mission an entry is of; the error begins with that and names the array.
    """
    for key, array in numbers.items():
        array = np.atleast_1d(np.asarray(array))
        wrong = ~np.isfinite(array.reshape(len(array), -1)).all(axis=1)
        if wrong.any():
            entry = int(np.argmax(wrong))
            value = array[entry].reshape(-1)
            raise InputError(
                f"{name(entry)}: {key} is {value[~np.isfinite(value)][0]}, not a finite number: its field, prior "
                "samples or measurements hold such a number, or its belief cannot be computed at this precision "
                "(more noise or JAX_ENABLE_X64=1 helps)"
            )


def mission_number(first: int = 0) -> Callable[[int], str]:
    """How the missions of a batch that begins with number `first` are named."""
    return lambda index: f"mission {first + index}"


def instance_and_trial(trials: int, first: int = 0) -> Callable[[int], str]:
    """How missions are named that are `trials` to an instance, instance after instance."""
    return lambda index: "instance {}, trial {}".format(*divmod(first + index, trials))
