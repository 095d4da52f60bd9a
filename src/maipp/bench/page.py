"""What pages of results have in common: numbers with their errors, and the command and the machine that made them."""

import math
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maipp.bench.evaluate import summarise
from maipp.typing import Float

METRICS = {
    "trace": "Tr(P)",
    "own_trace": "Tr(P) of the agents' own beliefs",
    "true_trace": "Tr(P) over the true high-interest area",
    "rmse": "RMSE",
    "unspent": "budget left",
    "distance": "distance travelled",
    "decisions": "decisions",
}


def three(value: float) -> str:
    """Three significant digits."""
    return f"{value:#.3g}".rstrip(".")


def mean_and_error(mean: float, se: float | None) -> str:
    """`36.1 ± 1.2`: the error to two significant digits, the mean to the same place; three digits without an error."""
    if se is None or not se > 0:
        return three(mean)
    decimals = max(0, 1 - math.floor(math.log10(se)))
    return f"{mean:.{decimals}f} ± {se:.{decimals}f}"


def shown(values: Float[np.ndarray, "instances trials"]) -> str:
    """Mean and standard error over instances, of all values."""
    summary = summarise(values)
    return mean_and_error(summary.mean, summary.se)


def command(words: Sequence[str], flags: Mapping[str, Any], usual: Mapping[str, Any]) -> str:
    """What to type: the words, then those flags, by their names, that are not as usual; left out of `usual`: None."""
    typed = list(words)
    for name, value in flags.items():
        if value == usual.get(name):
            continue
        values = [] if value is True else value if isinstance(value, list | tuple) else [value]
        typed += [f"--{name}", *(f"{each:g}" if isinstance(each, float) else str(each) for each in values)]
    return shlex.join(typed)


def code(*lines: str) -> str:
    """Commands as a block of a page."""
    return "\n".join(["```sh", *lines, "```"])


def made_on(*made: tuple[Mapping[str, Any], Mapping[str, str]]) -> str:
    """Machines and versions in words, each once, for the line below a table."""
    words = [
        f"{machine['cpu']}, {_count(machine['cores'], 'core')}, JAX on {machine['backend']} "
        f"({_count(machine['devices'], 'device')}), {machine['precision']}, maipp {versions['maipp']}, "
        f"jax {versions['jax']}, Python {versions['python']}"
        for machine, versions in made
    ]
    return "; and on ".join(dict.fromkeys(words))


def wall_time(seconds: float, what: str) -> str:
    """The line for what changes each time, set apart from the numbers that do not."""
    return f"*Wall time, which does not regenerate: {seconds / 60:.1f} minutes for {what}.*"


def device_time(seconds: float, what: str) -> str:
    """As `wall_time`, where seconds on several devices count several times."""
    minutes = f"{seconds / 60:.1f} minutes for {what}"
    return f"*Wall time times devices, which does not regenerate: {minutes}; on a CPU a device is a core.*"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number > 1)}"
