"""What a journal's header says of the place: enough to make belief and map of its measurements without another file."""

from dataclasses import dataclass
from typing import Annotated, Any

import jax
import numpy as np

from maipp.belief.refit import HyperPrior
from maipp.engine import Mission, draw_missions
from maipp.engine.episode_keys import Above0
from maipp.engine.episode_numbers import numbers
from maipp.engine.episode_place import read_reference, read_system
from maipp.live.gate import LEVEL
from maipp.live.site import Ring, Site
from maipp.live.units import Units
from maipp.live.world import Setup, World, first_room
from maipp.records import Length, Value, Within
from maipp.records.kinds import Finite
from maipp.scenario import Scenario
from maipp.surveys.standardise import PreparedSurvey, interest_beta
from maipp.typing import Float

_Ring = Annotated[tuple[tuple[Finite, Finite], ...], Length(3)]
_Level = Annotated[float, Within(0, wide=True)]


@dataclass(frozen=True, eq=False)
class ScaledSamples:
    """Samples from before the survey."""

    x: Float[np.ndarray, "p 2"]  # domain units
    y: Float[np.ndarray, " p"]  # standardised values
    noise: Float[np.ndarray, " p"]  # variance of each


@dataclass(frozen=True, eq=False)
class BeliefProblem:
    """The problem of a live survey without planner and randomness: what beliefs and gate are made of, and its site."""

    scenario: Scenario
    units: Units
    starts: Float[np.ndarray, "m 2"]  # domain units
    room: int  # measurements of each robot that there is room for at first
    gate: float  # surprise beyond which a measurement is kept out; 0: none is
    adapt: HyperPrior | None  # what the kernel is refitted with; None: it stays as it is
    prior: ScaledSamples | None
    site: Site
    clearance: float = 0.0  # that zones added under way are kept clear of, domain units
    beta_follows: bool = False  # whether the scenario's `beta` follows from the threshold

    def mission(self) -> Mission:
        """The unbatched mission that beliefs are of: the live survey's, without roadmaps and homes."""
        prior = self.prior
        samples, noise = (None, None) if prior is None else ((prior.x, prior.y), prior.noise)
        return mission_of(self.scenario, self.starts, samples, noise)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, texts and lists, ready for JSON."""
        frame, site = self.units.frame, self.site
        return {
            "title": site.title,
            "scenario": self.scenario.to_dict(),
            "frame": None if frame is None else frame.to_dict(),
            "crs": site.crs.to_dict(),
            "seconds_per_time": self.units.seconds_per_time,
            "starts": self.starts.tolist(),
            "room": self.room,
            "gate": self.gate,
            "adapt": None if self.adapt is None else self.adapt._asdict(),
            "threshold": site.threshold,
            "area": site.area,
            "no_go": site.no_go,
            "clearance": self.clearance,
            "beta_follows": self.beta_follows,
            "prior": None if self.prior is None else _columns(self.prior),
        }


def mission_of(
    scenario: Scenario,
    starts: Float[np.ndarray, "m 2"],
    prior: tuple[np.ndarray, np.ndarray] | None,
    noise: np.ndarray | None,
) -> Mission:
    """The unbatched mission that beliefs are of, without roadmaps and homes; `noise` is that of the `prior` samples."""
    # In single precision a start on the border may lie outside.
    inside = np.clip(starts.astype(np.float64), 0.0, scenario.extent)
    scenario = scenario.replace(start=[tuple(start) for start in inside.tolist()], end=None)
    drawn = draw_missions(scenario, seed=0, instances=1, roadmaps=False, prior=prior, prior_noise=noise)
    return jax.tree.map(lambda a: a[0], drawn)


def place_of(world: World, setup: Setup) -> BeliefProblem:
    """The place of a live survey."""
    mission, prior = world.mission, None
    if mission.prior_x is not None and mission.prior_y is not None:
        noise = mission.params.noise if mission.prior_noise is None else mission.prior_noise
        x, y = np.asarray(mission.prior_x, np.float64), np.asarray(mission.prior_y, np.float64)
        prior = ScaledSamples(x, y, np.broadcast_to(np.asarray(noise, np.float64), y.shape))
    starts = np.asarray(mission.start, np.float64)
    kept = setup.units, starts, setup.room, setup.gate, setup.adapt, prior, setup.site, setup.clearance
    return BeliefProblem(world.scenario, *kept, setup.beta_follows)


def place_in(mission: PreparedSurvey | Scenario, seed: int, epoch: float) -> BeliefProblem:
    """The place of a live survey of this mission, for a journal without it; `seed` draws starts left open."""
    if isinstance(mission, Scenario):
        scenario, units, prior = mission, Units(mission.extent, epoch=epoch), None
        gate, adapt, site, clearance, follows = LEVEL, None, Site(), 0.0, False
    else:
        scenario, gate, site, adapt = mission.scenario, mission.survey.gate, Site.of(mission), mission.adapt
        units = Units(scenario.extent, mission.frame, epoch, mission.seconds_per_time)
        clearance, follows = mission.margin / mission.frame.scale, "beta" not in mission.survey.scenario
        noise = np.full(len(mission.prior_y), mission.prior_noise)
        prior = ScaledSamples(mission.prior_x, mission.prior_y, noise) if len(noise) else None
    drawn = draw_missions(scenario.replace(end=None), seed=seed, instances=1, roadmaps=False)
    return BeliefProblem(
        scenario,
        units,
        np.asarray(drawn.start[0], np.float64),
        first_room(scenario),
        gate,
        adapt,
        prior,
        site,
        clearance,
        follows,
    )


def read_place(key: Value, epoch: float) -> BeliefProblem:
    """The place that a header holds. Raises `InputError` for what is missing or wrong in it."""
    scenario = key["scenario"].make(Scenario.create, key["scenario"].mapping())
    frame = read_reference(key["frame"], scenario)
    real = np.dtype(np.float64)
    starts = [start.fit(tuple[Finite, Finite]) for start in key["starts"].items(count=scenario.agents)]
    return BeliefProblem(
        scenario=scenario,
        units=Units(scenario.extent, frame, epoch, key["seconds_per_time"].fit(Above0)),
        starts=np.array(starts),
        room=key["room"].fit(Annotated[int, Within(1, most=1_000_000)]),
        gate=key["gate"].fit(_Level),
        clearance=key["clearance"].fit(Annotated[float, Within(0)]),
        beta_follows=_follows(key, scenario),
        adapt=_read_adapt(key["adapt"]) if "adapt" in key else None,
        prior=_read_prior(key["prior"], real) if "prior" in key else None,
        site=Site(
            title=key["title"].fit(str),
            crs=read_system(key["crs"]),
            area=_read_ring(key["area"]) if "area" in key else None,
            no_go=tuple(map(_read_ring, key["no_go"].items())),
            threshold=key["threshold"].fit(bool),
        ),
    )


def _follows(key: Value, scenario: Scenario) -> bool:
    """Whether the confidence follows from the threshold; journals of an earlier version do not say it."""
    if "beta_follows" in key:
        return key["beta_follows"].fit(bool)
    return "frame" in key and scenario.beta == interest_beta(scenario.threshold)


def _read_prior(key: Value, real: np.dtype) -> ScaledSamples:
    values = numbers(key["value"], real)
    x, y, noise = (numbers(key[name], real, len(values)) for name in ("x", "y", "noise"))
    return ScaledSamples(np.stack([x, y], axis=-1), values, noise)


def _read_adapt(key: Value) -> HyperPrior:
    kinds: dict[str, Any] = dict.fromkeys(HyperPrior._fields, Above0) | {"level_known": bool}
    return HyperPrior(**{name: key[name].fit(kind) for name, kind in kinds.items()})


def _read_ring(key: Value) -> Ring:
    return key.fit(_Ring)


def _columns(prior: ScaledSamples) -> dict[str, list[float]]:
    (x, y), value, noise = prior.x.T.tolist(), prior.y.tolist(), prior.noise.tolist()
    return {"x": x, "y": y, "value": value, "noise": noise}
