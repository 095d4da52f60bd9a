"""How well foresights foretell: errors and intervals by what is known, in the benchmark's fields, others and on relief.

    python -m tests.tools.foresight --worlds 96 --seed 660001

Surveys are those of `receding-horizon` on their own fields (three agents, B = 5); after so many measurements of the
team each foresight's law of the field is held against the truth on the evaluation grid. On relief, three cuts of
Matplotlib's sample data, values are standardised and the kernel is fitted by 60 soundings with an error, as in the
strait example; the foresights are not told that the field is not of the benchmark's family.
"""

import argparse
import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from matplotlib.cbook import get_sample_data
from scipy.interpolate import RegularGridInterpolator

from maipp.belief.fit import fit_kernel
from maipp.bench.evaluate import prior_missions
from maipp.engine import Mission, draw_missions, run_missions
from maipp.engine.score import belief_of
from maipp.engine.state import State
from maipp.fields.user_fields import as_field
from maipp.foresight import Foresight, Law, make_foresight
from maipp.foresight.learned import LearnedForesight, learned_foresight
from maipp.markdown import markdown_table
from maipp.planners import make_planner
from maipp.problem import problem_of
from maipp.scenario import Scenario
from maipp.typing import Array

# Measurements that the team knows, and the groups that these are told in.
COUNTS = (1, 2, 3, 5, 7, 9, 11, 13, 15, 18, 21, 24, 28, 32, 36, 45, 60, 75)
GROUPS = ((1, 3), (4, 8), (9, 15), (16, 24), (25, 36), (37, 75))
WHO = ("protocol", "fitted", "learned")
# The part of the standard normal within these deviations is 68 and 95 %.
WIDTHS = (0.9945, 1.96)

SOUNDINGS, ERROR = 60, 10.0  # how many, standard deviation (m)
# South-west corners and side, in cells of a sixtieth of a degree or two: ocean and coast, mountains, a strait.
CUTS = ((5, 5), (10, 75), (50, 40))
SIDE = 40


class Judged(NamedTuple):
    """Of each world, count and foresight."""

    squared: Any  # mean squared error over the grid
    within: Any  # part of the grid within one and two deviations
    trusted: Any  # whether the network was trusted; no foresight's axis


def judge(foresights: list[Foresight], count: Array, mission: Mission, state: State) -> Judged:
    """One mission after the first `count` measurements of the team."""
    time = state.measurement_time.reshape(-1)
    order = jnp.argsort(jnp.argsort(time))
    known = (order < count) & jnp.isfinite(time)
    belief = belief_of(mission, state, known.reshape(state.measurement_time.shape))
    laws = [Law(belief.mean, belief.std), *(each(belief) for each in foresights)]
    off = [jnp.abs(mission.truth - law.mean) for law in laws]
    return Judged(
        jnp.stack([jnp.mean(each**2) for each in off]),
        jnp.stack(
            [jnp.stack([jnp.mean(e <= w * s.deviation) for w in WIDTHS]) for e, s in zip(off, laws, strict=True)]
        ),
        jnp.stack([each.correction(belief).trusted for each in foresights if isinstance(each, LearnedForesight)]),
    )


