"""What must hold of the policy network whatever its weights."""

import ast
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import maipp.policy
from maipp.errors import InputError
from maipp.policy import Memory, PolicyNetwork
from maipp.policy.attention import LOGIT_BOUND

SEEDS = (0, 1, 2)
TOLERANCE = 1e-4


def alike(found, expected):
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=TOLERANCE, atol=TOLERANCE)


def differ(first, second):
    return not np.allclose(first, second, rtol=TOLERANCE, atol=TOLERANCE)


@pytest.fixture(scope="session")
def gradient(run):
    """The gradient of (log-probability of the likeliest neighbour + value) by network and inputs, compiled."""

    def objective(parts, fixed):
        network, features, std, memory = parts
        _, logits, value, _ = run(network, {**fixed, "features": features, "std": std}, memory)
        return jnp.max(jax.nn.log_softmax(logits)) + value

    compiled = eqx.filter_jit(eqx.filter_grad(objective))

    def of(network, seen):
        features, std = jnp.asarray(seen["features"]), jnp.asarray(seen["std"])
        fixed = {name: array for name, array in seen.items() if name not in ("features", "std")}
        return compiled((network, features, std, network.initial_memory()), fixed)

    return of


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_of_nodes_does_not_matter(network, draw, run, seed):
    seen = draw(seed)
    seen["valid"] = np.arange(12) != (seen["current"] + 1) % 12
    embeddings, logits, value, memory = run(network, seen)
    order = np.random.default_rng(seed).permutation(12)
    place = np.argsort(order).astype(np.int32)
    shuffled = seen | {name: seen[name][order] for name in ("features", "encoding", "valid")}
    shuffled |= {name: place[seen[name]] for name in ("current", "neighbours")}
    found = run(network, shuffled)
    alike(found[0], embeddings[order])
    alike(found[1:], (logits, value, memory))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_of_neighbours_does_not_matter(network, draw, run, seed):
    seen = draw(seed)
    order = np.random.default_rng(seed).permutation(5)
    shuffled = seen | {name: seen[name][order] for name in ("neighbours", "allowed", "std")}
    alike(run(network, shuffled)[1], run(network, seen)[1][order])


@pytest.mark.parametrize("seed", SEEDS)
def test_masked_neighbours_have_no_probability_and_no_influence(network, draw, run, gradient, seed):
    seen = draw(seed)
    seen["allowed"][:2] = [True, False]
    masked = ~seen["allowed"]
    _, logits, value, _ = run(network, seen)
    assert (np.asarray(jax.nn.softmax(logits))[masked] == 0).all()
    assert (np.abs(np.asarray(logits)[~masked]) <= LOGIT_BOUND).all()
    # Whatever stands in a masked slot, an index out of range and a NaN included.
    other = seen | {"std": np.where(masked, np.nan, seen["std"]).astype(np.float32)}
    other["neighbours"] = np.where(masked, 99, seen["neighbours"]).astype(np.int32)
    assert (run(network, other)[1] == logits).all() and run(network, other)[2] == value
    for inputs in (seen, other):
        parts = gradient(network, inputs)
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(parts))
        assert (np.asarray(parts[2])[masked] == 0).all()


def test_allowed_neighbours_have_a_gradient(network, draw, gradient):
    seen = draw(0)
    seen["allowed"][:] = True
    assert (np.asarray(gradient(network, seen)[2]) != 0).all()


def test_without_an_allowed_neighbour_all_is_defined(network, draw, run, gradient):
    seen = draw(0)
    value, allowed = run(network, seen)[2], np.zeros(5, bool)
    _, logits, found, memory = run(network, seen | {"allowed": allowed})
    assert (logits == -np.inf).all() and found == value
    assert all(np.isfinite(leaf).all() for leaf in memory)
    # Even where the caller takes the logarithm of nothing.
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient(network, seen | {"allowed": allowed})))


@pytest.mark.parametrize("seed", SEEDS)
def test_padding_has_no_influence(network, draw, run, gradient, seed):
    seen = draw(seed)
    expected, padding = run(network, seen), np.arange(15) >= 12
    padded = seen | {"valid": ~padding}
    for name in ("features", "encoding"):
        padded[name] = np.concatenate([seen[name], np.full((3, seen[name].shape[1]), np.nan, np.float32)])
    found = run(network, padded)
    assert (found[0][12:] == 0).all()
    alike((found[0][:12], *found[1:]), expected)
    parts = gradient(network, padded)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(parts))
    assert (np.asarray(parts[1])[12:] == 0).all() and (np.asarray(parts[1])[:12] != 0).any()


def test_no_mask_is_a_mask_of_all(network, draw, run):
    seen = draw(0)
    found, expected = run(network, seen | {"valid": None}), run(network, seen)
    alike(found, expected)


def test_the_trajectory_so_far_matters(network, draw, run):
    seen = draw(0)
    seen["allowed"][:] = True
    memory = run(network, draw(1))[3]
    assert isinstance(memory, Memory)
    first, later = run(network, seen), run(network, seen, memory)
    assert differ(first[1], later[1]) and differ(first[2], later[2]) and differ(first[3].cell, later[3].cell)
    np.testing.assert_array_equal(first[0], later[0])


