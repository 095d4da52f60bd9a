"""What made a page of results: the command to type, the machines, the time."""

import dataclasses
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

Made = tuple[Mapping[str, Any], Mapping[str, str]]  # machine and versions


def footer(command: str, made: Sequence[Made], time: str) -> list[str]:
    """The last blocks of a page: the command, machines and versions, and what does not regenerate."""
    return [code(command), made_on(*made), time]


def command(name: str, out: str, flags: Mapping[str, Any], usual: Mapping[str, Any]) -> str:
    """What to type: the benchmark, its folder, and those flags, by their names, that are not as usual.

    Left out of `usual` is None.
    """
    typed = ["maipp", "benchmark", name, "--out", out]
    for flag, value in flags.items():
        if value == usual.get(flag):
            continue
        values = [] if value is True else value if isinstance(value, list | tuple) else [value]
        typed += [f"--{flag}", *(f"{each:g}" if isinstance(each, float) else str(each) for each in values)]
    return shlex.join(typed)


def flags_of(plan: Any, *of_scenario: str) -> dict[str, Any]:
    """The flags that ask for a plan, a dataclass with a scenario and rows; of the scenario these keys have flags."""
    own = {each.name: getattr(plan, each.name) for each in dataclasses.fields(plan)}
    scenario, rows = own.pop("scenario"), own.pop("rows")
    return own | {key: getattr(scenario, key) for key in of_scenario} | {"planners": [row.name for row in rows]}


def code(command: str) -> str:
    """A command as a block of a page."""
    return f"```sh\n{command}\n```"


def machines(*made: Made) -> str:
    """Machines and versions in words, each once."""
    words = [
        f"{machine['cpu']}, {_count(machine['cores'], 'core')}, JAX on {machine['backend']} "
        f"({_count(machine['devices'], 'device')}), {machine['precision']}, maipp {versions['maipp']}, "
        f"jax {versions['jax']}, Python {versions['python']}"
        for machine, versions in made
    ]
    return "; and on ".join(dict.fromkeys(words))


def made_on(*made: Made) -> str:
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
