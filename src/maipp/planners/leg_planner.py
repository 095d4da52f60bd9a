"""Planning one agent's next legs: what every continuous receding-horizon planner does."""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
from jax.scipy.special import ndtr

from maipp.belief import Belief
from maipp.engine.decision import Observation, option
from maipp.engine.polyline import along_paths, first_part
from maipp.errors import InputError
from maipp.planners.announced import Announcement
from maipp.planners.first_leg import FirstLeg, depart, either, length
from maipp.planners.headings import bend, walk, walk_bent
from maipp.planners.lookahead import measurement_offsets, predicted
from maipp.planners.plan_search import Finalists, SearchOptions, search
from maipp.planners.plan_variance import variance_left
from maipp.planners.plane_planner import PlanePlanner
from maipp.planners.rendezvous import Rendezvous, appointment, lateness
from maipp.planners.transit import best_transit
from maipp.roadmap.ways import long_run
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Int, Key, Real

# Width of the border of the area by which grid points are picked for the search, field units.
_BORDER = 0.15

# Powers of the inverse plastic number: multiples of them fill a plane evenly (Roberts 2018, the R2 sequence).
_LATTICE = (0.7548776662, 0.5698402910)

# A plan that comes this far too late to the meeting, inverse domain units, is worth half.
_LATE = 50.0

# How far from a measurement it still tells of a point, in length scales.
_NEAR = 0.6

# Where it is not said otherwise, agents of teams up to this size plan this many legs; larger teams about so many in
# all, and each agent at least so many (docs/planners.md has the measurements behind this and the next).
_SMALL_TEAM, _FAR = 4, 8
_TEAM_LEGS, _FEWEST = 20, 2

# The spread trusted, and the length scale, in measurement intervals, below which it falls with the square of that.
_SPREAD, _RESOLVED = 0.3, 2.0

# More agents than this plan twice on the way of each leg, and fewer missions of them are stepped together.
_FEW = 5

# Half of what the record of a route has room for: among zones, legs may be short.
_MOST_DECISIONS = 4

# A leg of less than this part of what it costs is worth looking for another one.
_SHORT = 0.5


class Ahead(NamedTuple):
    """The next legs of an agent, a measurement at the end of each."""

    offsets: Float[Array, " h"]  # distances to the measurements, domain units
    steps: Float[Array, " h"]  # lengths of the legs, domain units
    affordable: Bool[Array, " h"]  # within its budget


