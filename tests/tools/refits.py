"""What refitting the kernel under way gives back of a wrong guess: errors of the final map, and its intervals.

    python -m tests.tools.refits --fields 60

Fields are drawn from a Gaussian process. Three robots with a budget of 3 survey each: told the true length scale, and
with a guess of it that is refitted. With `--fixed` the guess stays as it is.
"""

import argparse
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Matern32
from maipp.fields.gp_field import draw_fields
from maipp.live import LiveSurvey
from maipp.live.simulate import simulate
from maipp.scenario import Scenario

CASES = ((0.15, 0.45), (0.3, 0.45), (0.6, 0.45), (0.45, 0.15), (0.45, 0.3), (0.45, 0.6), (0.45, 0.45))
NOISE = 1e-3
DRAWS = 4000  # of the bootstrap


class Outcome(NamedTuple):
    """How a survey went."""

    error: float  # root mean square, over the grid
    within: tuple[float, float]  # shares of the grid within the 68 % and 95 % intervals


def survey(true: float, guess: float, adapt: bool, seed: int, planner: str) -> Outcome:
    """One survey of the field of a seed."""
    fields = draw_fields(jax.random.key(1000 + seed), Matern32(true, 1.0), 1)
    field = jax.tree.map(lambda array: array[0], fields)

    def values(points: np.ndarray) -> np.ndarray:
        return np.asarray(_values(field, jnp.asarray(points, jnp.float32)))

    start = tuple(np.random.default_rng(seed).uniform(0.1, 0.9, 2).tolist())
    scenario = Scenario.create(agents=3, budget=3.0, length_scale=guess, noise=NOISE, start=start)
    with LiveSurvey.from_scenario(scenario, planner, seed=seed, adapt=adapt) as live:
        simulate(live, values, seed)
        belief = live.belief()
    rest = np.array(belief["mean"]) - values(np.array(belief["points"]))
    scores = abs(rest) / np.maximum(np.array(belief["std"]), 1e-6)
    return Outcome(float(np.sqrt(np.mean(rest**2))), (float((scores < 1).mean()), float((scores < 1.96).mean())))


_values = jax.jit(lambda field, points: field(points))


def main() -> None:
    """Print a row for each true length scale and guess."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fields", type=int, default=60)
    parser.add_argument("--first", type=int, default=400, help="seed of the first field")
    parser.add_argument("--planner", default="receding-horizon")
    parser.add_argument("--fixed", action="store_true", help="do not refit")
    flags = parser.parse_args()
    seeds = range(flags.first, flags.first + flags.fields)
    told: dict[float, list[Outcome]] = {}
    print("true, guess, told the truth, with the guess, ratio, se, within 68 %, within 95 %")
    for true, guess in CASES:
        if true not in told:
            told[true] = [survey(true, true, False, seed, flags.planner) for seed in seeds]
        right = np.array([each.error for each in told[true]])
        rows = [survey(true, guess, not flags.fixed, seed, flags.planner) for seed in seeds]
        found = np.array([each.error for each in rows])
        picks = np.random.default_rng(0).integers(len(found), size=(DRAWS, len(found)))
        se = float((found[picks].mean(axis=1) / right[picks].mean(axis=1)).std())
        near, far = np.mean([each.within for each in rows], axis=0)
        ratio = found.mean() / right.mean()
        print(f"{true}, {guess}, {right.mean():.3f}, {found.mean():.3f}, {ratio:.3f}, {se:.3f}, {near:.3f}, {far:.3f}")


if __name__ == "__main__":
    main()
