"""How a policy is trained: every number of it, named, checked, and round-tripping through YAML."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NoReturn, no_type_check

from maipp.records import FieldError, Within, described, settle, show
from maipp.records.kinds import Ascending, AtLeast1, Finite, Positive, Real
from maipp.scenario import Scenario
from maipp.seeds import LARGEST_SEED

# Added to the seeds that training draws worlds from: `maipp evaluate --seed` below this never meets any of them.
TRAINING_SEEDS = 1_000_000_000

Range = Real | tuple[Real, Real]  # a number, or the ends that each mission's is drawn between

# Numbers of a scenario that may be ranges, besides the budget and the communication range.
RANGES = ("length_scale", "threshold", "beta", "noise", "measurement_interval", "speed")

# What stands before the key in errors of a configuration that comes from no file.
_WHERE = "training."

_Above0 = Annotated[float, Within(above=0, wide=True)]
_Fraction = Annotated[float, Within(0, most=1)]


def ends(value: Any) -> tuple[Any, Any]:
    """Both ends of a range; those of a number are the number."""
    return value if isinstance(value, tuple) else (value, value)


@dataclass(frozen=True)
class TrainConfig:
    """One training run. Immutable; two runs of one configuration on one device give the same weights.

    Missions are split into `shards` that shuffle their own minibatches and average their gradients, wherever they run:
    the result does not depend on how many devices share the shards, up to rounding.
    Texts may stand for values, as they are typed. Raises `FieldError` for the first value out of range.
    """

    policy: Literal["ti", "sga-catnipp"] = described(
        "ti",
        "what is trained: `ti` (with intents; `di`, `ti`, `ti-star`, `intent-paths`) or `sga-catnipp` (without)",
    )
    seed: Annotated[int, Within(0, most=LARGEST_SEED - TRAINING_SEEDS, wide=True)] = described(
        0, "of everything random: first weights, worlds, steps, shuffling"
    )
    # The worlds
    agents: AtLeast1 = described(Scenario.agents, "robots that there is room for")
    team: Ascending[AtLeast1] | None = described(
        None,
        "`[fewest, most]` robots that take part, drawn for each mission; none: all `agents`",
        allowed="[fewest, most] with 1 <= fewest <= most <= agents, or none",
    )
    budget: Ascending[Positive] = described(
        (1.5, 5.0),
        "each mission's budget is drawn uniformly from this range, domain units",
        allowed="[low, high] with 0 < low <= high",
    )
    length_scale: Range = described(
        Scenario.length_scale,
        "length scale of the belief's kernel, domain units; this and the next six: a number, or "
        "`[low, high]`, from which each mission's is drawn uniformly",
    )
    threshold: Range = described(Scenario.threshold, "of the high-interest area, normalised field units")
    beta: Range = described(Scenario.beta, "weight of the uncertainty in its upper confidence bound")
    noise: Range = described(Scenario.noise, "variance of the measurement noise")
    measurement_interval: Range = described(
        Scenario.measurement_interval, "distance between measurements, domain units"
    )
    speed: Range = described(Scenario.speed, "domain units per unit of time; drawn for each robot")
    comm_range: Real | None | tuple[Real, Real | None] = described(
        None,
        "farthest distance at which robots hear each other, domain units; none: any. "
        "Of a range such as `[0.3, none]` the inverse is drawn uniformly",
    )
    bank: AtLeast1 = described(256, "teams of roadmaps drawn beforehand; each is met in the 8 symmetries of the square")
    zones: Ascending[Annotated[int, Within(0, most=8)]] | None = described(
        None,
        "`[fewest, most]` no-go zones in each world of the bank; none: none at all",
        allowed="[fewest, most] with 0 <= fewest <= most <= 8, or none",
    )
    # One update
    shards: AtLeast1 = described(2, "parts that the missions are split into; devices and processes share them evenly")
    missions: AtLeast1 = described(16, "missions that each shard steps together")
    events: Annotated[int, Within(2, wide=True)] = described(16, "decisions of each mission per update")
    epochs: AtLeast1 = described(2, "passes over an update's decisions")
    minibatch: AtLeast1 = described(64, "decisions of each shard per gradient step; divides missions x events")
    # Sampling
    paths: AtLeast1 = described(4, "trajectories sampled for the intent at each decision (a)")
    steps: AtLeast1 = described(5, "nodes of each (j)")
    share: Literal["samples", "best"] = described(
        "best", "the intent is fitted to all `samples`, or to the `best` of them"
    )
    start: str = described("", "weights to begin with: a shipped name or a `.safetensors` file; empty: random ones")
    # Objective
    imitation: Annotated[int, Within(0, wide=True)] = described(
        100, "updates at the beginning that imitate the teacher"
    )
    search: Annotated[int, Within(0, wide=True)] = described(
        48, "updates at the end that learn from the policy's own search"
    )
    search_paths: AtLeast1 = described(64, "paths sampled for it at each decision")
    elites: AtLeast1 = described(4, "the best of them, which are made likelier")
    updates: AtLeast1 = described(308, "updates in all; those between are PPO")
    reward: Literal["log-trace", "paper"] = described(
        "log-trace", "`log-trace`: fall of log Tr(P); `paper`: as in Yang et al. 2023, Sec. IV-C"
    )
    discount: _Fraction = described(0.99, "of later rewards")
    trace_decay: _Fraction = described(0.95, "lambda of generalised advantage estimation")
    clip: Finite = described(0.2, "how far PPO lets the probability ratio of a choice move from 1")
    entropy: Finite = described(0.01, "weight of the entropy bonus")
    value: Finite = described(0.5, "weight of the squared error of the value")
    # Optimiser
    learning_rate: _Above0 = described(7e-4, "of Adam, at the beginning")
    search_rate: _Above0 = described(5e-4, "likewise, at the beginning of the search")
    schedule: Literal["cosine", "steps", "constant"] = described(
        "cosine", "of the learning rate: `cosine` (to 2 %), `steps` (times 0.96 every 32 updates), `constant`"
    )
    gradient_norm: _Above0 = described(1.0, "gradients are scaled down to at most this norm")
    # Along the way
    evaluate_every: AtLeast1 = described(40, "updates between two held-out evaluations")
    evaluate_instances: AtLeast1 = described(30, "held-out worlds")
    evaluate_budget: _Above0 = described(3.0, "their budget, domain units")
    checkpoint_seconds: _Above0 = described(120.0, "least time between two checkpoints, seconds")

    def __post_init__(self) -> None:
        settle(self, _WHERE, typed=True)
        if self.imitation + self.search > self.updates:
            self._wrong("updates", f"give at least imitation + search, {self.imitation + self.search}")
        if self.elites > self.search_paths:
            self._wrong("elites", f"give at most search_paths, {self.search_paths}")
        if self.team is not None and self.team[1] > self.agents:
            self._wrong("team", f"give [fewest, most] with 1 <= fewest <= most <= agents, {self.agents}")
        if self.zones is not None and self.imitation:
            self._wrong("zones", "the teacher knows no zones; give imitation=0 (and weights to start from)")
        if (self.missions * self.events) % self.minibatch:
            self._wrong("minibatch", f"give a divisor of missions * events, {self.missions * self.events}")
        for name in (*RANGES, "comm_range"):
            self._check_range(name)

    def _wrong(self, key: str, right: str) -> NoReturn:
        """Raises the error that this key contradicts another one."""
        raise FieldError(key, f"{show(getattr(self, key))}; {right}", _WHERE)

    def _check_range(self, name: str) -> None:
        """Raises `FieldError` for a range that is empty, or has an end that no scenario may have."""
        low, high = ends(getattr(self, name))
        if high is not None and (low is None or low > high):
            self._wrong(name, "give the shorter range first" if low is None else "give [low, high] with low <= high")
        for end in (low, high):
            try:
                Scenario.create(**{name: end})
            except FieldError as error:
                raise FieldError(name, error.problem, _WHERE) from None

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


# It takes more than its annotations say, and itself says what is wrong with the rest, as that of `Scenario`.
no_type_check(TrainConfig.__init__)

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
