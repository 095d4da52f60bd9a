"""The world of one survey, drawn from a scenario: field, starts, roadmaps, and what was measured there before."""

import dataclasses
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import PriorSamples
from maipp.engine.decision import Planner
from maipp.engine.prior_checks import prior_arrays
from maipp.engine.rows import pick
from maipp.errors import InputError
from maipp.fields.mixture import evaluation_grid, sample_mixture
from maipp.fields.user_fields import as_field
from maipp.kept import kept
from maipp.problem import Params, Problem, Shape, params_of, shape_of
from maipp.roadmap import Home, Obstacles, Roadmap, home_of, laplacian_encoding, lengths_home, sample_roadmaps
from maipp.scenario import Scenario
from maipp.seeds import check_seed
from maipp.typing import Array, Bool, Float, Index, Key, Keys, UInt

Field = Callable[[Float[Array, "n 2"]], Float[Array, " n"]]


class Mission(eqx.Module):
    """One drawn world. A batch of missions is the same pytree with a leading axis on every array."""

    shape: Shape = eqx.field(static=True)  # of all that is compiled for it
    params: Params  # its numbers
    field: Any  # a `Field` that is a pytree: the ground truth, callable on points
    grid: Float[Array, "*b q 2"]  # evaluation grid, domain units
    truth: Float[Array, "*b q"]  # the field on the grid, normalised units
    inside: Bool[Array, "*b q"]  # grid points of the survey area: False within no-go zones
    start: Float[Array, "*b m 2"]  # where each agent begins, domain units
    roadmap: Roadmap | None  # arrays (*b, m, n, ...), or None where the planner needs no roadmap
    home: Home | None = None  # where each agent ends; None: anywhere
    # Samples taken before the survey, which every belief is conditioned on; None where there are none.
    prior_x: Float[Array, "*b p 2"] | None = None  # positions, domain units
    prior_y: Float[Array, "*b p"] | None = None  # values, standardised
    prior_noise: Float[Array, "*b p"] | None = None  # noise variance of each; None: that of the scenario

    @property
    def problem(self) -> Problem:
        """Shape and numbers, under the scenario's names."""
        return Problem(self.shape, self.params)

    def home_of(self, agent: Index) -> Home | None:
        """Where one agent of one mission ends; None: anywhere."""
        if self.home is None:
            return None
        return Home(jax.tree.map(lambda array: pick(array, agent), self.home.ends), self.home.borders)

    @property
    def prior(self) -> PriorSamples | None:
        """The prior samples; arrays of a batch have its leading axis."""
        if self.prior_x is None or self.prior_y is None:
            return None
        return PriorSamples(self.prior_x, self.prior_y, self.prior_noise)


# Uniform draws for a start; the first outside the no-go zones is taken.
_START_DRAWS = 256


def _instance_keys(key: Key, first: Index, instances: int) -> Keys:
    """One key per instance; instance i of a seed is the same world whatever the number of instances."""
    return jax.vmap(partial(jax.random.fold_in, key))(first + jnp.arange(instances))


@kept
def _draw_worlds(
    seed: UInt[Array, ""],
    first: Index,
    field: Any,
    extent: Float[Array, "2"],
    variance: Float[Array, "2"],
    *,
    points: int,
    components: tuple[int, int],
    instances: int,
) -> tuple[Array, Any, Array, Array]:
    """Grid, ground truths as functions and on the grid, and draws to take the start from, in one compilation."""
    grid = evaluation_grid(points, extent)

    def world(key: Key) -> tuple[Any, Array, Array]:
        truth = field
        if truth is None:
            truth = sample_mixture(
                jax.random.fold_in(key, 0), components=components, variance=variance, extent=extent, grid=grid
            )
        return truth, truth(grid), jax.random.uniform(jax.random.fold_in(key, 1), (_START_DRAWS, 2))

    return grid, *jax.vmap(world)(_instance_keys(jax.random.key(seed), first, instances))


