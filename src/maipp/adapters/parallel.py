"""The survey as a PettingZoo parallel environment: one step runs to the next arrival; who travels, waits."""

from typing import Any, NamedTuple

import jax
import numpy as np
from pettingzoo import ParallelEnv

from maipp.adapters.moves import Move, depart, look_all, start
from maipp.adapters.survey import RENDER_MODES, Survey
from maipp.adapters.view import View
from maipp.errors import InputError

Answer = tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]


class Sight(NamedTuple):
    """What an agent saw at a moment."""

    time: float
    due: bool  # it had arrived; else it was under way
    view: View


class SurveyParallel(Survey, ParallelEnv):  # type: ignore[misc]  # both declare what the other defines
    """Agents that have arrived act together; those under way are given the mask that allows only to wait.

    Neighbour actions have one more index than neighbours, the last: wait. What an agent under way answers is not read.
    """

    metadata = {"name": "maipp_survey_v0", "render_modes": list(RENDER_MODES)}

    _extra_moves = 1  # wait

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Draw a new world; observations and infos of all agents. A seed also decides the worlds that follow."""
        mission = self._fresh(seed)
        self.agents = self.possible_agents[:]
        self._cycle = 0
        self._decided = [0] * self.scenario.agents
        self._leaving: list[int] = []
        self._over: set[int] = set()
        self._sights: dict[int, Sight] = {}
        self._state = start(self.scenario, mission)
        for index in self._look():
            self._gain(index, float(self._sights[index].view.trace), ended=False)
        self._render_if_watched()
        return self._seen(self.agents)

    def _look(self) -> list[int]:
        """See who arrives next, which is returned, and what everybody sees then; who has ended keeps its last sight."""
        time, due, views = jax.device_get(look_all(self.scenario, self.form, self._mission, self._state))
        for index in set(range(self.scenario.agents)) - self._over:
            view = jax.tree.map(lambda a, index=index: a[index], views)
            self._sights[index] = Sight(float(time), bool(due[index]), view)
        return [int(index) for index in np.flatnonzero(due)]

    def _move(self, index: int, choice: np.ndarray, stop: bool) -> None:
        move = Move(np.int32(index), choice, np.bool_(stop))
        self._state = depart(self.scenario, self.form, self._mission, self._state, move)

    def step(self, actions: dict[str, Any]) -> Answer:
        """What all agents do until somebody arrives next. Only the actions of agents that have arrived are read.

        Raises InputError where one of those is missing or no action; the environment is as it was.
        """
        if not self.agents:
            return {}, {}, {}, {}, {}
        acting = [self._index[name] for name in self.agents if self._sights[self._index[name]].due]
        choices = {}
        for index in acting:
            name = self.possible_agents[index]
            if name not in actions:
                raise InputError(f"{name}: no action, but it has arrived and must decide")
            choices[index] = self._choice(name, actions[name], self._sights[index].view)
        staying = [index for index in acting if self._stays(choices[index], self._sights[index].view)]
        for index in sorted([*acting, *self._leaving]):
            self._move(index, choices.get(index, self._nowhere), index not in choices or index in staying)
        for index in acting:
            self._decided[index] += 1
        self._cycle += 1

        was = self.agents
        terminations, truncations = dict.fromkeys(was, False), dict.fromkeys(was, False)
        rewards = dict.fromkeys(was, 0.0)
        for index in staying:
            name = self.possible_agents[index]
            terminations[name] = True
            rewards[name] = self._gain(index, float(self._sights[index].view.trace), ended=True)
        self._over.update(staying)
        while True:  # until somebody can decide, or all have ended
            due = self._look()
            self._leaving = []
            for index in due:
                name, view = self.possible_agents[index], self._sights[index].view
                stuck = not view.allowed.any()
                full = stuck and self._decided[index] >= self._most_decisions
                terminations[name], truncations[name] = stuck and not full, full
                rewards[name] = self._gain(index, float(view.trace), terminations[name])
                if stuck:
                    self._leaving.append(index)
            self._over.update(self._leaving)
            if len(self._leaving) < len(due) or not due:
                break
            for index in self._leaving:
                self._move(index, self._nowhere, True)
            self._leaving = []
            if len(self._over) == self.scenario.agents:
                break
        self.agents = [name for name in was if self._index[name] not in self._over]
        if self.max_cycles is not None and self._cycle >= self.max_cycles:
            for name in self.agents:
                index = self._index[name]
                truncations[name] = True
                if not self._sights[index].due:
                    rewards[name] = self._gain(index, float(self._sights[index].view.trace), ended=False)
            self.agents = []
        self._render_if_watched()
        observations, infos = self._seen(was)
        return observations, rewards, terminations, truncations, infos

    def _seen(self, names: list[str]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Observations and infos of these agents; who has ended may do nothing any more."""
        observations, infos = {}, {}
        for name in names:
            index = self._index[name]
            time, due, view = self._sights[index]
            mask = np.zeros(self._moves, np.int8)
            if name in self.agents and due:
                mask[: len(view.allowed)] = view.allowed
            elif name in self.agents:
                mask[-1] = 1
            observations[name] = self._observation(view, mask)
            infos[name] = self._info(index, time, view, travelling=not due)
        return observations, infos
