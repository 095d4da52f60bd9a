"""Pages of results: numbers lose nothing that the error shows, commands say what differs, machines are told once."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.bench.page import code, command, made_on, mean_and_error, three


@given(st.floats(0.01, 900), st.floats(1e-4, 50))
def test_mean_and_error_lose_nothing_that_the_error_shows(mean, se):
    shown_mean, shown_se = map(float, mean_and_error(mean, se).split(" ± "))
    assert abs(shown_mean - mean) <= 0.051 * se
    assert shown_se == pytest.approx(se, rel=0.051)
    assert math.isclose(float(mean_and_error(mean, None)), mean, rel_tol=0.006)


def test_three_digits_without_a_trailing_point():
    assert [three(number) for number in (0.012345, 1.5, 20.0, 123.4)] == ["0.0123", "1.50", "20.0", "123"]


def test_the_command_has_the_flags_that_are_not_as_usual():
    usual = {"seed": 0, "budget": 3.0, "planners": ["a", "b"], "quick": False}
    assert command(["run", "my dir"], usual, usual) == "run 'my dir'"
    given = {"seed": 2, "budget": 0.6, "planners": ["a"], "quick": True, "reference": "b", "page": None}
    assert command(["run"], given, usual) == "run --seed 2 --budget 0.6 --planners a --quick --reference b"
    assert code("a", "b") == "```sh\na\nb\n```"


def test_machines_are_told_once():
    machine = {"cpu": "A processor", "cores": 1, "backend": "cpu", "devices": 2, "precision": "float32"}
    versions = {"maipp": "0.1.0", "jax": "0.10.2", "python": "3.11.7"}
    words = "{}, 1 core, JAX on cpu (2 devices), float32, maipp 0.1.0, jax 0.10.2, Python 3.11.7"
    assert made_on((machine, versions), (machine, versions)) == words.format("A processor")
    both = made_on((machine, versions), (machine | {"cpu": "Another"}, versions))
    assert both == f"{words.format('A processor')}; and on {words.format('Another')}"
