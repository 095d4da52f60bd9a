"""What agents told at every decision of a survey, and how far one intent is from the next.

Source: Yang et al. 2023, Sec. V-B (stability of intents: symmetric Kullback-Leibler divergence).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine import Mission, Planner, State
from maipp.engine.rollout import run_recorded
from maipp.planners.announced.announcement import Announcement
from maipp.team import Intent, fit_intent
from maipp.team.intent import is_told, symmetric_kl
from maipp.typing import Bool, Float, Int, Key


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
    told = np.asarray(is_told(Intent(*map(jnp.asarray, history.intent)))) & history.counts
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
