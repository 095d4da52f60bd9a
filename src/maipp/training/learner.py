"""The learner: sampling and gradient steps of one update in one compiled function, split over devices."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax import lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from maipp.errors import InputError
from maipp.planners.intent import IntentPlanner
from maipp.planners.sga_catnipp import SgaCatnipp
from maipp.policy import PolicyNetwork, network_named
from maipp.training.config import TrainConfig
from maipp.training.losses import PolicyExample, sample_loss
from maipp.training.returns import returns
from maipp.training.rollout import Phase, RolloutState, new_environment, roll_out
from maipp.training.search import PolicyPlanner
from maipp.training.worlds import Bank, draw_bank, training_scenario
from maipp.typing import Array, Float, Int, Key

_WHOLE, _SPLIT = PartitionSpec(), PartitionSpec("devices")
_AXES = ("devices", "shards")  # gradients are averaged over both

# Decisions whose gradient a CPU core computes together: their activations fill its cache. An accelerator takes all.
_CPU_CHUNK = 8

# How often the search's best path is followed while learning from it; else the policy, so that it learns to recover.
_FOLLOW = 0.7


class Shard(NamedTuple):
    """What one shard carries from update to update."""

    environments: RolloutState  # leading axis: missions
    key: Key


class TrainState(eqx.Module):
    """Everything of a training run that changes: a pytree of arrays."""

    network: PolicyNetwork
    optimiser: Any  # optax state
    shards: Shard  # leading axis: shards
    updates: Int[Array, ""]  # done so far


class Learner:
    """Updates a policy as its configuration says, on the given devices (one, unless told)."""

    def __init__(self, config: TrainConfig, devices: Sequence[Any] | None = None) -> None:
        """Raises InputError where the shards cannot be split evenly over the devices."""
        self.config = config
        self.devices = list(devices) if devices is not None else jax.local_devices()[:1]
        if config.shards % len(self.devices):
            raise InputError(
                f"training: shards: {config.shards} do not split over {len(self.devices)} devices; give a multiple"
            )
        self.scenario = training_scenario(config)
        fresh = self._first_network()
        self.bank = draw_bank(config, self.scenario, fresh.encoding_dimensions)
        self.mesh = Mesh(np.asarray(self.devices), ("devices",))
        self._optimiser = _optimiser(config)
        self._update = {phase: self._compile(phase) for phase in get_args(Phase)}

    def _first_network(self) -> PolicyNetwork:
        """The network to begin with."""
        use_intent = self.config.policy == "ti"
        if not self.config.start:
            return PolicyNetwork(jax.random.fold_in(jax.random.key(self.config.seed), 0), use_intent=use_intent)
        network = network_named(self.config.start)
        if network.use_intent != use_intent:
            raise InputError(f"training: start: {self.config.start} is not for policy {self.config.policy}")
        return network

    def planner(self, network: PolicyNetwork, phase: Phase = "reinforce") -> PolicyPlanner:
        """The planner whose behaviour is trained."""
        if self.config.policy == "ti":
            config = self.config
            options = {"paths": config.paths, "steps": config.steps, "share": config.share, "choose": "sample"}
            if phase == "search":
                options |= {"paths": config.search_paths, "share": "best", "rank": "expected"}
            return IntentPlanner.of(self.scenario, network=network, **options)
        return SgaCatnipp.of(self.scenario, network=network, choose="sample")

    def initial(self) -> TrainState:
        """The state before the first update, from `config.seed` alone."""
        key = jax.random.key(self.config.seed)
        network = self._first_network()
        planner = self.planner(network)

        def shard(key: Key) -> Shard:
            new = partial(new_environment, self.config, self.scenario, planner, self.bank)
            return Shard(jax.vmap(new)(jax.random.split(key, self.config.missions)), jax.random.fold_in(key, 1))

        keys = jax.random.split(jax.random.fold_in(key, 1), self.config.shards)
        split, whole = NamedSharding(self.mesh, _SPLIT), NamedSharding(self.mesh, _WHOLE)
        shards = jax.jit(jax.vmap(shard), out_shardings=split)(keys)
        # A copy: updates give away the buffers of the state, which must not be those of weights kept elsewhere.
        network = jax.tree.map(lambda a: jnp.array(a, copy=True), network)
        rest = jax.jit(lambda n: (n, self._optimiser.init(n), jnp.zeros((), jnp.int32)), out_shardings=whole)(network)
        return TrainState(rest[0], rest[1], shards, rest[2])

    def update(self, state: TrainState) -> tuple[TrainState, dict[str, Array]]:
        """One update: sample with the policy as it is, then take gradient steps; with the metrics of both."""
        return self._update[self._phase(int(state.updates))](state, self.bank)

    def _phase(self, updates: int) -> Phase:
        """What the next update learns from, `updates` being done."""
        if updates < self.config.imitation:
            return "imitate"
        return "search" if updates >= self.config.updates - self.config.search else "reinforce"

    def _compile(self, phase: Phase) -> Any:
        """The compiled update of a phase."""

        def on_device(parts: tuple[Any, ...], bank: Bank) -> tuple[tuple[Any, ...], dict[str, Array]]:
            network, optimiser, shards, updates = parts
            one = partial(self._update_shard, bank, phase, network, optimiser, updates)
            spread = jax.vmap(one, axis_name="shards", out_axes=(None, None, 0, None))
            network, optimiser, shards, metrics = spread(shards)
            return (network, optimiser, shards, updates + 1), metrics

        layout = (_WHOLE, _WHOLE, _SPLIT, _WHOLE)
        mapped = jax.shard_map(
            on_device, mesh=self.mesh, in_specs=(layout, _WHOLE), out_specs=(layout, _WHOLE), check_vma=False
        )

        def update(state: TrainState, bank: Bank) -> tuple[TrainState, dict[str, Array]]:
            parts, metrics = mapped((state.network, state.optimiser, state.shards, state.updates), bank)
            return TrainState(*parts), metrics

        return jax.jit(update, donate_argnums=0)

    def _update_shard(
        self,
        bank: Bank,
        phase: Phase,
        network: PolicyNetwork,
        optimiser: Any,
        updates: Int[Array, ""],
        shard: Shard,
    ) -> tuple[PolicyNetwork, Any, Shard, dict[str, Array]]:
        """One shard's part of an update; what it returns of network, optimiser and metrics is the same for all."""
        config = self.config
        key, roll_key, shuffle_key = jax.random.split(shard.key, 3)
        follow = jnp.maximum(0.0, 1.0 - 2.0 * updates / max(1, config.imitation)) if phase == "imitate" else _FOLLOW
        environments, transitions = roll_out(
            config, self.scenario, self.planner(network, phase), bank, shard.environments, roll_key, phase, follow
        )
        worth = returns(config, transitions, self.scenario.agents)
        advantage = _normalised(worth.advantage, worth.valid)
        samples = PolicyExample(transitions, advantage, worth.target, worth.valid)
        flat = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), samples)

        def epoch(carry: Any, key: Key) -> tuple[Any, dict[str, Array]]:
            order = jax.random.permutation(key, flat.advantage.shape[0])
            batches = order.reshape(config.minibatches, config.minibatch)
            return lax.scan(lambda c, index: self._gradient_step(bank, phase, flat, c[0], c[1], index), carry, batches)

        keys = jax.random.split(shuffle_key, config.epochs)
        (network, optimiser), metrics = lax.scan(epoch, (network, optimiser), keys)
        metrics = jax.tree.map(jnp.mean, metrics)
        ended = lax.psum(jnp.sum(transitions.ended), _AXES)
        final = lax.psum(jnp.sum(jnp.where(transitions.ended, transitions.trace, 0.0)), _AXES)
        metrics["final_trace"] = jnp.where(ended > 0, final / jnp.maximum(ended, 1), jnp.nan)
        metrics["missions_ended"] = ended
        metrics["learning_rate"] = jnp.asarray(_schedule(config)(updates * config.epochs * config.minibatches))
        return network, optimiser, Shard(environments, key), metrics

    def _gradient_step(
        self,
        bank: Bank,
        phase: Phase,
        samples: PolicyExample,
        network: PolicyNetwork,
        optimiser: Any,
        index: Int[Array, " b"],
    ) -> tuple[tuple[PolicyNetwork, Any], dict[str, Array]]:
        """One step along the gradient averaged over the minibatches of all shards."""
        size = math.gcd(_CPU_CHUNK, len(index)) if self.devices[0].platform == "cpu" else len(index)

        def loss(network: PolicyNetwork, chunk: Array) -> tuple[Float[Array, ""], dict[str, Array]]:
            picked = jax.tree.map(lambda a: a[chunk], samples)
            losses, parts = jax.vmap(lambda s: sample_loss(self.config, network, bank, s, phase))(picked)
            return jnp.mean(losses), jax.tree.map(jnp.mean, parts)

        def add(total: Any, chunk: Array) -> tuple[Any, None]:
            return jax.tree.map(jnp.add, total, jax.grad(loss, has_aux=True)(network, chunk)), None

        chunks = index.reshape(-1, size)
        zero = jax.tree.map(
            lambda a: jnp.zeros(a.shape, a.dtype), jax.eval_shape(jax.grad(loss, has_aux=True), network, chunks[0])
        )
        total, _ = lax.scan(add, zero, chunks)
        gradient, parts = lax.pmean(jax.tree.map(lambda a: a / len(chunks), total), _AXES)
        weights: Any = network  # optax knows no modules, only pytrees
        change, optimiser = self._optimiser.update(gradient, optimiser, weights)
        parts["gradient_norm"] = optax.tree.norm(gradient)
        moved: Any = optax.apply_updates(weights, change)
        return (moved, optimiser), parts


