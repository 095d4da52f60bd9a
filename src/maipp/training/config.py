"""How a policy is trained: every number of it, named, checked, and round-tripping through YAML."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Literal

from maipp.errors import InputError
from maipp.scenario import Scenario, ScenarioError
from maipp.seeds import LARGEST_SEED, check_seed

# Added to the seeds that training draws worlds from: `maipp evaluate --seed` below this never meets any of them.
TRAINING_SEEDS = 1_000_000_000


Range = float | tuple[float, float]  # a number, or the ends that each mission's is drawn between

# Numbers of a scenario that may be ranges, besides the budget and the communication range.
RANGES = ("length_scale", "threshold", "beta", "noise", "measurement_interval", "speed")


def ends(value: Any) -> tuple[Any, Any]:
    """Both ends of a range; those of a number are the number."""
    return value if isinstance(value, tuple) else (value, value)


@dataclass(frozen=True)
class TrainConfig:
    """One training run. Immutable; two runs of one configuration on one device give the same weights.

    Missions are split into `shards` that shuffle their own minibatches and average their gradients, wherever they run:
    the result does not depend on how many devices share the shards, up to rounding.
    Raises InputError for the first value out of range.
    """

    policy: Literal["ti", "sga-catnipp"] = "ti"  # what is trained
    seed: int = 0
    # The worlds
    agents: int = 3  # that there is room for
    team: tuple[int, int] | None = None  # fewest and most that take part in a mission; none: all
    budget: tuple[float, float] = (1.5, 5.0)  # each mission's is drawn from this range, domain units
    length_scale: Range = 0.45  # of the belief's kernel, domain units; here and below: one for all missions, or a range
    threshold: Range = 0.4  # of the high-interest area
    beta: Range = 1.0  # weight of the uncertainty in it
    noise: Range = 1e-6  # variance of a measurement's noise
    measurement_interval: Range = 0.2  # domain units
    speed: Range = 1.0  # domain units per unit of time; drawn for each robot
    comm_range: float | None | tuple[float, float | None] = None  # domain units; none: everybody is heard
    bank: int = 256  # roadmaps drawn beforehand, one team each; seen in 8 symmetries
    # One update
    shards: int = 2
    missions: int = 16  # stepped together by each shard
    events: int = 16  # decisions of each mission per update
    epochs: int = 2  # passes over them
    minibatch: int = 64  # decisions of each shard per gradient step
    # Sampling
    paths: int = 4  # trajectories sampled for the intent
    steps: int = 5  # nodes of each
    share: Literal["samples", "best"] = "best"  # which of them the intent is fitted to
    start: str = ""  # weights to begin with: a shipped name or a .safetensors file; none: random ones
    # Objective
    imitation: int = 100  # updates at the beginning that imitate the teacher; then reinforcement begins
    search: int = 48  # updates at the end that learn from the policy's own search
    search_paths: int = 64  # trajectories sampled for it at each decision
    elites: int = 4  # the best of them, which are made likelier
    updates: int = 308  # in all
    reward: Literal["log-trace", "paper"] = "log-trace"
    discount: float = 0.99
    trace_decay: float = 0.95  # lambda of generalised advantage estimation
    clip: float = 0.2
    entropy: float = 0.01  # weight of the entropy bonus
    value: float = 0.5  # weight of the squared error of the value
    # Optimiser
    learning_rate: float = 7e-4
    search_rate: float = 5e-4  # learning rate at the beginning of the search
    schedule: Literal["cosine", "steps", "constant"] = "cosine"  # steps: times 0.96 every 32 updates
    gradient_norm: float = 1.0  # gradients are scaled down to at most this norm
    # Along the way
    evaluate_every: int = 40  # updates
    evaluate_instances: int = 30  # held-out worlds
    evaluate_budget: float = 3.0
    checkpoint_seconds: float = 120.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            numbers = value if isinstance(value, tuple) else (value,)
            if not all(math.isfinite(number) for number in numbers if isinstance(number, float)):
                raise InputError(f"training: {field.name}: {value}; give finite numbers")
        least = {"agents": 1, "bank": 1, "shards": 1, "missions": 1, "events": 2, "epochs": 1, "minibatch": 1}
        least |= {"search": 0, "search_paths": 1, "elites": 1}
        least |= {"paths": 1, "steps": 1, "imitation": 0, "updates": 1, "evaluate_every": 1, "evaluate_instances": 1}
        for name, smallest in least.items():
            if getattr(self, name) < smallest:
                raise InputError(f"training: {name}: {getattr(self, name)}; give a whole number >= {smallest}")
        check_seed(self.seed, "training: seed", LARGEST_SEED - TRAINING_SEEDS)
        for name in (
            "learning_rate",
            "search_rate",
            "gradient_norm",
            "evaluate_budget",
            "checkpoint_seconds",
        ):
            if not getattr(self, name) > 0:
                raise InputError(f"training: {name}: {getattr(self, name)}; give a number > 0")
        for name in ("discount", "trace_decay"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"training: {name}: {getattr(self, name)}; give a number from 0 to 1")
        if self.imitation + self.search > self.updates:
            raise InputError(
                f"training: updates: {self.updates}; give at least imitation + search, {self.imitation + self.search}"
            )
        if self.elites > self.search_paths:
            raise InputError(f"training: elites: {self.elites}; give at most search_paths, {self.search_paths}")
        self._check_ranges()
        if not 0 < self.budget[0] <= self.budget[1]:
            raise InputError(f"training: budget: {self.budget}; give [low, high] with 0 < low <= high")
        if (self.missions * self.events) % self.minibatch:
            raise InputError(
                f"training: minibatch: {self.minibatch} does not divide missions * events = "
                f"{self.missions * self.events}; give a divisor"
            )

    def _check_ranges(self) -> None:
        """Raise InputError for a range that is empty, or has an end that no scenario may have."""
        for name in (*RANGES, "comm_range"):
            low, high = ends(getattr(self, name))
            if name == "comm_range" and low is None and high is not None:
                raise InputError(f"training: comm_range: [none, {high}]; give the shorter range first")
            if low is not None and high is not None and low > high:
                raise InputError(f"training: {name}: [{low}, {high}]; give [low, high] with low <= high")
            for end in (low, high):
                try:
                    Scenario.create(**{name: end})
                except ScenarioError as error:
                    raise InputError(f"training: {name}: {error.problem}") from None
        if self.team is not None and not 1 <= self.team[0] <= self.team[1] <= self.agents:
            right = f"[fewest, most] with 1 <= fewest <= most <= agents, {self.agents}"
            raise InputError(f"training: team: {list(self.team)}; give {right}")

    @property
    def minibatches(self) -> int:
        """Gradient steps of one pass."""
        return self.missions * self.events // self.minibatch

    @property
    def gradient_steps(self) -> int:
        """Gradient steps of the whole run."""
        return self.updates * self.epochs * self.minibatches

    @property
    def transitions_per_update(self) -> int:
        """Decisions that one update samples."""
        return self.shards * self.missions * self.events

    def replace(self, **changes: object) -> "TrainConfig":
        """The same configuration with these values changed, checked anew."""
        return dataclasses.replace(self, **changes)  # type: ignore[arg-type]


NAMED: dict[str, TrainConfig] = {
    # Imitation of the receding-horizon planner, then PPO on log Tr(P), then the policy's own search.
    "default": TrainConfig(),
    # Yang et al. 2023, Sec. IV-E, says: three agents, batches of 512 decisions, 8 gradient steps on each, learning
    # rate 5e-5 times 0.96 every 32 training steps, budget 3. Where it is silent: no discount, no entropy bonus and
    # gradients up to norm 10, as in the public code family; the sampled trajectories, the value's weight, generalised
    # advantages, the bank of roadmaps and how many missions a batch is taken from are ours.
    "paper": TrainConfig(
        budget=(3.0, 3.0),
        shards=2,
        missions=8,
        events=32,
        epochs=8,
        minibatch=256,
        paths=8,
        share="samples",
        imitation=0,
        search=0,
        updates=4000,
        reward="paper",
        discount=1.0,
        entropy=0.0,
        learning_rate=5e-5,
        schedule="steps",
        gradient_norm=10.0,
        evaluate_every=100,
    ),
    # Draws every number that may be drawn.
    "smoke": TrainConfig(
        team=(2, 3),
        budget=(1.5, 2.0),
        length_scale=(0.2, 0.8),
        threshold=(0.3, 0.5),
        beta=(0.5, 1.5),
        noise=(1e-6, 1e-3),
        measurement_interval=(0.2, 0.25),
        speed=(0.8, 1.2),
        comm_range=(0.3, None),
        bank=16,
        missions=8,
        paths=2,
        steps=2,
        imitation=0,
        search=0,
        search_paths=32,
        updates=30,
        entropy=0.003,
        learning_rate=3e-4,
        evaluate_every=15,
        evaluate_instances=8,
        evaluate_budget=2.0,
    ),
}
