"""A slice of what `run.py` does, on every run of the tests; and the harness can find what it looks for."""

import math
from pathlib import Path

import numpy as np
import pytest
from fuzz_check import Failure, Target, check, not_finite, working_folder
from fuzz_mutate import malformed
from fuzz_targets import TARGETS

from maipp.errors import InputError


@pytest.fixture
def folder():
    with working_folder() as name:
        yield Path(name)


@pytest.mark.filterwarnings("ignore")  # NumPy and Python warn of what they find in broken headers
@pytest.mark.parametrize("name", TARGETS)
def test_readers_accept_or_tell_in_one_line(name, folder):
    target = TARGETS[name]
    seeds = target.seeds()
    accepted = [check(target, malformed(seeds, number, target.tokens), folder) for number in range(target.slice)]
    assert sum(accepted) < len(accepted) / 2  # most of them are malformed indeed


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_are_good_input(name, folder):
    target = TARGETS[name]
    answers = [check(target, seed, folder) for seed in target.seeds()]
    assert sum(answers) >= 1 and (all(answers) or name == "scenario")  # one scenario is a trap, not a good one


def test_the_same_number_gives_the_same_input():
    seeds = [b'{"a": [1, 2.5, "x"]}', b"a,b\n1,2\n"]
    inputs = [malformed(seeds, number) for number in range(300)]
    assert inputs == [malformed(seeds, number) for number in range(300)]
    assert len(set(inputs)) > 250 and all(text not in seeds for text in inputs[:1])


def told(message):
    def read(path):
        raise InputError(message.format(path=path))

    return read


def leaves_a_file(path):
    path.with_name("half-written").write_text("x")


def breaks(path):
    raise KeyError("x")


@pytest.mark.parametrize(
    ("read", "found"),
    [
        (breaks, "KeyError"),
        (leaves_a_file, r"left behind: \['half-written'\]"),
        (lambda path: {"a": [1.0, math.nan]}, r"dict\['a'\]\[1\] is not finite"),
        (lambda path: np.array([1.0, np.inf]), "ndarray is not finite"),
        (told("something is wrong"), "does not name the file"),
        (told(""), "not one plain line"),
    ],
)
def test_the_harness_finds(read, found, folder):
    with pytest.raises(Failure, match=found):
        check(Target(".txt", read, lambda: [b"x"]), b"x", folder)


def test_numbers_in_dataclasses_are_looked_at():
    from maipp.scenario import Scenario

    assert not_finite(Scenario(), "s") is None
    broken = Scenario()
    object.__setattr__(broken, "beta", math.inf)
    assert not_finite(broken, "s") == "s.beta"
