"""A planner that does not answer as it owes to is told so in one line, and where it is."""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from maipp.engine import Decision, Planner, draw_missions, reset
from maipp.engine.rollout import step
from maipp.errors import InputError
from tests.engine.conftest import RECORDED

KEY = jax.random.key(0)


class Wanderer(Planner):
    """Answers as it owes to; its message and memory are a position and a count."""

    def empty_message(self):
        return {"place": jnp.zeros(2)}

    def initial_memory(self):
        return jnp.zeros((), jnp.int32)

    def decide(self, key, observation, memory):
        return Decision(observation.position[None] + 0.1, {"place": observation.position}, memory + 1)


class PythonIf(Wanderer):
    def decide(self, key, observation, memory):
        if observation.remaining < 1:  # here
            return Decision(observation.position[None], {"place": observation.position}, memory)
        return super().decide(key, observation, memory)


class Nothing(Wanderer):
    def decide(self, key, observation, memory):
        return observation.position


class Corners(Wanderer):
    def decide(self, key, observation, memory):
        return Decision(jnp.zeros((3, 2)), {"place": observation.position}, memory)


class Message(Wanderer):
    def decide(self, key, observation, memory):
        return Decision(observation.position[None], jnp.zeros(3), memory)


class Wide(Wanderer):
    def decide(self, key, observation, memory):
        return Decision(observation.position[None], {"place": jnp.zeros(3)}, memory)


class Memory(Wanderer):
    def decide(self, key, observation, memory):
        return Decision(observation.position[None], {"place": observation.position}, memory + 0.5)


@pytest.fixture(scope="module")
def missions():
    return draw_missions(RECORDED, seed=1, instances=2, roadmaps=False)


def answer(kind, missions):
    """The shapes of the state after one decision: nothing is compiled."""
    planner, mission = kind(RECORDED), jax.tree.map(lambda a: a[0], missions)
    return eqx.filter_eval_shape(step, planner, mission, reset(planner, mission), KEY)


@pytest.mark.parametrize(
    ("kind", "right"),
    [
        (PythonIf, "`if observation.remaining < 1:  # here`: Python needs a value that is only known once"),
        (Nothing, "decide owes a maipp.Decision; it gave a"),
        (Corners, "decide owes waypoints of shape (1, 2); they have (3, 2); or set waypoints_per_decision"),
        (Message, "a message of the structure of empty_message(), {place: float32[2]}; it is float32[3]"),
        (Wide, "a message like empty_message(), {place: float32[2]}; it is {place: float32[3]}"),
        (Memory, "decide owes a memory like initial_memory(), int32[]; it is float32[]"),
    ],
)
def test_one_line_says_what_decide_owes_and_where_it_is(kind, right, missions):
    with pytest.raises(InputError) as error:
        answer(kind, missions)
    told = str(error.value)
    line = kind.decide.__code__.co_firstlineno
    assert told.startswith(f"planner {kind.__name__} ({Path(__file__)}:{line}): ") and right in told
    assert "\n" not in told


def test_who_answers_as_it_owes_to_is_let_be(missions):
    assert answer(Wanderer, missions).memory.shape == (RECORDED.agents,)
