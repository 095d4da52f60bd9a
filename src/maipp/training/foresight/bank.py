"""Routes to measure along: surveys of several planners, simulated once, kept on the disk part by part.

Each sample of the training measures a field of its own along one of these routes. So its places are independent of the
field, as those of a plan are given what is known, and few routes serve for any number of samples.
"""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine import Mission, draw_missions, run_missions
from maipp.errors import InputError
from maipp.files import atomic_path
from maipp.planners import make_planner
from maipp.scenario import Scenario
from maipp.training.config import TRAINING_SEEDS
from maipp.training.foresight.config import ForesightConfig
from maipp.typing import Array, Float, Int

FOLDER = "bank"

# Robots that a program has room for: small teams plan far ahead, large ones a few legs each.
_SMALL, _LARGE = 4, 10

# Share of the surveys without zones by planner and room; the planner of the foresight comes first.
_SHARES = (
    ("receding-horizon", _SMALL, 0.4),
    ("receding-horizon", _LARGE, 0.05),
    ("shared-greedy", _SMALL, 0.2),
    ("random", _SMALL, 0.1),
    ("lawnmower", _SMALL, 0.25),
)

# Share of the surveys whose length scale, threshold and team are those of the default scenario.
_USUAL = 0.5

# No-go zones: one in the middle, two at opposite sides, an irregular one.
_LAYOUTS = (
    (((0.35, 0.4), (0.65, 0.4), (0.65, 0.6), (0.35, 0.6)),),
    (((0.0, 0.5), (0.3, 0.5), (0.3, 0.75), (0.0, 0.75)), ((0.7, 0.2), (1.0, 0.2), (1.0, 0.45), (0.7, 0.45))),
    (((0.15, 0.1), (0.5, 0.2), (0.45, 0.45), (0.2, 0.4)),),
)


class Routes(NamedTuple):
    """Where the teams of r surveys measured, in the order of time; at most n measurements each, unit square."""

    x: Float[Array | np.ndarray, "r n 2"]
    count: Int[Array | np.ndarray, " r"]
    layout: Int[Array | np.ndarray, " r"]  # of no-go zones; 0: none
    length_scale: Float[Array | np.ndarray, " r"]  # of the beliefs that planned them, domain units


class _BankPart(NamedTuple):
    planner: str
    agents: int
    layout: int
    surveys: int


def parts(config: ForesightConfig) -> list[_BankPart]:
    """What the bank is made of."""
    room = {size: min(size, config.team[1]) for size in (_SMALL, _LARGE)}
    shares = [row for row in _SHARES if row[0] in config.planners and (row[1] == _SMALL or config.team[1] > _SMALL)]
    whole = sum(share for *_, share in shares)
    free = [
        _BankPart(name, room[size], 0, math.ceil(config.surveys * (1.0 - config.zoned) * share / whole))
        for name, size, share in shares
    ]
    # To plan among zones takes long to compile, and routes that bend around them are much alike.
    among = [
        "receding-horizon" if layout == 1 and "receding-horizon" in config.planners else "lawnmower"
        for layout in range(1, len(_LAYOUTS) + 1)
    ]
    each = math.ceil(config.surveys * config.zoned / len(_LAYOUTS))
    zoned = [_BankPart(name, room[_SMALL], layout, each) for layout, name in enumerate(among, 1)]
    return free + (zoned if config.zoned else [])


def make_bank(
    config: ForesightConfig,
    out: Path,
    tell: Callable[[str], None] = lambda text: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Routes | None:
    """The routes of this configuration; parts that are in the folder are read, the others simulated and written.

    None where `stopped` says so between two parts. Raises InputError for a part that cannot be read or written.
    """
    rows = []
    every = parts(config)
    for number, part in enumerate(every):
        path = out / FOLDER / f"{number:02d}.npz"
        if not path.exists():
            if stopped():
                return None
            tell(
                f"routes {number + 1} of {len(every)}: {part.surveys} of {part.planner}, room for {part.agents} robots"
            )
            _write(path, _simulated(config, number, part))
        rows.append(_read(path))
    return Routes(*(np.concatenate(arrays) for arrays in zip(*rows, strict=True)))


def _simulated(config: ForesightConfig, number: int, part: _BankPart) -> Routes:
    """The routes of one part: worlds whose numbers are drawn, surveyed by its planner."""
    rng = np.random.default_rng([config.seed, number])
    scenario = Scenario.create(
        agents=part.agents, budget=config.budget[1], obstacles=_LAYOUTS[part.layout - 1] if part.layout else ()
    )
    planner = make_planner(part.planner, scenario)
    seed = (TRAINING_SEEDS + config.seed + 7919 * number) % 2**32
    missions = draw_missions(scenario, seed=seed, instances=part.surveys, planner=planner)
    missions, scale = _varied(config, missions, rng, large=part.agents > _SMALL)
    states = run_missions(planner, missions, jax.random.key(seed))
    time = np.asarray(states.measurement_time).reshape(part.surveys, -1)
    x = np.asarray(states.measurement_x).reshape(part.surveys, -1, 2)
    order = np.argsort(time, axis=1, kind="stable")[:, : config.slots]
    taken = np.take_along_axis(np.isfinite(time), order, axis=1)
    x = np.where(taken[..., None], np.take_along_axis(x, order[..., None], axis=1), 0.0).astype(np.float32)
    short = config.slots - x.shape[1]
    x = np.pad(x, ((0, 0), (0, max(short, 0)), (0, 0)))
    return Routes(x, taken.sum(axis=1).astype(np.int32), np.full(len(x), part.layout, np.int32), scale)


def _varied(
    config: ForesightConfig, missions: Mission, rng: np.random.Generator, *, large: bool
) -> tuple[Mission, Float[np.ndarray, " r"]]:
    """The missions with numbers of their own, and the length scales among them."""
    count, room = missions.start.shape[:2]
    usual = rng.random(count) < _USUAL
    default = Scenario()

    def drawn(name: str) -> np.ndarray:
        low, high = getattr(config, name)
        return np.where(usual, getattr(default, name), rng.uniform(low, high, count)).astype(np.float32)

    least = min(max(config.team[0], _SMALL + 1 if large else 1), room)
    team = np.where(usual & (room == _SMALL), min(default.agents, room), rng.integers(least, room + 1, count))
    # Measurements beyond the slots would be left out.
    longest = np.maximum(config.slots * default.measurement_interval / team, config.budget[0])
    budget = rng.uniform(config.budget[0], np.minimum(config.budget[1], longest)).astype(np.float32)
    scale = drawn("length_scale")
    params = dataclasses.replace(
        missions.params,
        budgets=jnp.asarray(np.repeat(budget[:, None], room, axis=1)),
        present=jnp.asarray(np.arange(room) < team[:, None]),
        length_scale=jnp.asarray(scale),
        threshold=jnp.asarray(drawn("threshold")),
    )
    return dataclasses.replace(missions, params=params), scale


def _write(path: Path, routes: Routes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary, open(temporary, "wb") as file:
            np.savez_compressed(file, **routes._asdict())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error


def _read(path: Path) -> Routes:
    try:
        with np.load(path) as file:
            return Routes(*(file[name] for name in Routes._fields))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: not a part of a bank: {error}; remove it, and it is made anew") from None