def _free_start(
    draws: Float[np.ndarray, "d 2"], scenario: Scenario, obstacles: Obstacles | None
) -> Float[np.ndarray, "2"]:
    """The first uniform draw outside the no-go zones."""
    if obstacles is None:
        return draws[0] * np.asarray(scenario.extent)
    points = draws * np.asarray(scenario.extent)
    free = obstacles.free(points)
    if not free.any():
        raise InputError(
            f"obstacles: no room to start from ({len(points)} uniform draws fell inside); give a start, or cover less"
        )
    return points[int(np.argmax(free))]


def draw_missions(
    scenario: Scenario,
    *,
    seed: int,
    instances: int,
    first: int = 0,
    trials: int = 1,
    planner: Planner | None = None,
    roadmaps: bool = True,
    encodings: int = 0,
    field: Any = None,
    prior: tuple[Float[Array | np.ndarray, "p 2"], Float[Array | np.ndarray, " p"]] | None = None,
    prior_noise: float | Float[Array | np.ndarray, " p"] | None = None,
    shape: Shape | None = None,
) -> Mission:
    """A batch of `instances * trials` missions, instance slowest, from instance `first` on.

    The instance fixes field and start; the trial only draws fresh roadmaps (and the planner's own randomness), so all
    planners meet the same worlds. What `planner` needs is drawn; without one, `roadmaps` that carry a spectral encoding
    of `encodings` columns (`Planner.encoding_dimensions`). `field` replaces the random mixture by a given ground truth:
    a pytree, or a plain function of points (n, 2) to values (n,), see `as_field`. `prior` are positions (domain units)
    and standardised values of samples taken before the survey, the same in every mission: whatever the team believes is
    conditioned on them. They may lie anywhere and on top of each other; none at all is the same as None. `prior_noise`
    is their noise variance, for each or for all, in place of the scenario's. `shape` is the scenario's own, or one that
    it shares with others (`shape_of`).
    Raises InputError for a seed out of range, where obstacles leave no room, and for prior samples that are not finite
    or do not match.
    """
    parts = mission_parts(
        scenario,
        seed=seed,
        instances=instances,
        first=first,
        trials=trials,
        planner=planner,
        roadmaps=roadmaps,
        encodings=encodings,
        field=field,
        prior=prior,
        prior_noise=prior_noise,
    )
    # All at once: array by array takes longer than to draw them.
    return Mission(shape=shape or shape_of(scenario), **jax.device_put(parts))


def mission_parts(
    scenario: Scenario,
    *,
    seed: int,
    instances: int,
    first: int = 0,
    trials: int = 1,
    planner: Planner | None = None,
    roadmaps: bool = True,
    encodings: int = 0,
    field: Any = None,
    prior: tuple[Float[Array | np.ndarray, "p 2"], Float[Array | np.ndarray, " p"]] | None = None,
    prior_noise: float | Float[Array | np.ndarray, " p"] | None = None,
) -> dict[str, Any]:
    """The arrays of the same, all but the shape, on the host: NumPy under the names of `Mission`."""
    seed = check_seed(seed)
    if planner is not None:
        roadmaps, encodings = planner.uses_roadmap, planner.encoding_dimensions
    samples = prior_arrays(prior, prior_noise)
    obstacles = Obstacles(scenario.obstacles) if scenario.obstacles else None
    real = _real()
    truth = as_field(field, scenario.extent)
    # Arrays of NumPy in and out: each call of JAX outside of the compiled one costs a fifth of it.
    numbers = np.asarray(scenario.extent, real), np.asarray(scenario.mixture_variance, real)
    sizes = {"points": scenario.grid, "components": scenario.mixture_components, "instances": instances}
    drawn = _draw_worlds(np.uint32(seed), np.int32(first), truth, *numbers, **sizes)
    grid, fields, truth, draws = jax.tree.map(np.asarray, drawn)
    inside = np.ones(len(grid), bool) if obstacles is None else obstacles.free(grid)
    if scenario.start is None:
        starts = np.stack([_free_start(each, scenario, obstacles) for each in draws])[:, None]
    else:
        starts = np.asarray(scenario.start).reshape(1, -1, 2)
    starts = np.broadcast_to(starts, (instances, scenario.agents, 2))
    batch = instances * trials

    def every(array: np.ndarray) -> np.ndarray:
        """The same for each mission."""
        return np.broadcast_to(array, (batch, *array.shape))

    def each(array: np.ndarray) -> np.ndarray:
        """The same for each trial of an instance."""
        return np.repeat(array, trials, axis=0)

    # Drawn worlds and numbers are at the precision already.
    at_precision = partial(_at_precision, real)
    homes = _homes(scenario, starts, trials) if scenario.homes else None
    return dict(
        params=_numbers(scenario, real, batch),
        field=jax.tree.map(each, fields) if trials > 1 else fields,
        grid=every(grid),
        truth=each(truth),
        inside=every(inside),
        start=at_precision(each(starts)),
        roadmap=_draw_roadmaps(scenario, seed, first, starts, trials, encodings) if roadmaps else None,
        home=jax.tree.map(at_precision, homes),
        **{name: at_precision(every(array)) for name, array in samples.items()},
    )


