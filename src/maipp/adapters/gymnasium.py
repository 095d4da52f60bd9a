"""Surveys for Gymnasium: `SurveyEnv`, one team that acts in turns, and `SurveyVectorEnv`, many worlds in one program.

Whoever learns is the team: an observation is that of the robot that is due, a reward that of whose turn it becomes.
"""

from functools import partial
from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from maipp.adapters.base_env import RENDER_MODES, BaseSurveyEnv
from maipp.adapters.compiled import Sight, told
from maipp.adapters.packed import Words
from maipp.adapters.spaces import OBSERVATIONS, action_space, masked, observation_space
from maipp.devices import keep_compiled, refuse_fork
from maipp.engine.mission import Mission
from maipp.environments.environment import Environment, EnvObservation, Info
from maipp.environments.form import check_option
from maipp.errors import InputError
from maipp.scenario import Scenario
from maipp.seeds import check_seed
from maipp.typing import Keys


class SurveyEnv(BaseSurveyEnv, gymnasium.Env):  # type: ignore[misc]  # both declare what the other defines
    """One team as one learner: a step is the decision of the robot that is due. Options as for PettingZoo.

    Rewards of robots whose survey ends meanwhile are in the step that leads there. `action_masks()` is what sb3-contrib
    asks for.
    """

    metadata = {"name": "maipp_survey_v0", "render_modes": list(RENDER_MODES), "render_fps": 4}

    def __init__(self, scenario: Scenario | None = None, **options: Any) -> None:
        """As `BaseSurveyEnv`; spaces are those of one robot."""
        super().__init__(scenario, **options)
        name = self.possible_agents[0]
        self.action_space = self.action_spaces[name]  # type: ignore[assignment,method-assign]
        self.observation_space = self.observation_spaces[name]  # type: ignore[assignment,method-assign]

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """A new world; what the first robot sees in it, and info. A seed also decides the worlds that follow."""
        gymnasium.Env.reset(self, seed=seed)
        self._fresh(seed, options)
        self._now = self._calls.first(self._world)
        self._sights: dict[str, Sight] = {}
        self._decisions, self._done = 0, False
        observation, _, info = self._until_a_choice()
        self._render_if_watched()
        return observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """The due robot's decision, and what the next one sees.

        Raises InputError for what is no action, and after the end; the environment is as it was.
        """
        self._check_begun()
        if self._done:
            raise InputError("the survey is over: call reset() first")
        name = self.possible_agents[self._sight.agent]
        choice = self._choice(name, action, self._sight)
        replaced = any(self._replaced)
        self._now = self._act(np.array((*choice, True, False), self._numbers))
        self._decisions += 1
        observation, reward, info = self._until_a_choice()
        info["replaced"] = replaced
        over = self._sight.end
        cut = not over and self.max_cycles is not None and self._decisions >= self.max_cycles
        self._done = over or cut
        self._render_if_watched()
        return observation, reward, over and not self._sight.truncated, cut or self._sight.truncated, info

    def _act(self, choices: np.ndarray) -> Words:
        return self._calls.play(self._now, self._world, choices)

    def _until_a_choice(self) -> tuple[Any, float, dict[str, Any]]:
        """Let robots stop that can go nowhere, until one can choose or all have ended; the sum of the rewards."""
        sight = told(self._calls.kinds, self._now, self._size)
        reward = sight.gained
        while sight.end and not sight.last:
            self._now = self._act(np.array((*self._nowhere, True, True), self._numbers))
            sight = told(self._calls.kinds, self._now, self._size)
            reward += sight.gained
        self._sight = sight
        mask = self.action_masks().astype(np.int8)
        info = self._info(sight, mask) | {"agent": sight.agent}
        return self._observation(sight, mask), reward, info

    def action_masks(self) -> np.ndarray:
        """(k,) bool: what the robot that is due may do; all of it once the survey is over."""
        self._check_begun()
        return self._sight.allowed | (not self._sight.allowed.any())


