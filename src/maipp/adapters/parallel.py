"""The survey as a PettingZoo parallel environment: one step runs to the next arrival; who travels, waits."""

from typing import Any

import numpy as np
from pettingzoo import ParallelEnv

from maipp.adapters.base_env import RENDER_MODES, BaseSurveyEnv
from maipp.adapters.compiled import Sight, told_all
from maipp.adapters.packed import Words
from maipp.errors import InputError
from maipp.roadmap import SHORTEST_LEG

Answer = tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]


class SurveyParallel(BaseSurveyEnv, ParallelEnv):  # type: ignore[misc]  # both declare what the other defines
    """Agents that have arrived act together; those under way are given the mask that allows only to wait.

    Neighbour actions have one more index than neighbours, the last: wait. What an agent under way answers is not read.
    """

    metadata = {"name": "maipp_survey_v0", "render_modes": list(RENDER_MODES)}

    _extra_moves = 1  # wait

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Draw a new world; observations and infos of all agents. A seed also decides the worlds that follow."""
        self._fresh(seed, options)
        self.agents = self.possible_agents[:]
        self._cycle = 0
        self._leaving: list[int] = []
        self._over: set[int] = set()
        self._sights: dict[int, Sight] = {}
        self._now = self._calls.before_first(self._world)
        self._advance(self._choices({}, []))
        self._render_if_watched()
        return self._seen(self.agents)

    @property
    def _rows(self) -> int:  # type: ignore[override]
        return self.scenario.agents

    def _act(self, choices: np.ndarray) -> Words:
        return self._calls.together(self._now, self._world, choices)

    def _choices(self, choices: dict[int, tuple[Any, ...]], stopping: list[int]) -> np.ndarray:
        """Those with a choice set off, those named stop, the others do nothing: (m, actions and two more)."""
        rows = [(*self._nowhere, False, False)] * self.scenario.agents
        for index, choice in choices.items():
            rows[index] = (*choice, True, False)
        for index in stopping:
            rows[index] = (*self._nowhere, True, True)
        return np.array(rows, self._numbers)

    def _advance(self, choices: np.ndarray) -> list[Sight]:
        """These are done; then who arrives next, which is returned.

        Everybody is seen then, but who has ended, which keeps its last sight.
        """
        self._now = self._act(choices)
        due = []
        for index, sight in enumerate(told_all(self._calls.kinds, self._now, self._size)):
            if index not in self._over:
                self._sights[index] = sight
                if sight.due:
                    due.append(sight)
        return due

    def step(self, actions: dict[str, Any]) -> Answer:
        """What all agents do until somebody arrives next. Only the actions of agents that have arrived are read.

        Raises InputError where one of those is missing or no action; the environment is as it was.
        """
        self._check_begun()
        if not self.agents:
            return {}, {}, {}, {}, {}
        acting = [self._index[name] for name in self.agents if self._sights[self._index[name]].due]
        choices = {}
        for index in acting:
            name = self.possible_agents[index]
            if name not in actions:
                raise InputError(f"{name}: no action, but it has arrived and must decide")
            choices[index] = self._choice(name, actions[name], self._sights[index])
        self._cycle += 1

        was = self.agents
        terminations, truncations = dict.fromkeys(was, False), dict.fromkeys(was, False)
        rewards = dict.fromkeys(was, 0.0)
        staying = [index for index in acting if self._stays(choices[index], self._sights[index])]
        for index in staying:
            name, sight = self.possible_agents[index], self._sights[index]
            terminations[name], rewards[name] = True, sight.final
            self._sights[index] = sight._replace(allowed=np.zeros_like(sight.allowed))
        self._over.update(staying)
        going = {index: choice for index, choice in choices.items() if index not in staying}
        stopping = [*self._leaving, *staying]
        while True:  # until somebody can decide, or all have ended
            choices = self._choices(going, stopping)
            if len(self._over) == self.scenario.agents:
                self._owed, stopping = choices, []
                break
            due = self._advance(choices)
            going, stopping = {}, [sight.agent for sight in due if sight.end]
            for sight in due:
                name = self.possible_agents[sight.agent]
                terminations[name], truncations[name] = sight.ended, sight.truncated
                rewards[name] = sight.gained
            self._over.update(stopping)
            if len(stopping) < len(due):
                break
        self._leaving = stopping
        self.agents = [name for name in was if self._index[name] not in self._over]
        if self.max_cycles is not None and self._cycle >= self.max_cycles:
            for name in self.agents:
                truncations[name], rewards[name] = True, self._sights[self._index[name]].gained
            self.agents = []
        self._render_if_watched()
        observations, infos = self._seen(was)
        return observations, rewards, terminations, truncations, infos

    @property
    def _time(self) -> float:
        return max(sight.time for sight in self._sights.values())

    def _stays(self, choice: tuple[Any, ...], sight: Sight) -> bool:
        """Whether the choice is a waypoint on the spot, by which an agent ends its survey."""
        if self.form.actions != "waypoint":
            return False
        end = sight.vector[:2] * max(self.scenario.extent)  # where its leg ends, domain units
        return bool(np.linalg.norm(np.asarray(choice) - end) <= SHORTEST_LEG)

    def _seen(self, names: list[str]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Observations and infos of these agents; who has ended may do nothing any more."""
        observations, infos = {}, {}
        masks = np.zeros((len(names), self._moves), np.int8)
        for name, mask in zip(names, masks, strict=True):
            sight = self._sights[self._index[name]]
            if name not in self.agents:
                pass
            elif sight.due:
                mask[: len(sight.allowed)] = sight.allowed
            else:
                mask[-1] = 1
            observations[name] = self._observation(sight, mask)
            infos[name] = self._info(sight, mask)
        return observations, infos
