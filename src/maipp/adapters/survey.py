"""What both environments share: worlds, spaces, rewards, actions checked, the record and the picture."""

from typing import Any

import gymnasium
import jax
import numpy as np

from maipp.adapters.announcer import Announcer
from maipp.adapters.form import MASKED, REWARDS, Form, check_form, check_option
from maipp.adapters.picture import as_text, draw_survey, show
from maipp.adapters.spaces import action_space, as_observation, observation_space
from maipp.adapters.view import View
from maipp.engine.episode import Episode
from maipp.engine.mission import Field, Mission, draw_missions
from maipp.engine.reward import final_reward, reward
from maipp.engine.score import Metrics, score_missions
from maipp.engine.state import State, route_capacity
from maipp.errors import InputError
from maipp.roadmap import SHORTEST_LEG
from maipp.scenario import Scenario
from maipp.seeds import check_seed

RENDER_MODES = ("human", "rgb_array", "ansi")

_DRAWN_SEEDS = 2**31 - 1  # below this are the seeds of the worlds that follow a given one

_for_decision, _for_end = (jax.jit(function, static_argnums=0) for function in (reward, final_reward))


class Survey:
    """The part of an environment that does not depend on how agents take turns."""

    _extra_moves = 0  # besides those to the neighbours
    _state: State  # the engine's, now

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
        """Check the options (docs/pettingzoo.md) and build the spaces. Raises InputError for what makes no sense."""
        scenario, form = Scenario() if scenario is None else scenario, Form(actions, view)
        check_form(scenario, form)
        check_option("reward", reward, REWARDS)
        check_option("masked", masked, MASKED)
        if render_mode is not None:
            check_option("render_mode", render_mode, RENDER_MODES)
        if max_cycles is not None and max_cycles < 1:
            raise InputError(f"max_cycles={max_cycles}: give a whole number >= 1, or None for no limit")
        if field is None and scenario.field is not None:
            raise InputError(
                "the scenario names a field file, which an environment does not read; "
                "give the ground truth as field=..., and a scenario without one"
            )
        self.scenario, self.form, self.render_mode = scenario, form, render_mode
        self.max_cycles = max_cycles
        self._reward, self._masked, self._field = reward, masked, field
        self.possible_agents = [f"robot_{i}" for i in range(scenario.agents)]
        self.agents: list[str] = []
        self._index = {name: i for i, name in enumerate(self.possible_agents)}
        moves = scenario.neighbours + self._extra_moves
        self.action_spaces = {name: action_space(scenario, form, moves) for name in self.possible_agents}
        self.observation_spaces = {name: observation_space(scenario, form, moves) for name in self.possible_agents}
        self._moves = moves
        self._most_decisions = route_capacity(scenario, Announcer(scenario)) - 1  # then an agent's record is full
        self._seeds = np.random.default_rng()
        self._figure: Any = None

    def observation_space(self, agent: str) -> gymnasium.spaces.Space:
        """The space of what this agent observes; the same object at every call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Space:
        """The space of this agent's actions; the same object at every call."""
        return self.action_spaces[agent]

    def _fresh(self, seed: int | None) -> Mission:
        """A new world. Seed s is the first of `draw_missions(scenario, seed=s)`, and decides those that follow."""
        if seed is None:
            seed = int(self._seeds.integers(_DRAWN_SEEDS))
        else:
            self._seeds = np.random.default_rng(check_seed(seed))
        roadmaps = self.form.actions == "neighbour"
        self._seed = seed
        self._missions = draw_missions(self.scenario, seed=seed, instances=1, roadmaps=roadmaps, field=self._field)
        self._mission: Mission = jax.tree.map(lambda a: a[0], self._missions)
        self._before: list[float | None] = [None] * self.scenario.agents
        self._replaced = [False] * self.scenario.agents
        return self._mission

    def _choice(self, agent: str, action: Any, view: View) -> np.ndarray:
        """The agent's action as the engine takes it; a masked one is replaced or refused.

        Raises InputError for what is no action at all.
        """
        space = self.action_spaces[agent]
        if action is None or not space.contains(action):
            raise InputError(f"{agent}: {_brief(action)} is not an action; give a member of {space}")
        if self.form.actions == "waypoint":
            self._replaced[self._index[agent]] = False
            return np.asarray(action, np.float32)
        index = int(action)
        fine = index < len(view.allowed) and bool(view.allowed[index])
        self._replaced[self._index[agent]] = not fine
        if fine:
            return np.asarray(index, np.int32)
        if self._masked == "raise":
            raise InputError(f"{agent}: action {index} is masked; allowed now: {np.flatnonzero(view.allowed).tolist()}")
        places = view.candidates[:, :2]
        asked = places[index] if index < len(places) else np.zeros(2, np.float32)  # to wait is to stay near
        squared = ((places - asked) ** 2).sum(axis=1)
        return np.asarray(np.argmin(np.where(view.allowed, squared, np.inf)), np.int32)

    def _stays(self, choice: np.ndarray, view: View) -> bool:
        """Whether the choice is a waypoint on the spot, by which an agent ends its survey."""
        return self.form.actions == "waypoint" and bool(np.linalg.norm(choice - view.end) <= SHORTEST_LEG)

    @property
    def _nowhere(self) -> np.ndarray:
        """A choice to go with a stop, which reads none."""
        return np.zeros(2, np.float32) if self.form.actions == "waypoint" else np.zeros((), np.int32)

    def _gain(self, index: int, trace: float, ended: bool) -> float:
        """The reward for an agent's last decision, now that it decides again or has ended; 0 before its first.

        As in training: from Tr(P) of its own belief then to that now, and for its end.
        """
        before, self._before[index] = self._before[index], trace
        gain = 0.0 if before is None else float(_for_decision(self._reward, before, trace))
        return gain + (float(_for_end(self._reward, trace)) if ended else 0.0)

    def _observation(self, view: View, mask: np.ndarray) -> Any:
        return as_observation(self.form, view, None if self.form.actions == "waypoint" else mask)

    def _info(self, index: int, time: float, view: View, travelling: bool) -> dict[str, Any]:
        """What is no part of the observation: times and lengths in the scenario's units."""
        return {
            "time": time,
            "remaining": float(view.remaining),
            "trace": float(view.trace),
            "travelling": travelling,
            "replaced": self._replaced[index],
        }

    def simulator_state(self) -> tuple[Mission, State]:
        """The world and the engine's state now, as `maipp.run_missions` has them, with a leading axis of one."""
        return self._missions, jax.tree.map(lambda a: a[None], self._state)

    def metrics(self) -> Metrics:
        """Quality of the survey as decided so far; every number has a leading axis of one."""
        missions, states = self.simulator_state()
        return score_missions(missions, states)

    def episode(self) -> Episode:
        """The record of the survey as decided so far, for files and pictures."""
        missions, states = self.simulator_state()
        return Episode.from_state(self.scenario, "pettingzoo", {}, self._seed, missions, states)

    def render(self) -> np.ndarray | str | None:
        """The survey now: an RGB picture (h, w, 3) uint8, a text, or None after showing it in a window."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() does nothing without a render_mode: 'human', 'rgb_array' or 'ansi'")
            return None
        time = float(self._state.time)
        if self.render_mode == "ansi":
            return as_text(self.episode(), time)
        if self.render_mode == "rgb_array":
            return draw_survey(self.episode(), time)
        self._figure = show(self._figure, self.episode(), time)
        return None

    def _render_if_watched(self) -> None:
        if self.render_mode == "human":
            self.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._figure is not None:
            from matplotlib import pyplot

            pyplot.close(self._figure)
            self._figure = None


def _brief(action: Any) -> str:
    text = " ".join(repr(action).split())
    return text if len(text) <= 60 else text[:57] + "..."