@partial(jax.jit, static_argnums=0)
def _reset(environment: Environment, keys: Keys, params: Mission) -> Any:
    return jax.vmap(environment.reset, in_axes=(0, None))(keys, params)


@partial(jax.jit, static_argnums=0)
def _step(environment: Environment, states: Any, actions: Any, params: Mission) -> Any:
    return jax.vmap(environment.step, in_axes=(0, 0, None))(states, actions, params)


class SurveyVectorEnv(VectorEnv):
    """W worlds in one compiled program, on one core or one accelerator.

    Worlds begin anew in the step after their end, as Gymnasium's vector environments do by default. A robot whose
    survey has ended while others go on has one more turn, whose action is not read (`info["ended"]`).
    """

    metadata = {"name": "maipp_survey_v0", "autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(
        self,
        scenario: Scenario | None = None,
        num_envs: int = 64,
        *,
        actions: str = "neighbour",
        observations: str = "dict",
        reward: str = "paper",
        worlds: int = 256,
    ) -> None:
        """`worlds` are drawn at a reset with a seed, and combined (`maipp.Environment`).

        Raises InputError for options that make no sense.
        """
        scenario = Scenario() if scenario is None else scenario
        for name, count in (("num_envs", num_envs), ("worlds", worlds)):
            if count < 1:
                raise InputError(f"{name}={count}: give a whole number >= 1")
        check_option("observations", observations, OBSERVATIONS)
        self.environment = Environment(scenario, actions=actions, reward=reward)
        form, k = self.environment.form, scenario.neighbours
        self.autoreset_mode = self.metadata["autoreset_mode"]  # where some libraries look for it
        self.num_envs, self._worlds, self._observations = num_envs, worlds, observations
        self.single_action_space = action_space(scenario, form, k)
        self.single_observation_space = observation_space(scenario, form, k, observations)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._params: Any = None
        keep_compiled()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """New worlds everywhere. A seed decides these and all that follow; there are no options."""
        refuse_fork()
        if options:
            raise InputError(f"reset options: {', '.join(map(repr, sorted(options)))} unknown; there are none")
        super().reset(seed=seed)
        if seed is not None or self._params is None:
            seed = int(np.random.default_rng().integers(2**31)) if seed is None else check_seed(seed)
            self._params = self.environment.params(seed=seed, worlds=self._worlds)
            self._key = jax.random.key(seed)
        self._key, key = jax.random.split(self._key)
        self._state, seen = _reset(self.environment, jax.random.split(key, self.num_envs), self._params)
        return self._told(jax.device_get(seen)), {}

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One decision in every world; where the one before was its last, a new world instead.

        Raises InputError for what are no actions; the environment is as it was.
        """
        if self._params is None:
            raise InputError("no survey yet: call reset() first")
        refuse_fork()
        actions, kind = np.asarray(actions), np.dtype(self.action_space.dtype)
        if actions.dtype.kind == kind.kind:
            actions = actions.astype(kind)
        if not self.action_space.contains(actions):
            raise InputError(f"actions of shape {actions.shape}, {actions.dtype}: give a member of {self.action_space}")
        self._state, seen, rewards, _, info = _step(self.environment, self._state, actions, self._params)
        seen, rewards, info = jax.device_get((seen, rewards, info))
        over, cut = info.last & ~info.truncated, info.last & info.truncated
        return self._told(seen), np.asarray(rewards, np.float64), over, cut, self._info(seen, info)

    def _told(self, seen: EnvObservation) -> Any:
        vector = np.asarray(seen.vector)
        if not masked(self.environment.form, self._observations):
            return vector
        return {"observation": vector, "action_mask": seen.action_mask.astype(np.int8)}

    def _info(self, seen: EnvObservation, info: Info) -> dict[str, Any]:
        """Every number for all worlds, each with Gymnasium's mask of the worlds that have it."""
        numbers = info._asdict() | {"action_mask": seen.action_mask.astype(np.int8)}
        everywhere = np.ones(self.num_envs, bool)
        return numbers | {f"_{name}": everywhere for name in numbers}
