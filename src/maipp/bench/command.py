"""What made a page of results: the command to type, the machines, the time."""

import shlex
from collections.abc import Mapping, Sequence
from typing import Any


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


def machines(*made: tuple[Mapping[str, Any], Mapping[str, str]]) -> str:
    """Machines and versions in words, each once."""
    words = [
        f"{machine['cpu']}, {_count(machine['cores'], 'core')}, JAX on {machine['backend']} "
        f"({_count(machine['devices'], 'device')}), {machine['precision']}, maipp {versions['maipp']}, "
        f"jax {versions['jax']}, Python {versions['python']}"
        for machine, versions in made
    ]
    return "; and on ".join(dict.fromkeys(words))


def made_on(*made: tuple[Mapping[str, Any], Mapping[str, str]]) -> str:
    """The line of machines and versions below a table."""
    return f"Made on {machines(*made)}."


def wall_time(seconds: float, what: str) -> str:
    """The line for what changes each time, set apart from the numbers that do not."""
    return f"*Wall time, which does not regenerate: {seconds / 60:.1f} minutes for {what}.*"


def device_time(seconds: float, what: str) -> str:
    """As `wall_time`, where seconds on several devices count several times."""
    minutes = f"{seconds / 60:.1f} minutes for {what}"
    return f"*Wall time times devices, which does not regenerate: {minutes}; on a CPU a device is a core.*"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number > 1)}"
