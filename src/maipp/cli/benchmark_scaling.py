"""`maipp benchmark scaling`: time and memory of one decision against the size of the survey, and the belief's error."""

import itertools
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from maipp.bench.belief_error import COUNTS, INTERVALS, LENGTH_SCALES, BeliefError, belief_error
from maipp.bench.scaling import (
    AXES,
    BASE,
    LARGEST,
    PLANNERS,
    Cost,
    add_missing,
    measure,
    points,
    read_json,
    write_json,
    write_report,
)
from maipp.cli.notes import notes_console
from maipp.errors import InputError
from maipp.files import make_folder
from maipp.planners import planner_options
from maipp.seeds import check_seed

# What --quick keeps of every axis, and how large the largest survey is then.
_QUICK_AXES = {axis: values[:2] for axis, values in AXES.items()}
_QUICK_LARGEST = LARGEST | {"agents": 20, "measurements": 1000}


@dataclass(frozen=True)
class ScalingFlags:
    """Time one decision, at batch 1, against agents, measurements, grid and nodes, and measure the belief's error.

    An interrupted run goes on where it was if it is started again with the same flags.
    """

    out: Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
    """folder for scaling.json, scaling.csv, errors.csv, scaling.md and scaling.png"""

    planner: Annotated[tuple[str, ...], tyro.conf.arg(metavar="PLANNER [PLANNER ...]", help_behavior_hint="")] = (
        PLANNERS
    )
    """planners to time"""

    capacity: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """measurements that a decision's look-ahead is conditioned on; left out: the scenario's default"""

    length_scale: Annotated[float, tyro.conf.arg(metavar="LENGTH")] = 0.25
    """length scale of the belief's kernel where decisions are timed, domain units"""

    decisions: Annotated[int, tyro.conf.arg(metavar="INT")] = 30
    """decisions timed at each size"""

    surveys: Annotated[int, tyro.conf.arg(metavar="INT")] = 5
    """surveys of each kind that the belief's error is measured on; 0: none"""

    seed: Annotated[int, tyro.conf.arg(metavar="INT")] = 0
    """seed of the surveys and the planners"""

    quick: bool = False
    """only the two smallest sizes of each axis, a survey of 1,000 measurements as the largest"""


def run(flags: ScalingFlags) -> int:
    """Measure, write the files, print where; raises `InputError` for a bad flag or a folder that cannot be written."""
    _check(flags)
    make_folder(flags.out)
    import jax

    kept = jax.config.jax_enable_compilation_cache  # pyright: ignore[reportAttributeAccessIssue]
    # A compiled decision read back from disk would have no compile time.
    jax.config.update("jax_enable_compilation_cache", False)
    try:
        _measure(flags)
    finally:
        jax.config.update("jax_enable_compilation_cache", kept)
    return 0


def _measure(flags: ScalingFlags) -> None:
    """Measure what is not done yet, and write the files."""
    notes = notes_console()
    settings = {key: value for key, value in vars(flags).items() if key != "out"}
    settings["planner"] = list(flags.planner)
    results = read_json(flags.out, settings)
    common = {"capacity": flags.capacity, "seed": flags.seed}

    def costed(cost: Cost) -> None:
        write_json(results, flags.out)
        size = f"{cost.agents} agents, {cost.measurements} measurements, grid {cost.grid}, {cost.nodes} nodes"
        notes.print(f"{cost.planner}: {size}: {cost.decision_ms:.1f} ms, {cost.memory_mb:.1f} MB", style="dim")

    def erred(error: BeliefError) -> None:
        write_json(results, flags.out)
        kind = f"{error.measurements} measurements, interval {error.interval:g}, length scale {error.length_scale:g}"
        notes.print(f"error of Tr(P): {kind}: {100 * error.error:.3f} %", style="dim")

    sizes = (_QUICK_AXES, BASE, _QUICK_LARGEST) if flags.quick else (AXES, BASE, LARGEST)
    cost = partial(measure, length_scale=flags.length_scale, least=flags.decisions, **common)
    add_missing(results.costs, points(flags.planner, *sizes), cost, costed)
    if flags.surveys:
        kinds = itertools.product(COUNTS[:1] if flags.quick else COUNTS, INTERVALS, LENGTH_SCALES)
        add_missing(results.errors, kinds, partial(belief_error, surveys=flags.surveys, **common), erred)
    for path in write_report(results, flags.out):
        notes.print(f"wrote {path}")


def _check(flags: ScalingFlags) -> None:
    """Raise `InputError` for what is wrong with the flags, before any work."""
    if not flags.planner:
        raise InputError(f"--planner: none given; give one or more, such as {' '.join(PLANNERS)}")
    for name in flags.planner:
        planner_options(name)  # raises for an unknown name
    for flag, value, least in (("decisions", flags.decisions, 1), ("surveys", flags.surveys, 0)):
        if value < least:
            raise InputError(f"--{flag}: {value} is too few; give a whole number >= {least}")
    check_seed(flags.seed, "--seed")
    if flags.capacity is not None and flags.capacity < 1:
        raise InputError(f"--capacity: {flags.capacity} is too few; give a whole number >= 1")
    if not 0 < flags.length_scale < float("inf"):
        raise InputError(f"--length-scale: {flags.length_scale} is no length; give a number > 0")
    if flags.out.exists() and not flags.out.is_dir():
        raise InputError(f"--out: {flags.out} is a file; give a folder")
