"""What the gate makes of bad values: false alarms, hits, and the error of the map against that of a clean survey.

    python -m tests.tools.gate --surveys 40

Three robots wander and measure a field drawn from the kernel; a share of the values is a spike, a sentinel, or of a
stuck sensor. The map is the belief of what the gate lets in; its error stands over that of the same values before they
were spoilt. With `--adapt` the kernel is refitted under way, from a guess of the length scale.
"""

import argparse
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve

from maipp.belief.refit import Hyperparameters, HyperPrior
from maipp.live.gate import LEVEL, Gate
from maipp.live.incremental_posterior import correlations
from maipp.live.refits import Refits
from maipp.live.scaled_measurement import ScaledMeasurement
from maipp.typing import Float

KERNEL = Hyperparameters(0.0, 1.0, 0.3, 0.0025)
COUNT, GRID = 90, 15
SENTINELS = (-9999.0, -999.0, 999.0)
RUN = 8  # values that a stuck sensor gives alike


class World(NamedTuple):
    """What is measured, and the field on a grid."""

    samples: list[ScaledMeasurement]
    grid: Float[np.ndarray, "q 2"]
    truth: Float[np.ndarray, " q"]


def draw(seed: int) -> World:
    """Three robots that wander, and a field drawn from the kernel."""
    rng = np.random.default_rng([7, seed])
    places, heading, rows = rng.uniform(0.2, 0.8, (3, 2)), rng.uniform(0, 2 * np.pi, 3), []
    for step in range(COUNT // 3):
        heading += rng.normal(0, 0.6, 3)
        places = places + 0.07 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        turned = ((places < 0) | (places > 1)).any(axis=1)
        heading[turned], places = heading[turned] + np.pi, np.clip(places, 0, 1)
        rows += [(step + robot / 10, robot, x, y) for robot, (x, y) in enumerate(places.tolist())]
    axis = np.linspace(0, 1, GRID)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    every = np.concatenate([np.array([row[2:] for row in rows]), grid])
    covariance = correlations(KERNEL, every, every) + 1e-9 * np.eye(len(every))
    field = np.linalg.cholesky(covariance) @ rng.normal(size=len(every))
    values = field[:COUNT] + KERNEL.noise**0.5 * rng.normal(size=COUNT)
    return World(
        [
            ScaledMeasurement(time, robot, x, y, value)
            for (time, robot, x, y), value in zip(rows, values.tolist(), strict=True)
        ],
        grid,
        field[COUNT:],
    )


def spoil(
    samples: list[ScaledMeasurement], kind: str, share: float, seed: int
) -> tuple[list[ScaledMeasurement], set[int]]:
    """The samples with a share of bad values of a kind, and which are bad."""
    rng, changed, bad = np.random.default_rng([8, seed]), [*samples], set[int]()
    if kind == "stuck":
        # Of one robot a row of values; as many rows as the share asks for, at least one.
        for _ in range(max(1, round(share * COUNT / RUN))) if share else ():
            robot = int(rng.integers(3))
            own = [i for i, sample in enumerate(samples) if sample.robot == robot]
            first = int(rng.integers(0, len(own) - RUN))
            for index in own[first + 1 : first + RUN]:
                changed[index] = changed[index]._replace(value=changed[own[first]].value)
                bad.add(index)
        return changed, bad
    for index in np.flatnonzero(rng.random(COUNT) < share).tolist():
        spike = float(rng.choice([-1, 1]) * rng.uniform(6, 100))
        value = samples[index].value + spike if kind == "spike" else float(rng.choice(SENTINELS))
        changed[index] = changed[index]._replace(value=value, stray=kind == "sentinel")
        bad.add(index)
    return changed, bad


def error(world: World, kernel: Hyperparameters, samples: list[ScaledMeasurement]) -> float:
    """Root mean square error of the map of some samples."""
    x, y = np.array([(s.x, s.y) for s in samples]), np.array([s.value for s in samples])
    covariance = kernel.std**2 * correlations(kernel, x, x) + kernel.noise * np.eye(len(x))
    weights = solve(covariance, y - kernel.mean, assume_a="pos")
    mean = kernel.mean + kernel.std**2 * correlations(kernel, world.grid, x) @ weights
    return float(np.sqrt(np.mean((mean - world.truth) ** 2)))


def judged(samples: list[ScaledMeasurement], guess: float | None) -> tuple[list[bool], Hyperparameters]:
    """Which are kept out, and the kernel in the end."""
    start = KERNEL if guess is None else KERNEL._replace(length_scale=guess)
    gate = Gate(start, LEVEL, None, None if guess is None else Refits(HyperPrior(guess, KERNEL.noise)))
    return [verdict.out is not None for verdict in gate.judge(samples)], gate.kernel


def main() -> None:
    """Print a row for each kind and share."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--surveys", type=int, default=40)
    parser.add_argument("--adapt", type=float, metavar="LENGTH", help="guess of the length scale; true is 0.3")
    flags = parser.parse_args()
    worlds = [draw(seed) for seed in range(flags.surveys)]
    print("kind, share, kept out of the bad, of the good, error over that of the clean survey, largest, without a gate")
    for kind, share in [("none", 0.0)] + [(k, s) for k in ("spike", "sentinel", "stuck") for s in (0.01, 0.05, 0.1)]:
        hits = false = wrong = good = 0
        clean, gated, open_ = [], [], []
        for seed, world in enumerate(worlds):
            samples, bad = spoil(world.samples, kind, share, seed)
            out, kernel = judged(samples, flags.adapt)
            hits += sum(out[i] for i in bad)
            false += sum(each for i, each in enumerate(out) if i not in bad)
            wrong, good = wrong + len(bad), good + COUNT - len(bad)
            clean.append(error(world, judged(world.samples, flags.adapt)[1], world.samples))
            gated.append(error(world, kernel, [s for s, each in zip(samples, out, strict=True) if not each]))
            open_.append(error(world, kernel, samples))
        ratios = np.array(gated) / np.array(clean)
        whole, without = np.mean(gated) / np.mean(clean), np.mean(open_) / np.mean(clean)
        told = f"{hits}/{wrong}, {false}/{good}, {whole:.3f}, {ratios.max():.2f}, {without:.2f}"
        print(f"{kind}, {share:.0%}, {told}", flush=True)


if __name__ == "__main__":
    main()