class LegPlanner(PlanePlanner):
    """Finds the legs, one measurement each, with the lowest expected Tr(P)."""

    horizon: int | None = option(None, meaning="legs planned; None: by the number of agents")
    decisions: int | None = option(None, meaning="times that the agent plans per leg; None: by the number of agents")
    candidates: int = option(128, meaning="random plans scored")
    elites: int = option(8, meaning="best of them, refined by gradient")
    steps: int = option(20, meaning="gradient steps")
    rate: float = option(0.2, meaning="first gradient step, radians or legs")
    spread: float | None = option(None, meaning="trust in the spread of values not yet measured")
    blur: float = option(0.005, meaning="smoothing of the area's border, field units")
    points: int = option(225, meaning="grid points that the search looks at")
    meet: bool = option(True, meaning="with limited communication: end where the others end")
    recall: bool = option(True, meaning="of agents out of range, count on what was last heard")

    def check(self) -> None:
        """Raise InputError for options out of range."""
        if self.horizon is not None and self.horizon < 1:
            raise InputError(f"horizon={self.horizon}: give a whole number >= 1, or none")
        if self.decisions is not None and not 1 <= self.decisions <= _MOST_DECISIONS:
            raise InputError(f"decisions={self.decisions}: give a whole number from 1 to {_MOST_DECISIONS}, or none")
        for name in ("candidates", "elites", "steps", "points"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}={getattr(self, name)}: give a whole number >= 1")
        if self.elites > self.candidates:
            raise InputError(f"elites={self.elites} is more than candidates={self.candidates}; give at most as many")
        if not self.rate > 0 or not self.blur > 0:
            raise InputError(f"rate={self.rate}, blur={self.blur}: both must be > 0")
        if self.spread is not None and not self.spread >= 0:
            raise InputError(f"spread={self.spread}: give a number >= 0, or none")

    @property
    def waypoints_per_decision(self) -> int:
        """The bend of a leg and its end."""
        return 2

    @property
    def legs(self) -> int:
        """Legs planned, one measurement each: `horizon`; left out, eight in small teams, fewer in larger ones."""
        if self.horizon is not None:
            return self.horizon
        if self.scenario.agents <= _SMALL_TEAM:
            return _FAR
        return max(_TEAM_LEGS // self.scenario.agents, _FEWEST)

    @property
    def decisions_per_leg(self) -> int:
        """How often an agent plans on the way of each leg: `decisions`, or twice with many agents."""
        if self.decisions is not None:
            return self.decisions
        return 1 if self.scenario.agents <= _FEW else 2

    @property
    def missions_per_core(self) -> int:
        """16, as by default; 4 with many agents, whose measurements fill the core's cache: a fifth faster with ten."""
        return 16 if self.scenario.agents <= _FEW else 4

    def plan_legs(
        self,
        key: Key,
        belief: Belief,
        inside: Bool[Array, " q"],
        position: Float[Array, "2"],
        last: Float[Array, " h *d"],
        steps: Float[Array, " h"],
        affordable: Bool[Array, " h"],
        known: Float[Array, " q"] | None = None,
        *,
        meeting: Rendezvous | None = None,
        remaining: Float[Array, ""] | None = None,
        proposals: Float[Array, "p h 2"] | None = None,
    ) -> Finalists:
        """The best plans found for one agent, given what the belief already counts as measured.

        `last` is the plan to begin from: headings (h,), radians, for straight legs, or displacements (h, 2), units of
        a leg, for legs that may bend; the plans returned are of the same form. `known` is the variance that measured
        values leave, where the belief counts some as measured whose values are not known yet. Plans that miss the
        `meeting` at the end are worth less, if `remaining` (domain units) tells when that is.
        `proposals` are plans to try besides random ones.
        """
        extent = self.scenario.extent
        known = belief.variance if known is None else known
        reach = jnp.sum(jnp.where(affordable, steps, 0.0))
        index = self.points_in_play(belief, inside, position, reach)
        coarse, coarse_inside, coarse_known = belief.at(index), inside[index], known[index]

        def value(
            belief: Belief, inside: Bool[Array, " i"], known: Float[Array, " i"], plans: Float[Array, "c h *d"]
        ) -> Float[Array, " c"]:
            points = self.walked(position, plans, steps) if last.ndim == 2 else walk(position, plans, steps, extent)
            taken = jnp.broadcast_to(affordable, points.shape[:-1])
            left = self.expected(*self._after(belief, points, taken), known, inside)
            if meeting is None or remaining is None:
                return left
            return left * (1.0 + _LATE * lateness(meeting, position, points, steps, remaining))

        return search(
            key,
            last,
            score=lambda plans: value(coarse, coarse_inside, coarse_known, plans),
            final=lambda plans: value(belief, inside, known, plans),
            options=SearchOptions(self.candidates, self.elites, self.steps, self.rate),
            proposals=proposals,
        )

    def meeting(self, observation: Observation) -> Rendezvous | None:
        """Where the due agent has to be at the end; None: anywhere."""
        return appointment(self.scenario, observation, meet=self.meet, zones=self.zones)

    def _after(
        self, belief: Belief, points: Float[Array, "c h 2"], taken: Bool[Array, "c h"]
    ) -> tuple[Float[Array, "c q"], Float[Array, "c q"]]:
        """Mean and variance at the query points after each plan's measurements."""
        if self.scenario.virtual_value == "zero":
            return predicted(belief, points, taken, virtual_value="zero")
        variance = variance_left(belief, points, taken)
        return jnp.broadcast_to(belief.mean, variance.shape), variance

    def walked(
        self, position: Float[Array, "2"], plans: Float[Array, "*c h 2"], steps: Float[Array, " h"]
    ) -> Float[Array, "*c h 2"]:
        """Where the legs of plans end: displacements in units of a leg, from `position`."""
        return walk_bent(position, plans, steps, self.scenario.extent, self.zones)

    def ahead(self, observation: Observation) -> Ahead:
        """The due agent's next legs."""
        offsets = measurement_offsets(observation.to_next_measurement, self.scenario.measurement_interval, self.legs)
        affordable = offsets <= observation.remaining + DISTANCE_TOLERANCE
        return Ahead(offsets, jnp.diff(offsets, prepend=0.0), affordable)

    def set_out(
        self, observation: Observation, belief: Belief, plan: Float[Array, "h 2"], ahead: Ahead
    ) -> tuple[Float[Array, "2 2"], Announcement, Float[Array, "h 2"]]:
        """What the due agent travels before it plans again, what it announces, and what is left of its plan then.

        What `belief` counts as measured is worth nothing. Where there are no-go zones, the agent may set out for
        something farther away that is worth more for the way to it, and does not stand still before its budget is
        spent.
        """
        position = observation.position
        points = self.walked(position, plan, ahead.steps)
        way = jnp.stack([bend(position, points[0], ahead.steps[0], self.scenario.extent, self.zones), points[0]])
        leg = FirstLeg(way, points, plan)
        if self.zones is not None:
            leg = self._better(observation, belief, leg, ahead)
        times = jnp.where(ahead.affordable, observation.time + ahead.offsets / observation.speed, jnp.inf)
        way, left = depart(position, leg, ahead.steps, self.scenario.measurement_interval / self.decisions_per_leg)
        return way, Announcement(leg.points, times), left

    def _better(self, observation: Observation, belief: Belief, leg: FirstLeg, ahead: Ahead) -> FirstLeg:
        """The leg, or the beginning of the way to something that is worth more for its length, or any way out."""
        zones, position, inside = self.zones, observation.position, observation.inside
        assert zones is not None
        (offsets, steps, affordable), interval = ahead, self.scenario.measurement_interval
        known = observation.belief.variance
        now = self.expected(belief.mean, belief.variance, known, inside)

        def gain(points: Float[Array, "k i 2"], taken: Bool[Array, "k i"]) -> Float[Array, " k"]:
            value = self.scenario.virtual_value
            return now - self.expected(*predicted(belief, points, taken, virtual_value=value), known, inside)

        planned = gain(leg.points[None], affordable[None])[0]
        rate = planned / jnp.maximum(jnp.sum(jnp.where(affordable, steps, 0.0)), interval)
        transit = best_transit(
            zones,
            position,
            observation.remaining,
            interval,
            jnp.where(inside, self.worth(belief), 0.0),
            lambda points: gain(points, jnp.ones(points.shape[:-1], bool)),
        )
        far = jnp.isfinite(transit.distance) & (transit.distance >= steps[0])
        points, _ = along_paths(position, transit.path[None], offsets)
        begins = jnp.concatenate([position[None], points[0, :-1]])
        plan = (points[0] - begins) / jnp.maximum(steps, 1e-9)[:, None]
        away = FirstLeg(first_part(position, transit.path, steps[0])[:2], points[0], plan)
        meeting = self.meeting(observation)
        in_time = jnp.asarray(True)
        if meeting is not None:
            late, later = (
                lateness(meeting, position, each, steps, observation.remaining) for each in (leg.points, points[0])
            )
            in_time = later <= late + 1e-6
        leg = either(far & in_time & (transit.rate > rate), away, leg)

        # Walls on all sides can leave a plan hardly any way: better somewhere than nowhere.
        end = long_run(zones, position, steps[0], self.scenario.extent)
        run = FirstLeg(jnp.stack([end, end]), jnp.broadcast_to(end, leg.points.shape), jnp.zeros_like(leg.plan))
        run = either(far, away, run)
        short = length(position, leg.way) < _SHORT * jnp.minimum(steps[0], observation.remaining)
        return either(short & (length(position, run.way) > length(position, leg.way)), run, leg)

    def expected(
        self,
        mean: Float[Array, "*c q"],
        variance: Float[Array, "*c q"],
        known: Float[Array, " q"],
        inside: Bool[Array, " q"],
    ) -> Float[Array, "*c"]:
        """What a plan is judged by: the Tr(P) expected after it."""
        return self.interest.expected_trace(mean, variance, known, inside, spread=self._trusted(), blur=self.blur)

    def _trusted(self) -> Real:
        """The spread of values not yet measured that plans count on, in units of the belief's deviation."""
        # Who takes planned values for zero has no doubt about them.
        if self.scenario.virtual_value == "zero":
            return 0.0
        if self.spread is not None:
            return self.spread
        resolved = self.scenario.length_scale / (_RESOLVED * self.scenario.measurement_interval)
        return _SPREAD * jnp.minimum(1.0, resolved) ** 2

    def worth(self, belief: Belief) -> Float[Array, " q"]:
        """How uncertain the grid points are, as far as they may be of high interest."""
        bound = self.interest.bound(belief.mean, belief.variance)
        return belief.variance * ndtr((bound - self.interest.threshold) / _BORDER)

    def points_in_play(
        self,
        belief: Belief,
        inside: Bool[Array, " q"],
        position: Float[Array, "2"] | None = None,
        reach: Float[Array, ""] | None = None,
    ) -> Int[Array, " i"]:
        """Indices of the grid points that matter most: uncertain, maybe of high interest, and within reach if given."""
        weight = self.worth(belief)
        if position is not None and reach is not None:
            offset = belief.query - position
            far = jnp.sum(offset * offset, axis=-1) > (reach + _NEAR * self.scenario.length_scale) ** 2
            # Not nothing: where few points are within reach, the rest is filled up by weight.
            weight = jnp.where(far, 1e-3 * weight, weight)
        # Where all points are worth alike, as at first, an even lattice of them and not the first ones.
        count = belief.query.shape[0]
        x, y = jnp.divmod(jnp.arange(count), self.scenario.grid)
        weight = weight * (1.0 + (_LATTICE[0] * x + _LATTICE[1] * y) % 1.0)
        return lax.top_k(jnp.where(inside, weight, -1.0), min(self.points, count))[1]