def surveys(flags: argparse.Namespace) -> Iterator[tuple[str, Scenario, Mission]]:
    """The kinds of fields, and missions in each."""
    scenario = Scenario.create(budget=5.0)
    planner = make_planner("receding-horizon", scenario)
    yield "benchmark", scenario, draw_missions(scenario, seed=flags.seed, instances=flags.worlds, planner=planner)
    few = max(flags.worlds // 4, 2)
    for scale in (0.3, 0.6):
        other = scenario.replace(length_scale=scale)
        yield f"Matern 3/2, {scale}", other, prior_missions(other, planner, flags.seed + 1, few, 1)
    for number, cut in enumerate(CUTS):
        standardised, other = relief(cut, scenario, np.random.default_rng([flags.seed, number]))
        missions = draw_missions(other, seed=flags.seed + 2, instances=few, planner=planner, field=standardised)
        yield f"relief {number + 1}", other, missions


def relief(cut: tuple[int, int], scenario: Scenario, rng: np.random.Generator) -> tuple[Any, Scenario]:
    """A cut of relief on the unit square, standardised by soundings, and the scenario with the kernel of these."""
    with np.load(str(get_sample_data("topobathy.npz", asfileobj=False))) as file:
        height = file["topo"][cut[0] : cut[0] + SIDE, cut[1] : cut[1] + SIDE].astype(float).T
    place = np.linspace(0.0, 1.0, SIDE)
    between = RegularGridInterpolator((place, place), height)
    x = rng.random((SOUNDINGS, 2))
    y = between(x) + ERROR * rng.standard_normal(SOUNDINGS)
    level, spread = y.mean(), y.std()
    fit = fit_kernel(x, (y - level) / spread)
    noise = max((ERROR / spread) ** 2, 1e-6)
    other = scenario.replace(
        length_scale=float(np.clip(fit.length_scale, 0.05, 2.0)),
        noise=float(noise),
    )
    return as_field(lambda points: (between(np.asarray(points)) - level) / spread, (1.0, 1.0)), other


def rows(name: str, judged: list[Judged]) -> Iterator[list[str]]:
    """A row of the table for each group of counts."""
    for low, high in GROUPS:
        picked = [each for count, each in zip(COUNTS, judged, strict=True) if low <= count <= high]
        error = np.sqrt(np.stack([np.asarray(each.squared, np.float64) for each in picked])).mean(axis=0)  # (w, f)
        within = np.stack([np.asarray(each.within, np.float64) for each in picked]).mean(axis=(0, 1))
        trusted = np.mean([np.asarray(each.trusted) for each in picked])
        mean = error.mean(axis=0)

        def change(against: int, error: np.ndarray = error, mean: np.ndarray = mean) -> str:
            less = (error[:, 2] - error[:, against]) / mean[against]
            return f"{100 * less.mean():+.1f} ({100 * less.std(ddof=1) / len(less) ** 0.5:.1f})"

        intervals = [" ".join(f"{100 * share:.0f}" for share in within[who]) for who in (0, 1, 2)]
        errors = [f"{each:.4f}" for each in mean]
        yield [name, f"{low}-{high}", *errors, change(0), change(1), *intervals, f"{100 * trusted:.0f}"]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=96)
    parser.add_argument("--seed", type=int, default=660_001)
    parser.add_argument("--weights", default=None, help="of a file or run folder; those that ship if left out")
    parser.add_argument("--only", default="", help="kinds of fields whose name begins so")
    flags = parser.parse_args()
    table = []
    for name, scenario, missions in surveys(flags):
        if not name.startswith(flags.only):
            continue
        planner = make_planner("receding-horizon", scenario)
        states = run_missions(planner, missions, jax.random.key(flags.seed))
        foresights = [make_foresight("fitted", scenario), learned_foresight(scenario, flags.weights)]
        foresights = [each.on(problem_of(scenario)) for each in foresights]

        @jax.jit
        def judge_all(count: Array, missions: Mission, states: State, foresights: Any = foresights) -> Judged:
            return lax.map(lambda pair: judge(foresights, count, *pair), (missions, states))

        judged = [jax.device_get(judge_all(jnp.int32(count), missions, states)) for count in COUNTS]
        table += rows(name, judged)
        print(f"{name}: {missions.start.shape[0]} worlds", file=sys.stderr, flush=True)
    heading = ["fields", "measurements", *(f"RMSE {who}" for who in WHO), "learned to protocol, %", "to fitted, %"]
    heading += [*(f"within 68 95 %, {who}" for who in WHO), "network trusted, %"]
    print(markdown_table(heading, table, left=1))
    return 0


if __name__ == "__main__":
    from maipp.devices import use_all_cores

    use_all_cores(1)
    sys.exit(main())
