"""The survey as a PettingZoo parallel environment: one step runs to the next arrival; who travels, waits."""

from typing import Any

import jax
import numpy as np
from pettingzoo import ParallelEnv

from maipp.adapters.form import Form
from maipp.adapters.moves import look_all, move, start
from maipp.adapters.survey import RENDER_MODES, Survey
from maipp.engine.mission import Field
from maipp.engine.state import State
from maipp.errors import InputError
from maipp.scenario import Scenario

Answer = tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]


class SurveyParallel(Survey, ParallelEnv):  # type: ignore[misc]  # both declare what the other defines
    """Agents that have arrived act together; those under way are given the mask that allows only to wait.

    Neighbour actions have one more index than neighbours, the last: wait. What an agent under way answers is not read.
    """

    metadata = {"name": "maipp_survey_v0", "render_modes": list(RENDER_MODES)}

    def __init__(
        self,
        scenario: Scenario | None = None,
        *,
        actions: str = "neighbour",
        view: str = "local",
        reward: str = "paper",
        masked: str = "nearest",
        max_cycles: int | None = None,
        field: Field | None = None,
        render_mode: str | None = None,
    ) -> None:
        self._prepare(scenario, Form(actions, view), reward, masked, max_cycles, field, render_mode, extra_moves=1)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Draw a new world; observations and infos of all agents. A seed also decides the worlds that follow."""
        mission = self._fresh(seed)
        self.agents = self.possible_agents[:]
        self._cycle = 0
        self._decided = [0] * self.scenario.agents
        self._leaving: list[int] = []
        self._state = start(self.scenario, mission)
        self._look()
        for index in np.flatnonzero(self._due):
            self._gain(int(index), float(self._views[index].trace), ended=False)
        self._render_if_watched()
        return self._seen(self.agents)

    def _look(self) -> None:
        """See who arrives next and what everybody sees then."""
        time, due, views = look_all(self.scenario, self.form, self._mission, self._state)
        self._time, self._due, views = jax.device_get((time, due, views))
        self._views = [jax.tree.map(lambda a, i=i: a[i], views) for i in range(self.scenario.agents)]

    def _move(self, index: int, choice: np.ndarray, stop: bool) -> None:
        self._state = move(
            self.scenario, self.form, self._mission, self._state, np.int32(index), choice, np.bool_(stop)
        )

    def step(self, actions: dict[str, Any]) -> Answer:
        """What all agents do until somebody arrives next. Only the actions of agents that have arrived are read.

        Raises InputError where one of those is missing or no action; the environment is as it was.
        """
        if not self.agents:
            return {}, {}, {}, {}, {}
        acting = [self._index[name] for name in self.agents if self._due[self._index[name]]]
        choices = {}
        for index in acting:
            name = self.possible_agents[index]
            if name not in actions:
                raise InputError(f"{name}: no action, but it has arrived and must decide")
            choices[index] = self._choice(name, actions[name], self._views[index])
        staying = [index for index in acting if self._stays(choices[index], self._views[index])]
        for index in sorted([*acting, *self._leaving]):
            self._move(index, choices.get(index, self._nowhere), index not in choices or index in staying)
        for index in acting:
            self._decided[index] += 1
        self._cycle += 1

        was = self.agents
        terminations, truncations = dict.fromkeys(was, False), dict.fromkeys(was, False)
        rewards = dict.fromkeys(was, 0.0)
        ended = [self.possible_agents[index] for index in staying]
        for name in ended:
            index = self._index[name]
            terminations[name] = True
            rewards[name] = self._gain(index, float(self._views[index].trace), ended=True)
        while True:  # until somebody can decide, or all have ended
            self._look()
            self._leaving = []
            for index in map(int, np.flatnonzero(self._due)):
                name, view = self.possible_agents[index], self._views[index]
                stuck = not view.allowed.any()
                full = stuck and self._decided[index] >= self._most_decisions
                terminations[name], truncations[name] = stuck and not full, full
                rewards[name] = self._gain(index, float(view.trace), terminations[name])
                if stuck:
                    self._leaving.append(index)
                    ended.append(name)
            if len(self._leaving) < int(self._due.sum()) or not self._due.any():
                break
            for index in self._leaving:
                self._move(index, self._nowhere, True)
            self._leaving = []
            if len(ended) == len(was):
                break
        self.agents = [name for name in was if name not in ended]
        if self.max_cycles is not None and self._cycle >= self.max_cycles:
            for name in self.agents:
                index = self._index[name]
                truncations[name] = True
                if not self._due[index]:
                    rewards[name] = self._gain(index, float(self._views[index].trace), ended=False)
            self.agents = []
        self._render_if_watched()
        return (*self._split(was, rewards, terminations, truncations),)

    def _split(
        self, names: list[str], rewards: dict[str, float], terminations: dict[str, bool], truncations: dict[str, bool]
    ) -> Answer:
        observations, infos = self._seen(names)
        return observations, rewards, terminations, truncations, infos

    def _seen(self, names: list[str]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Observations and infos of these agents."""
        observations, infos = {}, {}
        for name in names:
            index = self._index[name]
            view, alive = self._views[index], name in self.agents
            travelling = alive and not self._due[index]
            mask = np.zeros(self._moves, np.int8)
            if alive and not travelling:
                mask[: len(view.allowed)] = view.allowed
            elif travelling:
                mask[-1] = 1
            observations[name] = self._observation(view, mask)
            infos[name] = self._info(index, float(self._time), view, travelling)
        return observations, infos

    def _survey_state(self) -> State:
        return self._state

    def _render_if_watched(self) -> None:
        if self.render_mode == "human":
            self.render()
