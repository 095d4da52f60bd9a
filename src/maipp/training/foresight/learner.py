"""The learner of a foresight: gradient steps, each on fresh samples."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax

from maipp.foresight.model import FieldModel
from maipp.foresight.network import FieldNetwork
from maipp.training.foresight.bank import Routes
from maipp.training.foresight.config import ForesightConfig
from maipp.training.foresight.losses import Scores, batch_loss
from maipp.training.foresight.samples import FittedFamilies, ForesightExample, draw_batch, kinds
from maipp.typing import Array, Int

# Part of the run in which the rate rises, and what it falls to.
_RISE, _END = 0.02, 0.02

# The running mean of the weights begins as the mean of all so far.
_YOUNG = 10.0


class FitState(eqx.Module):
    """Everything of a training run that changes: a pytree of arrays."""

    model: FieldModel  # what gradients change
    average: FieldModel  # what is kept: its running mean
    optimiser: Any  # optax state
    updates: Int[Array, ""]  # done so far


class ForesightLearner:
    """Updates a model as its configuration says; step i of a seed draws the same samples in any life of the run."""

    def __init__(self, config: ForesightConfig, routes: Routes) -> None:
        self.config, self.kinds = config, kinds(config)
        self.routes = jax.tree.map(jnp.asarray, routes)
        self._optimiser = optimiser(config)
        self._draw, self._step = jax.jit(self._draws), jax.jit(self._steps)

    def initial(self) -> FitState:
        """The state before the first update, from the seed alone."""
        config = self.config
        model = FieldModel(jax.random.key(config.seed), width=config.width, depth=config.blocks)
        network: Any = model.network
        return FitState(model, model, self._optimiser.init(network), jnp.zeros((), jnp.int32))

    def update(self, state: FitState) -> tuple[FitState, dict[str, Array]]:
        """One update of `steps` gradient steps, and its metrics."""
        first, rows = int(state.updates) * self.config.steps, []
        # Step by step: inside of a compiled loop the convolutions of a CPU take ten times as long.
        for number in range(first, first + self.config.steps):
            batch = self._draw(jnp.int32(number), self.routes, self.kinds)
            state, row = self._step(state, batch, jnp.int32(number))
            rows.append(row)
        metrics = {name: jnp.mean(jnp.stack([row[name] for row in rows])) for name in rows[0]}
        metrics["learning_rate"] = rows[-1]["learning_rate"]
        return eqx.tree_at(lambda s: s.updates, state, state.updates + 1), metrics

    def _draws(self, number: Int[Array, ""], routes: Routes, kinds: FittedFamilies) -> list[ForesightExample]:
        """The batch of a gradient step."""
        key = jax.random.fold_in(jax.random.fold_in(jax.random.key(self.config.seed), 1), number)
        return draw_batch(self.config, routes, kinds, key, self.config.batch)

    def _steps(
        self, state: FitState, batch: list[ForesightExample], number: Int[Array, ""]
    ) -> tuple[FitState, dict[str, Array]]:
        """One gradient step."""
        config, model = self.config, state.model
        trained: Any = model.network

        def loss(network: FieldNetwork) -> tuple[Array, Scores]:
            return batch_loss(eqx.tree_at(lambda m: m.network, model, network), batch, config)

        (value, scores), slope = jax.value_and_grad(loss, has_aux=True)(trained)
        changes, rest = self._optimiser.update(slope, state.optimiser, trained)
        network = optax.apply_updates(trained, changes)
        decay = jnp.minimum(config.average, (1.0 + number) / (_YOUNG + number))
        mean = jax.tree.map(lambda a, b: decay * a + (1.0 - decay) * b, state.average.network, network)
        after = FitState(
            eqx.tree_at(lambda m: m.network, model, network),
            eqx.tree_at(lambda m: m.network, state.average, mean),
            rest,
            state.updates,
        )
        return after, {
            "loss": value,
            "nll": scores.nll,
            "area": scores.area,
            "relative": scores.relative,
            "gradient_norm": optax.tree.norm(slope),
            "learning_rate": jnp.asarray(_rate(config)(number)),
        }


def _rate(config: ForesightConfig) -> optax.Schedule:
    total = config.gradient_steps
    return optax.warmup_cosine_decay_schedule(
        0.0, config.learning_rate, max(1, int(_RISE * total)), max(2, total), _END * config.learning_rate
    )


def optimiser(config: ForesightConfig) -> optax.GradientTransformation:
    """AdamW with gradients scaled down to a norm, its rate rising and falling over the run."""
    return optax.chain(
        optax.clip_by_global_norm(config.gradient_norm),
        optax.adamw(_rate(config), weight_decay=config.weight_decay),
    )
