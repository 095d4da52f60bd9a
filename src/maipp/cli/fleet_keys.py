"""`maipp fleet keys DIR --robots NAME ...`: keys for a fleet that talks over a network that others use too."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from maipp.errors import InputError

_NAMES = tyro.conf.arg(metavar="NAME [NAME ...]")


@dataclass(frozen=True)
class FleetKeysFlags:
    """Make keys for the robots of a fleet: a folder for each, and the authority that vouches for them.

    With a folder that has an authority already, robots are added to its fleet (docs/fleet-network.md).
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
    """folder for all keys; keep it at home"""

    robots: Annotated[tuple[str, ...], _NAMES] = ()
    """names of robots, as in the mission file"""

    watchers: Annotated[tuple[str, ...], _NAMES] = ()
    """names of computers that only watch, such as shore"""

    address: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=HOST [NAME=HOST ...]")] = ()
    """where each is found by others, beside NAME and NAME.local: an IP address or a host's name"""

    days: Annotated[int, tyro.conf.arg(metavar="INT")] = 365
    """for how long certificates hold"""


def run(flags: FleetKeysFlags) -> int:
    """Make the keys, and say what goes where."""
    from maipp.fleet.key_folders import HOME, make_keys

    made = make_keys(flags.folder, flags.robots, flags.watchers, _addresses(flags.address), flags.days)
    for folder in made.folders:
        print(f"{folder}: copy it onto {folder.name}, and onto no other")
    if made.older:
        names = ", ".join(folder.name for folder in made.folders)
        print(f"{', '.join(made.older)}: copy peers/ anew onto each; until then nothing of {names} is accepted there")
    state = "made" if made.authority else "used"
    print(f"{flags.folder / HOME}: {state}; whoever has its ca.key can join the fleet: keep it off the boats")
    return 0


def _addresses(given: tuple[str, ...]) -> dict[str, list[str]]:
    addresses: dict[str, list[str]] = {}
    for text in given:
        name, equals, host = text.partition("=")
        if not (name and equals and host):
            raise InputError(f"--address: {text!r:.80} is not NAME=HOST, such as boat-1=192.168.1.12")
        addresses.setdefault(name, []).append(host)
    return addresses
