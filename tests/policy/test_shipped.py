"""The networks that ship, by name; files and random weights in their place."""

import jax
import numpy as np
import pytest

import maipp
from maipp.errors import InputError
from maipp.policy import PolicyNetwork, load_policy, network_named, save_weights
from maipp.policy.shipped import SHIPPED, shipped_file


def leaves(network):
    return [np.asarray(leaf) for leaf in jax.tree.leaves(network)]


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_weights_load_under_their_name(name):
    network = load_policy(name)
    assert network is load_policy(name) is network_named(name)  # read once
    assert all(np.isfinite(leaf).all() for leaf in leaves(network))
    assert network.use_intent == (name == "ti")
    assert shipped_file(name).with_suffix(".json").exists()


@pytest.mark.parametrize("name", SHIPPED)
def test_a_copy_without_weights_says_so(name, tmp_path, monkeypatch):
    monkeypatch.setattr("maipp.policy.shipped.files", lambda _: tmp_path)
    with pytest.raises(InputError) as error:
        maipp.load_policy(name)
    assert str(error.value) == (
        f"weights {name!r}: this copy of maipp has none; give a .safetensors file, or untrained"
    )


@pytest.mark.parametrize("name", ["TI", "", "../ti"])
def test_other_names_ship_nothing(name):
    with pytest.raises(InputError, match=r"give ti, sga-catnipp, untrained, or a \.safetensors file"):
        load_policy(name)


def test_untrained_is_the_same_random_network_every_time():
    network, new = network_named("untrained"), PolicyNetwork(jax.random.key(0))
    for one, other in zip(leaves(network), leaves(new), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_file_is_read_anew(tmp_path, network):
    path = tmp_path / "mine.safetensors"
    save_weights(network, path, {})
    loaded = network_named(str(path))
    assert loaded.architecture == network.architecture
    for one, other in zip(leaves(load_policy(path)), leaves(network), strict=True):
        np.testing.assert_array_equal(one, other)
    save_weights(network, tmp_path / "best.safetensors", {})
    assert load_policy(tmp_path).architecture == network.architecture  # a run folder
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(InputError, match=r"mine\.safetensors: not a safetensors file, or cut short"):
        network_named(str(path))


@pytest.mark.parametrize("weights", ["mine.json", "best", ""])
def test_what_names_no_network_is_refused(weights):
    with pytest.raises(InputError, match="give ti, sga-catnipp, untrained, or a .safetensors file"):
        network_named(weights)
