"""The record of one survey: what was travelled and measured, and every number that follows from it."""

from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import lax

from maipp.belief import PriorSamples, condition, mutual_information
from maipp.engine.finite import refuse_non_finite
from maipp.engine.mission import Mission
from maipp.engine.observe import time_tolerance
from maipp.engine.polyline import moves_on
from maipp.engine.score import interest_of, kernel_of
from maipp.engine.state import REASONS, State
from maipp.fields.mixture import evaluation_grid
from maipp.geo import GeoReference
from maipp.kept import kept
from maipp.problem import Problem, problem_of
from maipp.scenario import DISTANCE_TOLERANCE, Scenario
from maipp.typing import Array, Bool, Float, Int

# Beliefs computed by one call of the compiled function. One size for every purpose means one compilation, and a
# long mission does not need memory for all its instants at once.
_BELIEFS_PER_CALL = 64


@dataclass(frozen=True, eq=False)
class AgentRecord:
    """What one agent did, in domain units, normalised values and the scenario's unit of time."""

    start: Float[np.ndarray, "2"]  # where it began
    budget: float  # longest path it may travel
    speed: float
    distance: float  # travelled
    decisions: int  # taken, the one that stopped it included
    route: Float[np.ndarray, "v 2"]  # vertices, the start first
    route_time: Float[np.ndarray, " v"]  # when it was there
    measurement_x: Float[np.ndarray, "n 2"]  # where it measured
    measurement_y: Float[np.ndarray, " n"]  # the values
    measurement_time: Float[np.ndarray, " n"]  # when
    known: Int[np.ndarray, " m"]  # measurements of each agent, the first so many, that it knew at its last decision
    stopped_by: str | None = None  # one of `state.REASONS`; None where it is not known, or has not stopped


@dataclass(frozen=True, eq=False)
class EpisodeMetrics:
    """Quality of one survey; every number follows from the recorded measurements and prior samples alone."""

    trace: float  # Tr(P_f) of the team's pooled belief over the predicted high-interest area
    own_trace: Float[np.ndarray, " m"]  # the same of each agent's own belief
    true_trace: float  # pooled variance over the points where the truth is of high interest
    rmse: float  # of the pooled mean over the survey area, normalised units
    mutual_information: float  # of the pooled belief over the predicted high-interest area, nats
    curve_time: Float[np.ndarray, " t"]  # 0, then every instant at which the team measured
    curve_trace: Float[np.ndarray, " t"]  # Tr(P) of the pooled belief at these times


class GridBeliefs(NamedTuple):
    """Beliefs on the evaluation grid, one per row; grid point `ix * grid + iy`."""

    mean: Float[np.ndarray, "k q"]
    variance: Float[np.ndarray, "k q"]
    bound: Float[np.ndarray, "k q"]  # upper confidence bound that is held against the threshold
    area: Bool[np.ndarray, "k q"]  # predicted high-interest area
    trace: Float[np.ndarray, " k"]  # Tr(P) over that area


