"""How a foresight is trained: every number of it, named, checked, and round-tripping through YAML."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated, NoReturn, no_type_check

from maipp.records import FieldError, Within, described, settle, show
from maipp.records.kinds import Ascending, AtLeast1, Each, Finite, NotNegative, Positive, Real
from maipp.seeds import LARGEST_SEED
from maipp.training.config import TRAINING_SEEDS

# What stands before the key in errors of a configuration that comes from no file.
_WHERE = "training."

_Above0 = Annotated[float, Within(above=0, wide=True)]
_Share = Annotated[float, Within(0, most=1)]


@dataclass(frozen=True)
class ForesightConfig:
    """One training run. Immutable; two runs of one configuration on one device give the same weights.

    Texts may stand for values, as they are typed. Raises `FieldError` for the first value out of range.
    """

    seed: Annotated[int, Within(0, most=LARGEST_SEED - TRAINING_SEEDS, wide=True)] = described(
        900_001, "of everything random: first weights, routes, fields, their order"
    )
    # The bank of routes
    surveys: AtLeast1 = described(1133, "surveys simulated for their routes; a field of its own comes with each sample")
    zoned: _Share = described(0.1, "share of them among no-go zones")
    planners: Each[str] = described(
        ("receding-horizon", "shared-greedy", "random", "lawnmower"), "who is simulated, of these four"
    )
    team: Ascending[AtLeast1] = described((1, 10), "`[fewest, most]` robots of a survey")
    budget: Ascending[Positive] = described((2.0, 5.0), "each survey's budget is drawn from this range, domain units")
    slots: AtLeast1 = described(96, "measurements of a sample at most")
    # The worlds
    benchmark: _Share = described(
        0.65, "share of samples of bumps whose numbers and family are the default scenario's; the rest draws them"
    )
    length_scale: Ascending[Positive] = described((0.15, 0.8), "of the belief's kernel, domain units")
    threshold: Ascending[Real] = described((0.2, 0.6), "of the high-interest area, normalised field units")
    noise: Ascending[Positive] = described((1e-6, 1e-2), "variance of the measurement noise, drawn by its logarithm")
    processes: _Share = described(0.12, "share of samples whose field is a draw of a Gaussian process")
    # The network
    width: Annotated[int, Within(4, most=512)] = described(48, "channels at its coarser resolution; even")
    blocks: Annotated[int, Within(1, most=32)] = described(3, "residual blocks there")
    # Optimisation
    updates: AtLeast1 = described(160, "updates in all")
    steps: AtLeast1 = described(50, "gradient steps of an update")
    batch: Annotated[int, Within(2, wide=True)] = described(32, "samples of a gradient step")
    area: NotNegative = described(3.0, "weight of the log loss of the area in the loss")
    squared: NotNegative = described(1.0, "weight of the squared error, in units of the fitted foresight's variance")
    learning_rate: _Above0 = described(1.5e-3, "of Adam at its highest; it rises for 2 % of the run, then falls to 2 %")
    weight_decay: NotNegative = described(1e-4, "of AdamW")
    average: _Share = described(0.999, "decay of the running mean of the weights, which is what is kept")
    gradient_norm: Finite = described(1.0, "gradients are scaled down to at most this norm")
    # Along the way
    validation: AtLeast1 = described(512, "samples that every evaluation is made on, of seed 770001")
    evaluate_every: AtLeast1 = described(20, "updates between two evaluations")
    checkpoint_seconds: _Above0 = described(120.0, "least time between two checkpoints, seconds")

    def __post_init__(self) -> None:
        settle(self, _WHERE, typed=True)
        if self.noise[0] <= 0:
            self._wrong("noise", "give [low, high] with 0 < low")
        if unknown := set(self.planners) - set(ForesightConfig.planners):
            self._wrong("planners", f"{sorted(unknown)[0]} is none of {', '.join(ForesightConfig.planners)}")
        if self.width % 2:
            self._wrong("width", "give an even number")
        if self.gradient_norm <= 0:
            self._wrong("gradient_norm", "give a number > 0")

    def _wrong(self, key: str, right: str) -> NoReturn:
        """Raises the error that this key contradicts another one, or what is meant by it."""
        raise FieldError(key, f"{show(getattr(self, key))}; {right}", _WHERE)

    @property
    def gradient_steps(self) -> int:
        """Gradient steps of the whole run."""
        return self.updates * self.steps

    def replace(self, **changes: object) -> "ForesightConfig":
        """The same configuration with these values changed, checked anew."""
        return dataclasses.replace(self, **changes)  # type: ignore[arg-type]


# It takes more than its annotations say, and itself says what is wrong with the rest, as that of `Scenario`.
no_type_check(ForesightConfig.__init__)

NAMED: dict[str, ForesightConfig] = {
    "default": ForesightConfig(),
    "smoke": ForesightConfig(
        surveys=16,
        zoned=0.0,
        benchmark=1.0,
        processes=0.0,
        planners=("lawnmower",),
        team=(1, 2),
        budget=(1.0, 2.0),
        slots=16,
        width=16,
        blocks=1,
        updates=8,
        steps=10,
        batch=16,
        learning_rate=5e-3,
        validation=64,
        evaluate_every=4,
    ),
}
