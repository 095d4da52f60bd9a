"""What all environments share: worlds, spaces, actions checked, the record and the picture."""

import copy
import dataclasses
from functools import cached_property
from typing import Any

import gymnasium
import jax
import numpy as np

from maipp.adapters.compiled import Calls, Sight, calls_of, kinds_of, opened, whole
from maipp.adapters.packed import Words, real
from maipp.adapters.picture import as_text, draw_survey, show
from maipp.adapters.spaces import OBSERVATIONS, action_space, as_observation, masked, observation_space
from maipp.devices import keep_compiled, refuse_fork
from maipp.engine.episode import Episode
from maipp.engine.mission import Field, Mission, mission_parts
from maipp.engine.score import Metrics, score_missions
from maipp.engine.state import State
from maipp.environments.environment import Environment, EnvState
from maipp.environments.form import MASKED, check_option, local_bounds
from maipp.environments.global_state import global_state_bounds
from maipp.errors import InputError
from maipp.problem import shape_of
from maipp.renamed import renamed
from maipp.scenario import Scenario
from maipp.seeds import check_seed

RENDER_MODES = ("human", "rgb_array", "ansi")

_SUITE = "options"  # what PettingZoo's conformance tests give to every environment's reset, and expect to be taken

_DRAWN_SEEDS = 2**31 - 1  # below this are the seeds of the worlds that follow a given one


