"""Weights come back bit for bit, and whatever is wrong with their files is said in one line."""

import hashlib
import json

import equinox as eqx
import jax
import numpy as np
import pytest
from safetensors.numpy import load, save

from maipp.errors import InputError
from maipp.policy import PolicyNetwork, load_weights, save_weights

NAME = "encoder.1.feed_forward.hidden.bias"


@pytest.fixture
def path(tmp_path, network):
    target = tmp_path / "policy.safetensors"
    save_weights(network, target, {"trained": {"steps": 3}})
    return target


def refused(path):
    """The one line with which the files are refused."""
    with pytest.raises(InputError) as error:
        load_weights(path)
    line = str(error.value)
    assert "\n" not in line and str(path.with_suffix("")) in line
    return line.removeprefix(str(path.parent) + "/")


def rewrite(path, change):
    """Change the tensors, and the digest in the card with them."""
    tensors = load(path.read_bytes())
    change(tensors)
    content = save(tensors)
    path.write_bytes(content)
    recard(path, lambda card: card.update(sha256=hashlib.sha256(content).hexdigest()))


def recard(path, change):
    card = json.loads(path.with_suffix(".json").read_text())
    change(card)
    path.with_suffix(".json").write_text(json.dumps(card))


@pytest.mark.parametrize("use_intent", [True, False])
def test_round_trip_is_bitwise(tmp_path, network, use_intent):
    saved = PolicyNetwork(jax.random.key(7), **{**network.architecture, "use_intent": use_intent})
    path = tmp_path / "policy.safetensors"
    save_weights(saved, str(path), {"trained": "yes", "schema": "overwritten"})
    loaded, card = load_weights(str(path))
    assert jax.tree.structure(loaded) == jax.tree.structure(saved)
    for ours, theirs in zip(jax.tree.leaves(loaded), jax.tree.leaves(saved), strict=True):
        assert ours.dtype == theirs.dtype and np.asarray(ours).tobytes() == np.asarray(theirs).tobytes()
    assert card["trained"] == "yes" and card["schema"] == "maipp.policy/1"
    assert card["architecture"] == saved.architecture == loaded.architecture
    assert sorted(p.name for p in tmp_path.iterdir()) == ["policy.json", "policy.safetensors"]
    save_weights(loaded, path, card)
    assert load_weights(path)[1] == card


def test_names_say_where_a_weight_belongs(path):
    names = load(path.read_bytes())
    assert {NAME, "decoder.attention.keys_values.weight", "pointer.std.weight", "embed.bias"} <= set(names)


@pytest.mark.parametrize("kept", [0, 4, 100, -1])
def test_truncated_weights(path, kept):
    path.write_bytes(path.read_bytes()[:kept])
    assert refused(path).startswith("policy.safetensors: not a safetensors file, or cut short")


def test_another_file(path):
    path.write_bytes(b"PK\x03\x04" * 100)
    assert refused(path).startswith("policy.safetensors: not a safetensors file")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.pop(NAME), f"{NAME} is missing"),
        (lambda t: t.update(extra=np.zeros(2, np.float32)), "extra is not a tensor of the architecture"),
        (lambda t: t.update({NAME: np.zeros(3, np.float32)}), f"{NAME} has shape [3]; the architecture"),
        (lambda t: t.update({NAME: np.zeros(64, np.float16)}), f"{NAME} is F16; it must be F32"),
        (lambda t: t.update({NAME: np.full(64, np.nan, np.float32)}), f"{NAME} holds NaN or infinite weights"),
        (lambda t: t.update({NAME: np.full(64, -np.inf, np.float32)}), f"{NAME} holds NaN or infinite weights"),
    ],
)
def test_tensors_that_do_not_fit(path, change, message):
    rewrite(path, change)
    assert refused(path).startswith(f"policy.safetensors: {message}")


def test_weights_of_another_card(path, network):
    before = path.with_suffix(".json").read_bytes()
    save_weights(PolicyNetwork(jax.random.key(9), **network.architecture), path, {})
    path.with_suffix(".json").write_bytes(before)
    assert "not the weights that policy.json describes" in refused(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "1: not JSON, or cut short"),
        ("[" * 10**5, " not JSON that can be read: nested too deeply"),
        (b"\xff\xfe\xfa", " not JSON, which is UTF-8"),
        ("[1]", " [1] is not a mapping"),
        ("{}", " architecture: missing"),
    ],
)
def test_a_card_that_is_none(path, content, message):
    path.with_suffix(".json").write_bytes(content if isinstance(content, bytes) else content.encode())
    assert refused(path).startswith(f"policy.json:{message}")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("sha256"), "sha256: missing"),
        (lambda c: c.pop("architecture"), "architecture: missing"),
        (lambda c: c.update(schema="maipp.policy/9"), "schema: 'maipp.policy/9' is not 'maipp.policy/1'"),
        (lambda c: c.update(architecture=[16]), "architecture: [16] is not a mapping"),
        (lambda c: c["architecture"].pop("heads"), "architecture.heads: missing"),
        (lambda c: c["architecture"].update(depth=2), "architecture.depth: no such key; did you mean width"),
        (
            lambda c: c["architecture"].update(width=16.0),
            "architecture.width: 16.0 is not a whole number from 1 to 8192",
        ),
        (lambda c: c["architecture"].update(width=10**30), "architecture.width: 1000"),
        (
            lambda c: c["architecture"].update(encoder_layers=0),
            "architecture.encoder_layers: 0 is not a whole number from 1 to 64",
        ),
        (lambda c: c["architecture"].update(heads=True), "architecture.heads: True is not"),
        (lambda c: c["architecture"].update(use_intent=1), "architecture.use_intent: 1 is not true or false"),
        (lambda c: c["architecture"].update(heads=3), "architecture: width is 16 and heads is 3"),
    ],
)
def test_a_card_with_a_wrong_key(path, change, message):
    recard(path, change)
    assert refused(path).startswith(f"policy.json: {message}")


def test_an_architecture_that_the_weights_do_not_have(path):
    recard(path, lambda card: card["architecture"].update(width=32))
    assert "has shape" in refused(path)


@pytest.mark.parametrize("name", ["policy.safetensors", "policy.json"])
def test_a_missing_file(path, name):
    (path.parent / name).unlink()
    assert refused(path) == f"{name}: cannot be read: No such file or directory"


def test_a_path_of_another_kind(tmp_path, network):
    for act in (load_weights, lambda path: save_weights(network, path, {})):
        with pytest.raises(InputError, match=r"policy\.json: weights are a \.safetensors file"):
            act(tmp_path / "policy.json")
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_loaded_is_not_saved(path, network):
    before = {p.name: p.read_bytes() for p in path.parent.iterdir()}
    broken = eqx.tree_at(lambda n: n.embed.bias, network, replace_fn=lambda b: b + np.inf)
    with pytest.raises(InputError, match=r"policy\.safetensors: not written: embed\.bias holds NaN"):
        save_weights(broken, path, {})
    for card in ({"loss": float("nan")}, {"array": np.zeros(2)}):
        with pytest.raises(InputError, match=r"policy\.json: not written: the card cannot be JSON"):
            save_weights(network, path, card)
    assert {p.name: p.read_bytes() for p in path.parent.iterdir()} == before
