"""`maipp fleet`: watch a fleet of robots on a page, or simulate one on this computer."""

import math

from maipp.cli.fleet_flags import FleetFlags
from maipp.errors import InputError

__all__ = ["FleetFlags", "run"]


def run(flags: FleetFlags) -> int:
    """Watch until it is told to end, or simulate until all robots are done."""
    _check(flags)
    if flags.simulate:
        from maipp.cli.fleet_simulate import simulate

        return simulate(flags)
    from maipp.cli.fleet_watch import watch

    return watch(flags)


def _check(flags: FleetFlags) -> None:
    """Raise `InputError` for flags that make no sense."""
    from maipp.seeds import check_seed

    if flags.seed is not None:
        check_seed(flags.seed, "--seed")
    if not flags.simulate and not flags.connect:
        raise InputError("give --simulate to run a fleet here, or --connect ADDRESS to watch one that is under way")
    if flags.simulate and (flags.connect or flags.keys or flags.epoch is not None):
        raise InputError("--simulate: talks within this computer only; leave out --connect, --keys and --epoch")
    if not (math.isfinite(flags.speedup) and flags.speedup > 0):
        raise InputError(f"--speedup: {flags.speedup} is no number of times; give one such as 60")
    if not 0 <= flags.loss < 1:
        raise InputError(f"--loss: {flags.loss} is no share; give a number from 0 to below 1")
    if flags.range is not None and not (math.isfinite(flags.range) and flags.range > 0):
        raise InputError(f"--range: {flags.range} is no distance; give one above 0")
