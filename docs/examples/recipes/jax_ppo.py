"""PPO in one compiled program on `maipp.Environment`, in the manner of CleanRL: everything is in this file.

A network scores each neighbour by the same few layers, from what the robot sees of itself and of that neighbour.
"""

import argparse
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax

import maipp
from maipp.environments import CANDIDATE, OWN, Environment

SCENARIO = maipp.Scenario(agents=3, budget=2.0, grid=15, nodes=60, neighbours=10)
WORLDS, STEPS, EPOCHS, BATCHES = 64, 64, 4, 8  # worlds stepped together, decisions of each, passes, minibatches
GAMMA, LAMBDA, CLIP, ENTROPY = 0.99, 0.95, 0.2, 0.01


def new_weights(key: jax.Array, width: int = 64) -> dict[str, jax.Array]:
    """Two layers and a score for each neighbour; two layers and a value for all of them together."""
    inputs = len(OWN) + len(CANDIDATE)
    shapes = {"w1": (inputs, width), "w2": (width, width), "score": (width, 1), "value": (width, 1)}
    keys = jax.random.split(key, len(shapes))
    gain = {"score": 0.01}  # near even odds at first
    pairs = zip(keys, shapes.items(), strict=True)
    weights = {name: gain.get(name, 1.0) * jax.random.normal(k, s) / s[0] ** 0.5 for k, (name, s) in pairs}
    return weights | {"b1": jnp.zeros(width), "b2": jnp.zeros(width)}


def network(weights: dict[str, jax.Array], vector: jax.Array, mask: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Logits of the neighbours (k,), masked, and the value of an observation (d,)."""
    k = mask.shape[-1]
    candidates = vector[-k * len(CANDIDATE) :].reshape(k, len(CANDIDATE))
    own = jnp.broadcast_to(vector[: len(OWN)], (k, len(OWN)))
    hidden = jnp.tanh(jnp.concatenate([own, candidates], axis=-1) @ weights["w1"] + weights["b1"])
    hidden = jnp.tanh(hidden @ weights["w2"] + weights["b2"])
    logits = jnp.where(mask, (hidden @ weights["score"])[:, 0], -1e9)
    return logits, (hidden.mean(axis=0) @ weights["value"])[0]


class Step(NamedTuple):
    """One decision of every world."""

    vector: jax.Array
    mask: jax.Array
    action: jax.Array
    log_probability: jax.Array
    value: jax.Array
    reward: jax.Array
    done: jax.Array
    read: jax.Array  # whether the action was read: not in the last turn of a robot


def collect(env: Environment, params: Any, weights: Any, carry: Any, key: jax.Array) -> tuple[Any, Step, jax.Array]:
    """`STEPS` decisions of all worlds, and the values where they end."""

    def one(carry: Any, key: jax.Array) -> tuple[Any, Step]:
        state, seen, ended = carry
        logits, value = jax.vmap(network, (None, 0, 0))(weights, seen.vector, seen.action_mask)
        action = jax.random.categorical(key, logits)
        log_probability = jnp.take_along_axis(jax.nn.log_softmax(logits), action[:, None], 1)[:, 0]
        state, new, reward, done, info = jax.vmap(env.step, (0, 0, None))(state, action, params)
        step = Step(seen.vector, seen.action_mask, action, log_probability, value, reward, done, ~ended)
        return (state, new, info.ended), step

    carry, steps = jax.lax.scan(one, carry, jax.random.split(key, STEPS))
    return carry, steps, jax.vmap(network, (None, 0, 0))(weights, carry[1].vector, carry[1].action_mask)[1]


def advantages(steps: Step, last: jax.Array) -> jax.Array:
    """Generalised advantage estimates (steps, worlds)."""

    def back(carry: Any, step: Step) -> tuple[Any, jax.Array]:
        advantage, value = carry
        going = 1.0 - step.done
        delta = step.reward + GAMMA * going * value - step.value
        advantage = delta + GAMMA * LAMBDA * going * advantage
        return (advantage, step.value), advantage

    return jax.lax.scan(back, (jnp.zeros_like(last), last), steps, reverse=True)[1]


def loss(weights: Any, steps: Step, advantage: jax.Array, target: jax.Array) -> jax.Array:
    """Clipped policy loss, value loss and entropy of a minibatch."""
    logits, value = jax.vmap(network, (None, 0, 0))(weights, steps.vector, steps.mask)
    log = jax.nn.log_softmax(logits)
    ratio = jnp.exp(jnp.take_along_axis(log, steps.action[:, None], 1)[:, 0] - steps.log_probability)
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    policy = -jnp.minimum(ratio * advantage, jnp.clip(ratio, 1 - CLIP, 1 + CLIP) * advantage)
    entropy = -jnp.sum(jnp.exp(log) * jnp.where(steps.mask, log, 0.0), axis=-1)
    return jnp.mean(jnp.where(steps.read, policy - ENTROPY * entropy, 0.0)) + 0.5 * jnp.mean((value - target) ** 2)


def train(scenario: maipp.Scenario, updates: int, seed: int = 0) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Weights after so many updates, and the mean reward of a decision in each."""
    env = Environment(scenario, reward="log-trace")
    params = env.params(seed=seed + 1_000_000, worlds=256)
    optimiser = optax.chain(optax.clip_by_global_norm(0.5), optax.adam(1e-3))
    key = jax.random.key(seed)
    weights = new_weights(key)
    state, seen = jax.jit(jax.vmap(env.reset, (0, None)))(jax.random.split(key, WORLDS), params)
    size = WORLDS * STEPS // BATCHES

    @jax.jit
    def update(everything: Any, key: jax.Array, params: Any) -> tuple[Any, jax.Array]:
        weights, momentum, carry = everything
        sample_key, *keys = jax.random.split(key, 1 + EPOCHS)
        carry, steps, last = collect(env, params, weights, carry, sample_key)
        advantage = advantages(steps, last)
        flat = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), (steps, advantage, advantage + steps.value))
        orders = jnp.concatenate([jax.random.permutation(k, WORLDS * STEPS) for k in keys]).reshape(-1, size)

        def learn(carry: Any, order: jax.Array) -> tuple[Any, None]:
            weights, momentum = carry
            slope = jax.grad(loss)(weights, *jax.tree.map(lambda a: a[order], flat))
            change, momentum = optimiser.update(slope, momentum)
            return (optax.apply_updates(weights, change), momentum), None

        (weights, momentum), _ = jax.lax.scan(learn, (weights, momentum), orders)
        return (weights, momentum, carry), steps.reward.mean()

    everything = weights, optimiser.init(weights), (state, seen, jnp.zeros(WORLDS, bool))
    rewards = []
    for number in range(updates):
        everything, reward = update(everything, jax.random.fold_in(key, number), params)
        rewards.append(float(reward))
    return {name: np.asarray(array) for name, array in everything[0].items()}, np.array(rewards)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--updates", type=int, default=60, help="updates of 4,096 decisions each")
    parser.add_argument("--out", default="policy.npz", help="file for the weights")
    arguments = parser.parse_args()
    weights, rewards = train(SCENARIO, arguments.updates)
    print(f"mean reward of a decision: {rewards[:3].mean():.3f} at first, {rewards[-3:].mean():.3f} at last")
    np.savez(arguments.out, **weights)


if __name__ == "__main__":
    main()
