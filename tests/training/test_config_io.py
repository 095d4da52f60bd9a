"""Configurations by name, from files and from the command line; errors say where and what."""

import pytest

from maipp.errors import InputError
from maipp.training.config import NAMED, TrainConfig
from maipp.training.config_io import (
    config_to_dict,
    dump_config,
    find_config,
    load_config,
    override,
    parse_config,
)


@pytest.mark.parametrize("name", NAMED)
def test_names_and_files_give_the_same(tmp_path, name):
    config = find_config(name)
    assert config == NAMED[name]
    path = tmp_path / "own.yaml"
    path.write_text(dump_config(config))
    assert find_config(str(path)) == load_config(path) == config
    assert TrainConfig(**config_to_dict(config)) == config


def test_keys_left_out_are_those_of_the_default():
    text = "learning_rate: 3e-5\nbudget: [2, 3.5]\npolicy: sga-catnipp\n"
    expected = NAMED["default"].replace(learning_rate=3e-5, budget=(2.0, 3.5), policy="sga-catnipp")
    config = parse_config(text)
    assert config == expected and all(isinstance(end, float) for end in config.budget)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("seed: 1\nlearning_rat: 1", "own.yaml:2: learning_rat: no such key; did you mean learning_rate\\?"),
        ("seed: 1\nseed: 2", "own.yaml:2: seed: given twice, first on line 1"),
        ("\nupdates: many", "own.yaml:2: updates: 'many' is not a whole number >= 1"),
        ("updates: 1.5", "own.yaml:1: updates: 1.5 is not a whole number"),
        ("budget: 3", "own.yaml:1: budget: 3 is not \\[low, high\\] with 0 < low"),
        ("policy: di", "own.yaml:1: policy: 'di' is not one of ti, sga-catnipp"),
        ("updates: 0", "own.yaml:1: updates: 0 is not a whole number >= 1"),
        ("minibatch: 7", "own.yaml:1: minibatch: 7; give a divisor"),
        ("- 1", "own.yaml:1: not a mapping"),
        ("seed: [", "own.yaml:1: not valid YAML"),
        ("", "own.yaml: empty"),
    ],
)
def test_what_is_wrong_in_a_file_is_said_on_one_line(text, says):
    with pytest.raises(InputError, match=says) as caught:
        parse_config(text, source="own.yaml")
    assert "\n" not in str(caught.value) and "scenario" not in str(caught.value)


def test_values_are_overridden():
    config = override(NAMED["smoke"], ["seed=4", "learning-rate = 1e-4", "budget=1,2"])
    assert config == NAMED["smoke"].replace(seed=4, learning_rate=1e-4, budget=(1.0, 2.0))


@pytest.mark.parametrize(
    ("items", "says"),
    [
        (["seed"], "--set seed: not an assignment; give KEY=VALUE"),
        (["seed=1", "seed=2"], "--set seed: given twice"),
        (["sed=1"], "--set: sed: no such key; did you mean seed\\?"),
        (["seed=x"], "--set: seed: 'x' is not a whole number"),
        (["seed=-1"], "--set: seed: '-1' is not a whole number from 0 to 3294967295"),
    ],
)
def test_a_wrong_override_is_named(items, says):
    with pytest.raises(InputError, match=says):
        override(TrainConfig(), items)


def test_neither_a_name_nor_a_file(tmp_path):
    with pytest.raises(InputError, match="--config smok: no such configuration; there are default, paper, smoke"):
        find_config("smok")
    with pytest.raises(InputError, match="missing.yaml: cannot read the configuration"):
        find_config(str(tmp_path / "missing.yaml"))
    (tmp_path / "binary.yaml").write_bytes(b"seed: \xff")
    with pytest.raises(InputError, match="not UTF-8"):
        find_config(str(tmp_path / "binary.yaml"))
