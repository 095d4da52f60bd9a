"""The world that a survey is in after what was changed of it: a function of the mission, the seed and the changes."""

import dataclasses
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine import Mission, Planner
from maipp.errors import InputError
from maipp.kept import kept
from maipp.live.changes import Changes, ThresholdSetting
from maipp.live.survey_limits import SurveyLimits
from maipp.live.world import Setup, World, draw_world
from maipp.planners import make_planner
from maipp.problem import Problem, shape_of
from maipp.roadmap import Home, home_of
from maipp.scenario import Scenario
from maipp.surveys.standardise import interest_beta


class Worlds(SurveyLimits):
    """The world of the mission, and those that changes make of it; each is drawn when it is first asked for."""

    def __init__(self, base: World, setup: Setup) -> None:
        """`base` is the world that nothing was changed of yet."""
        super().__init__(base.scenario, np.asarray(base.mission.start, np.float64), setup.clearance)
        self.base, self.setup = base, setup
        # What a person undoes is often wanted again, and what is refused never was.
        self._drawn, self._of = lru_cache(4)(self._draw), lru_cache(4)(self._make)
        self.nothing = lru_cache(4)(self._nothing)

    def of(self, changes: Changes) -> World:
        """The world after these changes. Raises `InputError` where they leave no room for the survey."""
        return self._of(changes)

    def _make(self, changes: Changes) -> World:
        geometry = changes.geometry
        world = self._drawn(geometry) if geometry.zones or geometry.joined else self.base
        return world if changes.threshold is None else self._from_threshold(world, changes.threshold)

    def _draw(self, changes: Changes) -> World:
        """The world with these zones and robots."""
        setup, old, scenario = self.setup, self.base.mission, self.scenario(changes)
        planner = make_planner(setup.planner, scenario, setup.options)
        if scenario.obstacles and not planner.avoids_obstacles:
            raise InputError(f"planner {setup.planner} would cross the no-go zones; no zone can be added to its survey")
        # Budgets from the start on say nothing of who is under way: the ends are found here.
        drawn = draw_world(planner, scenario.replace(end=None), setup.seed)
        positions = [joiner.position for joiner in changes.joined]
        mission = dataclasses.replace(
            drawn.mission,
            shape=shape_of(scenario),
            start=jnp.concatenate([old.start, jnp.asarray(positions, old.start.dtype).reshape(-1, 2)]),
            home=self._home(scenario),
            prior_x=old.prior_x,
            prior_y=old.prior_y,
            prior_noise=old.prior_noise,
        )
        return World(scenario, planner, mission, self.base.key)

    def _home(self, scenario: Scenario) -> Home | None:
        if not scenario.homes:
            return None
        ends = scenario.ends_from(scenario.starts)
        return home_of(ends, scenario.obstacles, scenario.extent, scenario.grid)

    def _from_threshold(self, world: World, level: ThresholdSetting) -> World:
        """The world with another threshold, and the confidence that goes with it."""
        own = not self.setup.beta_follows
        beta = world.scenario.beta if own else interest_beta(level.value)
        scenario = world.scenario.replace(threshold=level.value, beta=beta)
        numbers = {name: jnp.asarray(getattr(scenario, name), jnp.result_type(float)) for name in ("threshold", "beta")}
        mission: Mission = world.mission
        mission = dataclasses.replace(mission, params=dataclasses.replace(mission.params, **numbers))
        return dataclasses.replace(world, scenario=scenario, mission=mission)

    def _nothing(self, agents: int) -> tuple[Any, Any]:
        """The planner's empty message and memory in a team of this size, on the host; draws nothing."""
        problem: Problem = self.base.mission.problem
        planner = self.base.planner
        if agents != problem.shape.agents:
            planner = planner.on(Problem(dataclasses.replace(problem.shape, agents=agents), problem.params))
        return jax.device_get(_nothing(planner))


@kept
def _nothing(planner: Planner) -> tuple[Any, Any]:
    return planner.empty_message(), planner.initial_memory()
