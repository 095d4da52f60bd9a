"""The survey as a PettingZoo AEC environment: whoever arrives first decides."""

from typing import Any

import numpy as np
from pettingzoo import AECEnv

from maipp.adapters.base_env import RENDER_MODES, BaseSurveyEnv
from maipp.adapters.compiled import Sight, told
from maipp.adapters.packed import Words


class SurveyAEC(BaseSurveyEnv, AECEnv):  # type: ignore[misc]  # both declare what the other defines
    """One step is one decision of the agent that is due, which is the one that arrives first.

    An agent whose budget is spent is terminated when it arrives; its last step is None, as PettingZoo asks for.
    """

    metadata = {"name": "maipp_survey_v0", "render_modes": list(RENDER_MODES), "is_parallelizable": False}

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Draw a new world and give the turn to the first agent; a seed also decides the worlds that follow."""
        self._fresh(seed, options)
        self.agents = self.possible_agents[:]
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self._decided = [0] * self.scenario.agents
        self._sights: dict[str, Sight] = {}
        self._now = self._calls.first(self._world)
        self.infos: dict[str, dict[str, Any]] = {name: {} for name in self.agents}
        self._turn()
        self._render_if_watched()

    def _turn(self) -> None:
        """Give the turn to the agent that is due: reward its last decision, end its survey if nothing is left."""
        sight = told(self._calls.kinds, self._now, self._size)
        agent = self.possible_agents[sight.agent]
        self.agent_selection = agent
        self._sights[agent] = sight
        cut = not sight.end and self.max_cycles is not None and self._decided[sight.agent] >= self.max_cycles
        self.terminations[agent], self.truncations[agent] = sight.ended, sight.truncated or cut
        self.rewards[agent] = sight.gained
        self.infos[agent] = self._info(sight, self._mask(agent) if self._mask_apart else None)
        self._accumulate_rewards()

    def step(self, action: Any) -> None:
        """The due agent's decision, or None where its survey has ended; gives the turn to the next one.

        Raises InputError for what is no action; the environment is as it was.
        """
        self._check_begun()
        agent = self.agent_selection
        over = self.terminations[agent] or self.truncations[agent]
        if over:
            choice = self._nowhere
            self._was_dead_step(action)
        else:
            choice = self._choice(agent, action, self._sights[agent])
            self._decided[self._index[agent]] += 1
            self._cumulative_rewards[agent] = 0.0
            self._clear_rewards()
        moved = np.array((*choice, True, over), self._numbers)
        if self.agents:
            self._now = self._act(moved)
            self._turn()
        else:
            self._owed = moved
        self._render_if_watched()

    def _act(self, choices: np.ndarray) -> Words:
        return self._calls.play(self._now, self._world, choices)

    def _mask(self, agent: str) -> np.ndarray:
        """What the agent may do now: nothing unless it is due."""
        over = self.terminations.get(agent, True) or self.truncations.get(agent, True)
        if agent != self.agent_selection or over:
            return np.zeros(self._moves, np.int8)
        return self._sights[agent].allowed.astype(np.int8)

    def observe(self, agent: str) -> Any:
        """What the agent sees: when it is due or has ended, what it decides on; else what it knows at this moment.

        The mask of an agent that is not due allows nothing.
        """
        self._check_begun()
        sight = self._sights.get(agent)
        over = self.terminations.get(agent, True) or self.truncations.get(agent, True)
        if sight is None or not (agent == self.agent_selection or over):
            index = np.int32(self._index[agent])
            row = self._calls.glance(self._settled(), self._world, index)
            sight = told(self._calls.kinds, row, self._size)
        return self._observation(sight, self._mask(agent))
