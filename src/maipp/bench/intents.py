"""What agents intend: the paths that an intent is fitted to, and how far the next intent is from the last.

Source: Yang et al. 2023, Fig. 3 (sampled paths) and Sec. V-B (stability, as symmetric Kullback-Leibler divergence):
longer paths make less stable intents; SGA+RRT and DI do best with the shortest, TI with those of medium length (6
nodes) all the same.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from maipp.bench.evaluations import Paired, paired
from maipp.bench.page import markdown, shown
from maipp.bench.tables import Row, known_rows
from maipp.engine import Mission, Planner, State, draw_missions, reset
from maipp.engine.observe import begin_event
from maipp.engine.rollout import run_recorded, step
from maipp.engine.score import score_missions
from maipp.errors import InputError
from maipp.markdown import mean_and_error, three
from maipp.planners import make_planner
from maipp.planners.announced.announcement import Announcement
from maipp.planners.intent import IntentPlanner
from maipp.scenario import Scenario
from maipp.team import Intent, destination_intent, fit_intent, trajectory_intent
from maipp.team.intent import is_announced, symmetric_kl
from maipp.typing import Bool, Float, Int, Key


class SampledPaths(NamedTuple):
    """What one decision samples, and both Gaussians fitted to it."""

    position: Float[np.ndarray, "2"]  # where the agent is, domain units
    paths: Float[np.ndarray, "a j 2"]  # nodes of the sampled paths
    taken: Bool[np.ndarray, "a j"]  # False beyond the budget
    nodes: Float[np.ndarray, "n 2"]  # of the agent's roadmap
    destination: Intent  # DI: fitted to the last node of each path
    trajectory: Intent  # TI: fitted to all nodes of all paths


def sampled_paths(scenario: Scenario, *, paths: int, steps: int, decision: int, seed: int) -> SampledPaths:
    """The paths at the given decision (0: the first) of the team in the first mission of a seed, planned by `ti`.

    Raises `InputError` where the mission has fewer decisions.
    """
    planner = make_planner("ti", scenario, {"paths": paths, "steps": steps})
    assert isinstance(planner, IntentPlanner)
    drawn = draw_missions(scenario, seed=seed, instances=1, planner=planner)
    mission = jax.tree.map(lambda array: array[0], drawn)
    key = jax.random.fold_in(jax.random.key(seed), 0)
    state = reset(planner, mission)
    advance = eqx.filter_jit(step)
    for _ in range(decision):
        state = advance(planner, mission, state, key)
    if not bool(state.active.any()):
        raise InputError(f"decision {decision}: the mission ends before; give a smaller number")
    state, agent, observation = begin_event(mission, state)
    memory = jax.tree.map(lambda array: array[agent], state.memory)
    look = eqx.filter_jit(IntentPlanner.trajectories)
    nodes, taken = look(planner, jax.random.fold_in(key, state.events), observation, memory)
    assert observation.roadmap is not None
    return SampledPaths(
        np.asarray(observation.position),
        np.asarray(nodes),
        np.asarray(taken),
        np.asarray(observation.roadmap.nodes),
        jax.tree.map(np.asarray, destination_intent(jnp.asarray(nodes), jnp.asarray(taken))),
        jax.tree.map(np.asarray, trajectory_intent(jnp.asarray(nodes), jnp.asarray(taken))),
    )


class History(NamedTuple):
    """The decisions of a batch of missions in their order; b missions, e events."""

    states: State  # at the end
    agent: Int[np.ndarray, "b e"]  # that decided
    counts: Bool[np.ndarray, "b e"]  # False where the mission had ended before
    intent: Intent  # (b, e): what it told, as a Gaussian; NaN where it told nothing


def intents_told(planner: Planner, missions: Mission, key: Key) -> History:
    """Run missions (leading axis b), and keep what each decision told.

    Mission i draws its randomness from `fold_in(key, i)`, as in `run_missions`. A planned path that was announced
    counts as the Gaussian fitted to the measurements planned on it.
    """
    states, events = run_recorded(planner, missions, key, as_intent)
    return History(states, events.agent, events.counts, events.kept)


def as_intent(message: Any) -> Intent:
    """A message as a Gaussian: an intent as it is, an announced path by its planned measurements."""
    if isinstance(message, Intent):
        return message
    if isinstance(message, Announcement):
        return fit_intent(message.points, jnp.isfinite(message.times))
    raise TypeError(f"{type(message).__name__} is neither an intent nor an announced path")


def divergences(history: History, agents: int) -> list[Float[np.ndarray, " pairs"]]:
    """For each mission, the symmetric KL divergence of all pairs of successive intents of one agent, nats."""
    told = np.asarray(is_announced(Intent(*map(jnp.asarray, history.intent)))) & history.counts
    pairs = [_successive(history.agent[i], told[i], agents) for i in range(len(told))]
    mission = np.repeat(np.arange(len(pairs)), [len(rows) for rows in pairs])
    first, second = np.concatenate(pairs).T
    before, after = (Intent(*(part[mission, which] for part in history.intent)) for which in (first, second))
    kl = np.asarray(jax.vmap(symmetric_kl)(before, after), np.float64)
    return [kl[mission == i] for i in range(len(pairs))]


def _successive(agent: Int[np.ndarray, " e"], told: Bool[np.ndarray, " e"], agents: int) -> Int[np.ndarray, "pairs 2"]:
    """The pairs of events at which one agent told an intent, and then its next."""
    own = [np.flatnonzero(told & (agent == i)) for i in range(agents)]
    return np.concatenate([np.stack([events[:-1], events[1:]], axis=-1) for events in own])


NODES = (3, 6, 9)  # of the sampled paths: j
KINDS = {
    "TI": {j: known_rows()[f"ti-{j}"] for j in NODES},
    "DI": {j: known_rows()[f"di-{j}"] for j in NODES},
    # By the most measurements that a path announces.
    "SGA+RRT": {j: known_rows()[f"sga-rrt-{length}"] for j, length in ((2, 0.3), (4, 0.6), (5, 0.9))},
}
_LEVEL = 0.05  # of the tests that a verdict rests on


@dataclass(frozen=True)
class Stability:
    """One planner with paths of one length."""

    kind: str  # a key of KINDS
    length: int  # nodes of a path, or measurements announced
    row: Row
    divergence: Float[np.ndarray, "instances 1"]  # symmetric KL of successive intents, mean of each mission, nats
    median: float  # of all pairs of all missions, nats
    trace: Float[np.ndarray, "instances 1"]  # final Tr(P) of the pooled belief


def measure(kind: str, length: int, scenario: Scenario, *, instances: int, seed: int) -> Stability:
    """Run the row of this kind and length on one mission per instance."""
    row = KINDS[kind][length]
    planner, missions = row.drawn(scenario, instances=instances, seed=seed)
    history = intents_told(planner, missions, jax.random.key(seed))
    kl = divergences(history, scenario.agents)
    trace = np.asarray(score_missions(missions, history.states).trace, np.float64)
    means = np.array([pairs.mean() if len(pairs) else math.nan for pairs in kl])
    return Stability(kind, length, row, means[:, None], float(np.median(np.concatenate(kl))), trace[:, None])


def stability_table(found: Sequence[Stability]) -> str:
    """Markdown: divergence and final Tr(P) of each kind and length."""
    rows = []
    for one in found:
        unit = "measurements" if one.kind == "SGA+RRT" else "nodes"
        kl, trace = (shown(values[np.isfinite(values[:, 0])]) for values in (one.divergence, one.trace))
        rows.append([f"{one.kind}, {one.length} {unit}", f"`{one.row.name}`", kl, three(one.median), trace])
    return markdown(pd.DataFrame(rows, columns=["paths", "row", "KL, mean", "KL, median", "Tr(P)"]), left=2)


def verdicts(found: Sequence[Stability]) -> str:
    """Markdown: each claim of the paper, whether these surveys confirm it, and the paired differences it rests on."""
    lines = []
    for kind, lengths in KINDS.items():
        by_length = {one.length: one for one in found if one.kind == kind}
        if set(by_length) != set(lengths):
            continue
        short, medium, long = (by_length[length] for length in sorted(lengths))
        rises = [_paired_kl(medium, short), _paired_kl(long, medium)]
        words = ", ".join(map(_difference, rises))
        lines.append(
            f"- {kind}: longer paths make less stable intents: **{_verdict(rises)}** (KL rises by {words}, from "
            f"{short.length} to {medium.length} and from {medium.length} to {long.length})."
        )
        best, others = (medium, (short, long)) if kind == "TI" else (short, (medium, long))
        gains = [paired(other.trace, best.trace) for other in others]
        words = ", ".join(
            f"{_difference(gain)} more with {other.length}" for gain, other in zip(gains, others, strict=True)
        )
        name = (
            f"paths of medium length ({best.length}) win" if kind == "TI" else f"the shortest paths ({best.length}) win"
        )
        lines.append(f"- {kind}: {name}: **{_verdict(gains)}** (Tr(P): {words}).")
        if kind == "TI":
            despite = _verdict([rises[0], *gains])
            lines.append(f"- TI: paths of medium length win although their intents are less stable: **{despite}**.")
    return "\n".join(lines)


def _paired_kl(more: Stability, less: Stability) -> Paired:
    """The difference of divergences over the missions in which both have successive intents."""
    both = np.isfinite(more.divergence[:, 0]) & np.isfinite(less.divergence[:, 0])
    return paired(more.divergence[both], less.divergence[both])


def _verdict(differences: Sequence[Paired]) -> str:
    """Confirmed where all differences are positive beyond chance, denied where one is negative beyond chance."""
    clear = [test.p is not None and test.p < _LEVEL for test in differences]
    if all(sure and test.mean > 0 for sure, test in zip(clear, differences, strict=True)):
        return "confirmed"
    if any(sure and test.mean < 0 for sure, test in zip(clear, differences, strict=True)):
        return "denied"
    return "not decided"


def _difference(test: Paired) -> str:
    return mean_and_error(test.mean, test.se) + ("" if test.p is None else f" (p = {test.p:.2g})")