@pytest.mark.parametrize("name", ["features", "encoding", "current", "std", "remaining", "threshold"])
def test_every_input_matters(network, draw, run, name):
    seen, other = draw(0), draw(3)
    seen["allowed"][:] = True
    changed = seen | {name: other[name] if name != "threshold" else np.float32(0.9)}
    assert differ(run(network, seen)[1], run(network, changed)[1])


def test_intent_matters_if_and_only_if_it_is_used(network, draw, run):
    seen = draw(0)
    changed = seen | {"features": seen["features"] + np.array([0, 0, 0, 0, 1], np.float32)}
    without = PolicyNetwork(jax.random.key(0), **{**network.architecture, "use_intent": False})
    assert differ(run(network, seen)[0], run(network, changed)[0])
    same = (a == b for a, b in zip(*(jax.tree.leaves(run(without, s)) for s in (seen, changed)), strict=True))
    assert all(leaf.all() for leaf in same)


def test_every_weight_has_a_gradient(network, draw, gradient):
    parts = gradient(network, draw(0))
    assert all((np.asarray(leaf) != 0).any() for leaf in jax.tree.leaves(parts[0]))


@pytest.mark.parametrize("sizes", [(12, 5), (30, 8)])
def test_batches_of_any_size(network, draw, run, sizes):
    missions = [draw(seed, *sizes) for seed in SEEDS]
    batch = jax.tree.map(lambda *leaves: np.stack(leaves), *missions)
    found = eqx.filter_jit(eqx.filter_vmap(run, in_axes=(None, 0)))(network, batch)
    assert found[1].shape == (len(SEEDS), sizes[1])
    for index, seen in enumerate(missions):
        one = jax.tree.map(lambda leaf, index=index: leaf[index], found)
        alike(one, run(network, seen))


def test_results_are_float32_whatever_the_inputs(network, draw, run):
    with jax.enable_x64(True):
        seen = draw(0)
        wide = {name: np.float64(a) if np.asarray(a).dtype == np.float32 else a for name, a in seen.items()}
        assert {leaf.dtype for leaf in jax.tree.leaves(run(network, wide))} == {np.dtype(np.float32)}
        made = PolicyNetwork(jax.random.key(0), **network.architecture)
        assert {leaf.dtype for leaf in jax.tree.leaves(made)} == {np.dtype(np.float32)}


def test_a_new_policy_explores(draw, run, network):
    seen = draw(0)
    seen["allowed"][:] = True
    new = PolicyNetwork(jax.random.key(1), **network.architecture)
    np.testing.assert_allclose(jax.nn.softmax(run(new, seen)[1]), 1 / 5, atol=0.05)


def test_a_virtual_step_costs_little_beside_an_encoding():
    """At the paper's sizes (200 nodes, 20 neighbours); a design goal, see the module's docstring."""
    n, k, real = 200, 20, jnp.float32
    network = eqx.filter_eval_shape(PolicyNetwork, jax.random.key(0))
    features, encoding, embeddings = (jax.ShapeDtypeStruct((n, width), real) for width in (5, 32, 128))
    prepared = jax.eval_shape(PolicyNetwork.prepare, network, embeddings)
    index, many = jax.ShapeDtypeStruct((), jnp.int32), jax.ShapeDtypeStruct((k,), jnp.int32)
    allowed, std, number = (jax.ShapeDtypeStruct(*s) for s in (((k,), bool), ((k,), real), ((), real)))
    memory = jax.eval_shape(PolicyNetwork.initial_memory, network)

    def flops(function, *arguments):
        cost = jax.jit(function).lower(network, *arguments).cost_analysis()
        assert cost is not None
        return cost["flops"]

    step = flops(PolicyNetwork.decode, prepared, index, many, allowed, std, number, number, memory)
    assert 0.5e6 < step < 2e6
    assert 80e6 < flops(PolicyNetwork.encode, features, encoding) < 120e6


@pytest.mark.parametrize(
    ("options", "message"),
    [({"width": 10, "heads": 4}, "width is 10 and heads is 4"), ({"encoder_layers": 0}, "encoder_layers is 0")],
)
def test_impossible_sizes_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        PolicyNetwork(jax.random.key(0), **options)


def test_the_policy_needs_little():
    """Weights must run where the rest of maipp does not: on a robot, in another simulator."""
    found = set()
    for path in Path(maipp.policy.__path__[0]).glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            found |= {*names, node.module} if isinstance(node, ast.ImportFrom) else set(names)
    ours = {name for name in found if name.startswith("maipp")}
    assert {name.split(".")[1] for name in ours} == {"errors", "files", "policy", "records", "renamed", "typing"}
    outside = {name.split(".")[0] for name in found - ours}
    assert {"jax", "equinox", "safetensors", "numpy"} <= outside
    assert outside <= {
        "collections",
        "dataclasses",
        "jax",
        "equinox",
        "safetensors",
        "numpy",
        "functools",
        "hashlib",
        "importlib",
        "json",
        "math",
        "os",
        "pathlib",
        "typing",
    }