class BaseSurveyEnv:
    """The part of an environment that does not depend on how agents take turns."""

    _extra_moves = 0  # besides those to the neighbours
    _rows: int | None = None  # rows that a compiled call gives: one for each agent, or None for that of the due one
    _compiled: Calls | None = None
    _now: Any = None  # the survey, `Words`; None before the first reset
    _owed: np.ndarray | None = None  # what is still to be done in it, at the end, where nobody sees it

    def __init__(
        self,
        scenario: Scenario | None = None,
        *,
        actions: str = "neighbour",
        view: str = "local",
        observations: str = "dict",
        reward: str = "paper",
        masked: str = "nearest",
        max_cycles: int | None = None,
        field: Field | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Check the options (docs/pettingzoo.md) and build the spaces. Raises InputError for what makes no sense."""
        scenario = Scenario() if scenario is None else scenario
        form = Environment(scenario, actions=actions, view=view, reward=reward, fields="own").form
        # What is compiled reads the numbers of the missions: one scenario stands for all, so that they share it.
        self._rules = Environment(Scenario(), actions=actions, view=view, reward=reward, fields="own")
        check_option("masked", masked, MASKED)
        check_option("observations", observations, OBSERVATIONS)
        if observations == "box" and view == "graph":
            raise InputError("observations='box' is one vector, which a roadmap does not fit; give view='local'")
        if render_mode is not None:
            check_option("render_mode", render_mode, RENDER_MODES)
        if max_cycles is not None and max_cycles < 1:
            raise InputError(f"max_cycles={max_cycles}: give a whole number >= 1, or None for no limit")
        if field is None and scenario.field is not None:
            raise InputError(
                "the scenario names a field file, which an environment does not read; "
                "give the ground truth as field=..., and a scenario without one"
            )
        keep_compiled()
        self.scenario, self.form, self.render_mode = scenario, form, render_mode
        self.max_cycles = max_cycles
        self._masked, self._observations, self._field = masked, observations, field
        self.possible_agents = [f"robot_{i}" for i in range(scenario.agents)]
        self.agents: list[str] = []
        self._index = {name: i for i, name in enumerate(self.possible_agents)}
        self._moves = scenario.neighbours + self._extra_moves
        one_action = action_space(scenario, form, self._moves)
        self.action_spaces = {name: copy.deepcopy(one_action) for name in self.possible_agents}
        one_seen = observation_space(scenario, form, self._moves, observations)
        self.observation_spaces = {name: copy.deepcopy(one_seen) for name in self.possible_agents}
        bounds = global_state_bounds(scenario)
        self.state_space = gymnasium.spaces.Box(bounds.low, bounds.high, dtype=np.float32)
        self._size = int(local_bounds(scenario).low.size)  # of the vector of an observation
        self._nowhere = (0.0, 0.0) if form.actions == "waypoint" else (0,)  # to go with a stop, which reads no choice
        self._numbers = real() if form.actions == "waypoint" else np.dtype(np.int32)  # of choices
        self._seeds: np.random.Generator | int | None = None  # of the worlds that follow, or what it is to be made from
        self._seed = 0
        self._figure: Any = None

    def observation_space(self, agent: str) -> gymnasium.spaces.Space:
        """The space of what this agent observes; the same object at every call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Space:
        """The space of this agent's actions; the same object at every call."""
        return self.action_spaces[agent]

    def _fresh(self, seed: int | None, options: dict[str, Any] | None) -> None:
        """A new world. Seed s is the first of `draw_missions(scenario, seed=s)`, and decides those that follow.

        With `options={"instance": i}` it is instance i of the seed, or of the seed before. Raises InputError for other
        options.
        """
        refuse_fork()
        instance = _instance(options)
        if seed is not None:
            self._seeds = check_seed(seed)
        elif instance is None:
            self._seeds = np.random.default_rng(self._seeds)
            seed = int(self._seeds.integers(_DRAWN_SEEDS))
        self._seed = self._seed if seed is None else seed
        roadmaps = self.form.actions == "neighbour"
        self._parts = mission_parts(
            self.scenario, seed=self._seed, instances=1, first=instance or 0, roadmaps=roadmaps, field=self._field
        )
        self._world = self._calls.hold(self._calls.kinds.world.pack_here(self._parts))
        self._owed = None
        self._replaced = [False] * self.scenario.agents

    @property
    def _calls(self) -> Calls:
        """What is compiled for this environment."""
        if self._compiled is None:
            seen = dataclasses.replace(self._rules, scenario=self.scenario).specs.observation
            kinds = kinds_of(self._rules, shape_of(self.scenario), self._parts, seen, self._rows)
            self._compiled = calls_of(self._rules, kinds)
        return self._compiled

    def __getstate__(self) -> dict[str, Any]:
        """All but what is compiled, and for what: definitions of pytrees do not come back whole from a pickle."""
        return self.__dict__ | {"_compiled": None}

    def _check_begun(self) -> None:
        """Raises InputError before the first reset, and in a process that cannot compute."""
        if self._now is None:
            raise InputError("no survey yet: call reset() first")
        refuse_fork()

    def _act(self, choices: np.ndarray) -> Words:
        """The survey after this, and what is told then."""
        raise NotImplementedError

    def _settled(self) -> Words:
        """The survey, with all that was to be done in it."""
        self._check_begun()
        if self._owed is not None:
            self._now, self._owed = self._act(self._owed), None
        return self._now

    def _choice(self, agent: str, action: Any, sight: Sight) -> tuple[Any, ...]:
        """The agent's action as the engine takes it, which replaces a masked one; or it is refused here.

        Raises InputError for what is no action at all.
        """
        if not (type(action) is int and 0 <= action < self._moves and self.form.actions == "neighbour"):
            action = self._checked(agent, action)  # what is not seen at a glance
        if self.form.actions == "waypoint":
            return tuple(np.asarray(action, np.float32))
        number, index = int(action), self._index[agent]
        self._replaced[index] = not (number < len(sight.allowed) and sight.allowed[number])
        if self._replaced[index] and self._masked == "raise":
            may = np.flatnonzero(sight.allowed).tolist()
            raise InputError(f"{agent}: action {number} is masked; allowed now: {may}")
        return (number,)

    def _checked(self, agent: str, action: Any) -> Any:
        """The action as a member of the agent's space. Raises InputError where it is none."""
        space = self.action_spaces[agent]
        if isinstance(space, gymnasium.spaces.Box) and isinstance(action, np.ndarray) and action.dtype.kind == "f":
            action = action.astype(np.float32)  # Gymnasium's boxes hold no float64
        if action is None or not space.contains(action):
            raise InputError(f"{agent}: {_brief(action)} is not an action; give a member of {space}")
        return action

    @cached_property
    def _mask_apart(self) -> bool:
        """Whether `info` holds the mask."""
        return self.form.actions == "neighbour" and not self._mask_inside

    @cached_property
    def _mask_inside(self) -> bool:
        """Whether an observation holds the mask."""
        return masked(self.form, self._observations)

    def _observation(self, sight: Sight, mask: np.ndarray) -> Any:
        return as_observation(self.scenario, sight, mask if self._mask_inside else None)

    def _info(self, sight: Sight, mask: np.ndarray | None) -> dict[str, Any]:
        """What is no part of the observation: times and lengths in the scenario's units."""
        info = {
            "time": sight.time,
            "remaining": sight.remaining,
            "trace": sight.trace,
            "travelling": not sight.due,
            "replaced": self._replaced[sight.agent],
        }
        if self._mask_apart:
            info["action_mask"] = mask
        return info

    @property
    def _state(self) -> EnvState:
        """The survey now, in its parts."""
        now = self._settled()
        return opened(self._calls.kinds, now, self._world)

    @property
    def _time(self) -> float:
        """Of the moment that was last told."""
        return float(self._state.survey.time)

    def state(self) -> np.ndarray:
        """The global state, a member of `state_space`, for critics that are trained centrally (docs/pettingzoo.md)."""
        now = self._settled()
        return np.asarray(whole(self._calls.kinds, now, self._world, np.asarray(self._time)))

    def simulator_state(self) -> tuple[Mission, State]:
        """The world and the engine's state now, as `maipp.run_missions` has them, with a leading axis of one."""
        self._check_begun()
        missions = Mission(shape=shape_of(self.scenario), **jax.device_put(self._parts))
        return missions, jax.tree.map(lambda a: a[None], self._state.survey)

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
        self._check_begun()
        time = float(self._state.survey.time)
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


def _instance(options: dict[str, Any] | None) -> int | None:
    """The instance asked for. Raises InputError for any other option of a reset."""
    options = options or {}
    if unknown := sorted(set(options) - {"instance", _SUITE}):
        raise InputError(f"reset options: {', '.join(map(repr, unknown))} unknown; there is 'instance'")
    instance = options.get("instance")
    if instance is not None and (isinstance(instance, bool) or not isinstance(instance, int) or instance < 0):
        raise InputError(f"reset options: instance={instance!r}; give a whole number >= 0")
    return instance


renamed(__name__, Survey="BaseSurveyEnv")