@lru_cache(maxsize=64)
def _numbers(scenario: Scenario, real: np.dtype, batch: int) -> Params:
    """The numbers of a scenario on the host, for each mission; `real` is JAX's precision, with which they are made."""
    numbers = jax.device_get(params_of(scenario))
    return jax.tree.map(lambda array: np.broadcast_to(array, (batch, *np.shape(array))), numbers)


def _homes(scenario: Scenario, starts: Float[np.ndarray, "i m 2"], trials: int) -> Home:
    """Where the agents of every mission end. Raises InputError where an agent cannot get there from its start."""
    rows: list[Home] = []
    for each in starts:
        home = home_of(scenario.ends_from(each), scenario.obstacles, scenario.extent, scenario.grid)
        _check_home(home, each, scenario)
        rows += [home] * trials
    return jax.tree.map(lambda *arrays: np.stack([np.asarray(array) for array in arrays]), *rows)


def _check_home(home: Home, starts: Float[np.ndarray, "m 2"], scenario: Scenario) -> None:
    """Raise InputError for an agent whose way home is longer than its budget less its reserve."""
    real = home.ends.places.dtype
    lengths = jax.vmap(lambda ends, start: lengths_home(Home(ends, home.borders), start[None])[0])
    for agent, length in enumerate(np.asarray(lengths(home.ends, jnp.asarray(starts, real)))):
        spendable = scenario.budgets[agent] - scenario.reserves[agent]
        if home.ends.bound[agent] and not length <= spendable:
            way = "no way there around the no-go zones" if np.isinf(length) else f"{length:.3g} away"
            raise InputError(
                f"end of agent {agent}: {way} from its start, of a budget of {spendable:.3g} less the reserve; "
                "give a nearer end or a larger budget"
            )


def _draw_roadmaps(
    scenario: Scenario, seed: int, first: int, starts: Float[np.ndarray, "i m 2"], trials: int, encodings: int
) -> Roadmap:
    """A roadmap for every agent of every mission; one depends on seed, instance and trial only."""
    real = _real()

    def team(instance: int, trial: int) -> Roadmap:
        roadmap = sample_roadmaps(
            np.random.default_rng([seed, first + instance, trial]),
            # Through the device's precision, so that node 0 is exactly where the agent starts.
            starts[instance].astype(real),
            nodes=scenario.nodes,
            neighbours=scenario.neighbours,
            extent=scenario.extent,
            obstacles=scenario.obstacles,
        )
        if not encodings:
            return roadmap
        return dataclasses.replace(roadmap, encoding=laplacian_encoding(roadmap, encodings))

    drawn = [team(instance, trial) for instance in range(len(starts)) for trial in range(trials)]
    return jax.tree.map(lambda *rows: _at_precision(real, np.stack(rows)), *drawn)


def _real() -> np.dtype:
    """JAX's precision; `jnp.result_type` takes longer to say so than a start takes to draw."""
    return np.dtype(jax.dtypes.canonicalize_dtype(float))


def _at_precision(real: np.dtype, array: Array | np.ndarray) -> np.ndarray:
    """The array on the host, floating point at JAX's precision `real`."""
    array = np.asarray(array)
    return array.astype(real, copy=False) if array.dtype.kind == "f" else array