@dataclass(frozen=True, eq=False)
class Episode:
    """The whole record of one survey, on the host. Arrays have the precision that the survey was run with."""

    scenario: Scenario
    planner: str  # its registered name
    options: MappingType[str, Any]  # options of the planner that were given, as plain numbers, strings and lists
    seed: int  # of the missions the survey was drawn with
    index: int  # of this mission in its batch
    agents: tuple[AgentRecord, ...]
    truth: Float[np.ndarray, " q"]  # ground truth on the evaluation grid, normalised units
    inside: Bool[np.ndarray, " q"]  # grid points of the survey area
    message_bytes: int  # size of the message sent with every decision
    reference: GeoReference | None = None  # to the coordinates and units of the field's file, or of a survey's user
    recorded: EpisodeMetrics | None = field(default=None, repr=False)  # metrics as read from a file
    prior: PriorSamples | None = None  # samples taken before the survey, which all beliefs are conditioned on
    expected: bool = False  # the truth is only what was expected before the survey, which is planned, not measured

    @classmethod
    def from_state(
        cls,
        scenario: Scenario,
        planner_name: str,
        options: MappingType[str, Any],
        seed: int,
        missions: Mission,
        states: State,
        index: int = 0,
        reference: GeoReference | None = None,
    ) -> "Episode":
        """The record of mission `index` of a finished batch (leading axis b on every array)."""
        host: Any = jax.device_get(states)
        world: Any = jax.device_get(
            (
                missions.start,
                missions.params.budgets,
                missions.params.speeds,
                missions.truth,
                missions.inside,
                missions.prior,
            )
        )
        start, budgets, speeds, truth, inside, prior = jax.tree.map(lambda array: array[index], world)
        waypoints = host.leg.shape[-2] - 1
        agents = []
        for agent in range(scenario.agents):
            length = int(host.route_length[index, agent])
            route, times = host.route[index, agent, :length], host.route_time[index, agent, :length]
            # Planners repeat a waypoint to go less far; the record keeps each place once.
            moved = moves_on(route)
            taken = np.isfinite(host.measurement_time[index, agent])
            known = host.measurement_time[index] <= host.known_until[index, agent][:, None]
            agents.append(
                AgentRecord(
                    start=start[agent],
                    budget=shortest(budgets[agent]),
                    speed=shortest(speeds[agent]),
                    distance=shortest(host.odometer[index, agent]),
                    decisions=(length - 1) // waypoints + int(not host.active[index, agent]),
                    route=route[moved],
                    route_time=times[moved],
                    measurement_x=host.measurement_x[index, agent, taken],
                    measurement_y=host.measurement_y[index, agent, taken],
                    measurement_time=host.measurement_time[index, agent, taken],
                    # Slots fill in order of time and are passed on whole, so what is known is always a beginning.
                    known=known.sum(axis=-1),
                    stopped_by=REASONS[host.stopped_by[index, agent]],
                )
            )
        batch = host.route.shape[0]
        size = sum(np.asarray(leaf).nbytes for leaf in jax.tree.leaves(host.messages)) // (batch * scenario.agents)
        return cls(
            scenario,
            planner_name,
            dict(options),
            seed,
            index,
            tuple(agents),
            truth,
            inside,
            size,
            reference,
            prior=prior,
        )

    @cached_property
    def metrics(self) -> EpisodeMetrics:
        """Metrics of the survey: as recorded in the file it was read from, else computed."""
        return self.recorded or replay(self)

    @property
    def geo(self) -> GeoReference:
        """What turns the record into a person's coordinates and units; domain units where there are no others."""
        return self.reference or GeoReference.of_domain(self.scenario.extent)

    @cached_property
    def drawn(self) -> GeoReference:
        """The same for pictures, whose axes are straight."""
        return self.geo.for_pictures

    @property
    def decisions(self) -> int:
        """Decisions taken by the team."""
        return sum(agent.decisions for agent in self.agents)

    @property
    def distance(self) -> float:
        """Path travelled by the team, domain units."""
        return sum(agent.distance for agent in self.agents)

    @property
    def unspent(self) -> float:
        """Budget that an agent had left at the end, mean over agents, domain units."""
        left = [agent.budget - agent.distance for agent in self.agents]
        return float(np.mean([rest if rest > DISTANCE_TOLERANCE else 0.0 for rest in left]))

    @property
    def end(self) -> float:
        """When the last agent stopped, in the scenario's unit of time."""
        return max(float(agent.route_time[-1]) for agent in self.agents)

    def positions(self, times: Float[np.ndarray, " t"]) -> Float[np.ndarray, "m t 2"]:
        """Where every agent was at these times, domain units; one that has stopped stays where it is."""
        return np.stack(
            [
                np.stack([np.interp(times, agent.route_time, agent.route[:, axis]) for axis in (0, 1)], axis=-1)
                for agent in self.agents
            ]
        )

    def surplus(self, values: Float[np.ndarray, "*k q"]) -> Float[np.ndarray, "*k q"]:
        """What these values on the grid exceed the threshold by; outside the survey area always just below zero."""
        over = values - self.scenario.threshold
        return np.where(self.inside, over, np.minimum(over, -1e-6))

    def measurement_instants(self) -> Float[np.ndarray, " t"]:
        """The times at which somebody measured, simultaneous ones once."""
        times = np.sort(np.concatenate([agent.measurement_time for agent in self.agents]))
        return times[np.append(np.diff(times) > time_tolerance(np.asarray(self.scenario.speeds)), True)[: len(times)]]

    def beliefs(self, times: Float[np.ndarray, " t"]) -> GridBeliefs:
        """The team's pooled belief from what had been measured by each of these times; inf: by the end."""
        taken = self._slots()[2]
        return self._beliefs(np.isfinite(taken) & (taken <= np.asarray(times)[:, None, None]))

    def own_beliefs(self) -> GridBeliefs:
        """Each agent's own belief at its last decision."""
        known = np.stack([agent.known for agent in self.agents])
        return self._beliefs(np.arange(self.scenario.measurements_per_agent) < known[:, :, None])

    def _slots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (m, s, 2), values (m, s) and times (m, s) of all slots; the time of an empty one is inf."""
        m, s = self.scenario.agents, self.scenario.measurements_per_agent
        x, y = np.zeros((m, s, 2), self.truth.dtype), np.zeros((m, s), self.truth.dtype)
        time = np.full((m, s), np.inf, self.truth.dtype)
        for i, agent in enumerate(self.agents):
            slots = slice(len(agent.measurement_y))
            x[i, slots], y[i, slots] = agent.measurement_x, agent.measurement_y
            time[i, slots] = agent.measurement_time
        return x, y, time

    def _beliefs(self, masks: Bool[np.ndarray, "k m s"]) -> GridBeliefs:
        x, y, _ = self._slots()
        masks = masks.reshape(len(masks), -1)
        padded = np.zeros((-len(masks) % _BELIEFS_PER_CALL + len(masks), masks.shape[1]), bool)
        padded[: len(masks)] = masks
        blocks = [
            jax.device_get(
                _grid_beliefs(
                    problem_of(self.scenario), x.reshape(-1, 2), y.reshape(-1), self.inside, block, self.prior
                )
            )
            for block in padded.reshape(-1, _BELIEFS_PER_CALL, masks.shape[1])
        ]
        beliefs = GridBeliefs(*(np.concatenate(rows)[: len(masks)] for rows in zip(*blocks, strict=True)))
        inside = {"the mean": beliefs.mean[:, self.inside], "the variance": beliefs.variance[:, self.inside]}
        refuse_non_finite(inside, lambda _: self._name)
        return beliefs

    @property
    def _name(self) -> str:
        return f"mission {self.index} of seed {self.seed}"


def shortest(value: np.generic) -> float:
    """The float with the fewest decimals that is this number at its own precision: 0.2, not 0.20000000298."""
    return float(str(value))


def replay(episode: Episode) -> EpisodeMetrics:
    """The metrics, computed from the recorded measurements and prior samples."""
    scenario = episode.scenario
    times = np.append(np.zeros(1, episode.truth.dtype), episode.measurement_instants())
    # Simultaneous measurements differ by rounding; each instant includes all of its own.
    pooled = episode.beliefs(
        times + np.append(0.0, np.full(len(times) - 1, time_tolerance(np.asarray(scenario.speeds))))
    )
    mean, variance, inside = pooled.mean[-1], pooled.variance[-1], episode.inside
    interesting = (episode.truth >= scenario.threshold) & inside
    x, y, time = episode._slots()
    taken = np.isfinite(time).reshape(-1)
    information: Any = jax.device_get(
        _information(problem_of(scenario), x.reshape(-1, 2), y.reshape(-1), taken, pooled.area[-1], episode.prior)
    )
    refuse_non_finite({"mutual information": information, "the truth": episode.truth[inside]}, lambda _: episode._name)
    return EpisodeMetrics(
        trace=shortest(pooled.trace[-1]),
        own_trace=episode.own_beliefs().trace,
        true_trace=float(np.sum(variance[interesting], dtype=np.float64)),
        rmse=float(np.sqrt(np.mean((mean - episode.truth)[inside] ** 2, dtype=np.float64))) if inside.any() else 0.0,
        mutual_information=shortest(information[()]),
        curve_time=times,
        curve_trace=pooled.trace,
    )


@kept
def _grid_beliefs(
    scenario: Problem,
    x: Float[Array, "n 2"],
    y: Float[Array, " n"],
    inside: Bool[Array, " q"],
    masks: Bool[Array, "k n"],
    prior: PriorSamples | None,
) -> tuple[Array, ...]:
    """The rows of `GridBeliefs` for the measurements in each mask, one after the other."""
    kernel, interest = kernel_of(scenario), interest_of(scenario)
    grid = evaluation_grid(scenario.grid, scenario.extent)
    process = None if prior is None else prior.process(kernel, x, grid, scenario.noise)

    def one(mask: Bool[Array, " n"]) -> tuple[Array, ...]:
        if process is None:
            belief = condition(kernel, x, y, mask, grid, scenario.noise)
            mean, variance = belief.mean, belief.variance
        else:
            mean, variance = process.given(y, mask, scenario.noise)
        area, trace = interest.area(mean, variance, inside), interest.trace(mean, variance, inside)
        return mean, variance, interest.bound(mean, variance), area, trace

    return lax.map(one, masks)


@kept
def _information(
    scenario: Problem,
    x: Float[Array, "n 2"],
    y: Float[Array, " n"],
    mask: Bool[Array, " n"],
    area: Bool[Array, " q"],
    prior: PriorSamples | None,
) -> Float[Array, ""]:
    """Mutual information over `area` after the measurements in the mask."""
    extra_noise = None
    if prior is not None:
        x, y, mask, extra_noise = prior.after(x, y, mask, scenario.noise)
    grid = evaluation_grid(scenario.grid, scenario.extent)
    return mutual_information(condition(kernel_of(scenario), x, y, mask, grid, scenario.noise, extra_noise), area)
