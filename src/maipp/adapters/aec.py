"""The survey as a PettingZoo AEC environment: whoever arrives first decides."""

from typing import Any

import jax
import numpy as np
from pettingzoo import AECEnv

from maipp.adapters.moves import Move, begin, look, play
from maipp.adapters.survey import RENDER_MODES, Survey
from maipp.adapters.view import View
from maipp.engine.state import State


class SurveyAEC(Survey, AECEnv):  # type: ignore[misc]  # both declare what the other defines
    """One step is one decision of the agent that is due, which is the one that arrives first.

    An agent whose budget is spent is terminated when it arrives; its last step is None, as PettingZoo asks for.
    """

    metadata = {"name": "maipp_survey_v0", "render_modes": list(RENDER_MODES), "is_parallelizable": False}

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Draw a new world and give the turn to the first agent; a seed also decides the worlds that follow."""
        mission = self._fresh(seed)
        self.agents = self.possible_agents[:]
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self._decided = [0] * self.scenario.agents
        self._views: dict[str, View] = {}
        state, due, view = begin(self.scenario, self.form, mission)
        self.infos: dict[str, dict[str, Any]] = {name: {} for name in self.agents}
        self._turn(state, due, view)
        self._render_if_watched()

    def _turn(self, state: State, due: Any, view: View) -> None:
        """Give the turn to the agent that is due: reward its last decision, end its survey if nothing is left."""
        self._state = state
        index, view, time = jax.device_get((due, view, state.time))
        index = int(index)
        agent = self.possible_agents[index]
        self.agent_selection = agent
        self._views[agent] = view
        stuck = not view.allowed.any()
        full = stuck and self._decided[index] >= self._most_decisions
        self.terminations[agent] = stuck and not full
        self.truncations[agent] = full or (
            not stuck and self.max_cycles is not None and self._decided[index] >= self.max_cycles
        )
        self.rewards[agent] = self._gain(index, float(view.trace), self.terminations[agent])
        self.infos[agent] = self._info(index, float(time), view, travelling=False)
        self._accumulate_rewards()

    def step(self, action: Any) -> None:
        """The due agent's decision, or None where its survey has ended; gives the turn to the next one.

        Raises InputError for what is no action; the environment is as it was.
        """
        agent = self.agent_selection
        index = self._index[agent]
        over = self.terminations[agent] or self.truncations[agent]
        if over:
            choice = self._nowhere
            self._was_dead_step(action)
        else:
            view = self._views[agent]
            choice = self._choice(agent, action, view)
            self._decided[index] += 1
            self._cumulative_rewards[agent] = 0.0
            self._clear_rewards()
            if self._stays(choice, view):  # the engine stops it at its last step, which is None
                self.terminations[agent] = True
                self.rewards[agent] = self._gain(index, float(view.trace), ended=True)
                self._accumulate_rewards()
                return
        move = Move(np.int32(index), choice, np.bool_(over))
        state, due, view = play(self.scenario, self.form, self._mission, self._state, move)
        if self.agents:
            self._turn(state, due, view)
        else:
            self._state = state
        self._render_if_watched()

    def observe(self, agent: str) -> Any:
        """What the agent sees: when it is due or has ended, what it decides on; else what it knows at this moment.

        The mask of an agent that is not due allows nothing.
        """
        view = self._views.get(agent)
        due = agent == self.agent_selection
        over = self.terminations.get(agent, True) or self.truncations.get(agent, True)
        if view is None or not (due or over):
            view = jax.device_get(
                look(self.scenario, self.form, self._mission, self._state, np.int32(self._index[agent]))
            )
        mask = np.zeros(self._moves, np.int8)
        if due and not over:
            mask[:] = view.allowed
        return self._observation(view, mask)