def _normalised(advantage: Float[Array, "t e"], valid: Array) -> Float[Array, "t e"]:
    """Advantages with zero mean and unit variance over all valid decisions of all shards."""
    count = jnp.maximum(lax.psum(jnp.sum(valid), _AXES), 1)
    mean = lax.psum(jnp.sum(jnp.where(valid, advantage, 0.0)), _AXES) / count
    variance = lax.psum(jnp.sum(jnp.where(valid, (advantage - mean) ** 2, 0.0)), _AXES) / count
    return jnp.where(valid, (advantage - mean) * lax.rsqrt(variance + 1e-8), 0.0)


def _schedule(config: TrainConfig) -> optax.Schedule:
    """Learning rate by gradient steps taken; the search has a schedule of its own."""
    before = (config.updates - config.search) * config.epochs * config.minibatches
    after = config.gradient_steps - before
    parts = [
        _part(config, rate, max(1, steps))
        for rate, steps in ((config.learning_rate, before), (config.search_rate, after))
    ]
    return optax.join_schedules(parts, [before])


def _part(config: TrainConfig, rate: float, steps: int) -> optax.Schedule:
    """Learning rate by gradient steps taken of `steps`, from `rate` on."""
    if config.schedule == "cosine":
        return optax.cosine_decay_schedule(rate, steps, alpha=0.02)
    if config.schedule == "steps":  # Yang et al. 2023, Sec. IV-E: once per training step, which has several of Adam's
        return optax.exponential_decay(rate, 32 * config.epochs * config.minibatches, 0.96, staircase=True)
    return optax.constant_schedule(rate)


def _optimiser(config: TrainConfig) -> optax.GradientTransformation:
    return optax.chain(optax.clip_by_global_norm(config.gradient_norm), optax.adam(_schedule(config)))
