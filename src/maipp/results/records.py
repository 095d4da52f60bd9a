"""From the record of a survey, an episode.json, to what it took home."""

import os
from pathlib import Path

import numpy as np

from maipp.engine.episode import Episode
from maipp.engine.episode_io import read_episode
from maipp.live.belief_problem import mission_of
from maipp.live.belief_query import moments
from maipp.live.measurements import Slots
from maipp.results.taken import Beliefs, Taken, TakenRobot, TakenSample, from_home
from maipp.surveys.standardise import EVERYTHING

_EXPECTED = (
    "Planned, not measured: the values are those that the samples before the survey lead to expect, so the map is what "
    "is expected, and its uncertainty what will be left"
)
_STOPPED = {
    "budget": "stopped: budget used up",
    "planner": "stopped: nothing worth going to",
    "home": "stopped: at home",
    "not-finite": "stopped: its planner named no place",
    "record-full": "stopped: its record was full",
}


def taken_recorded(path: str | os.PathLike[str]) -> Taken:
    """What a recorded survey took home. Raises `InputError` as `read_episode`."""
    episode = read_episode(path)
    names = tuple(f"agent {number}" for number in range(len(episode.agents)))
    return Taken(
        source=Path(path).name,
        live=False,
        title="Survey",
        date=None,
        planner=episode.planner,
        episode=episode,
        seconds_per_time=None,
        crs=episode.geo.crs,
        area=None,
        no_go=(),
        threshold_given=episode.scenario.threshold > EVERYTHING,
        truth_known=not episode.expected,
        samples=tuple(_samples(episode, names)),
        robots=_robots(episode, names),
        belief=belief_of(episode),
        notes=(_EXPECTED,) if episode.expected else (),
    )


def _samples(episode: Episode, names: tuple[str, ...]) -> list[TakenSample]:
    there, samples = episode.geo, []
    for number, (name, agent) in enumerate(zip(names, episode.agents, strict=True)):
        places, values = there.to_user(agent.measurement_x), there.to_user_values(agent.measurement_y)
        rows = zip(agent.measurement_time, places, values, strict=True)
        for order, (time, (x, y), value) in enumerate(rows):
            numbers = (float(number) for number in (time, x, y, value))
            samples.append(TakenSample(f"{number}-{order}", name, *numbers, surprise=None, out=None))
    return sorted(samples, key=lambda sample: sample.time)


def _robots(episode: Episode, names: tuple[str, ...]) -> tuple[TakenRobot, ...]:
    scenario, rows = episode.scenario, []
    ends = scenario.ends_from([agent.start for agent in episode.agents]) if scenario.homes else ((),) * len(names)
    for number, (name, agent) in enumerate(zip(names, episode.agents, strict=True)):
        position = agent.route[-1].astype(np.float64)
        away, home = from_home(position, ends[number], scenario.measurement_interval)
        rows.append(
            TakenRobot(
                name=name,
                budget=agent.budget,
                reserve=float(scenario.reserves[number]),
                travelled=agent.distance,
                status=_STOPPED.get(agent.stopped_by or "", "ended"),
                time=float(agent.route_time[-1]),
                position=position,
                samples=len(agent.measurement_y),
                away=away,
                home=home,
            )
        )
    return tuple(rows)


def belief_of(episode: Episode) -> Beliefs:
    """The belief from all that was measured, asked as that of a live survey is."""
    prior, starts = episode.prior, np.stack([agent.start for agent in episode.agents])
    samples = None if prior is None else (np.asarray(prior.x), np.asarray(prior.y))
    noise = None if prior is None or prior.noise is None else np.asarray(prior.noise)
    mission = mission_of(episode.scenario, starts, samples, noise)
    counts = [len(agent.measurement_y) for agent in episode.agents]
    x = np.concatenate([agent.measurement_x for agent in episode.agents])
    y = np.concatenate([agent.measurement_y for agent in episode.agents])
    time = np.concatenate([agent.measurement_time for agent in episode.agents])
    by = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    room = max(-len(y) % 64, 64 - len(y))  # numbers of slots, each of which is compiled for, are few
    slots = Slots(
        np.pad(x, ((0, room), (0, 0))),
        np.pad(y, (0, room)),
        np.pad(time, (0, room), constant_values=np.inf),
        np.pad(by, (0, room)),
        np.arange(len(y) + room) < len(y),
    )
    return lambda points, foresight=None: moments(mission, slots, points, foresight)
