"""The search for an agent's next legs in the plane: an objective, an optimiser, and what it sets out on."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.belief import Belief
from maipp.engine.decision import Observation
from maipp.engine.options import option
from maipp.errors import InputError
from maipp.foresight import Foresight, ForesightName
from maipp.planners.announced.announced_measurements import latest
from maipp.planners.announced.announcement import Announcement, nothing_announced, with_announced
from maipp.planners.announced.meeting import appointment, lateness
from maipp.planners.lookahead import measurement_offsets
from maipp.planners.plane.planner_zones import planner_zones
from maipp.planners.plane.walks import bend, walk, walk_bent
from maipp.planners.search.detour import better_leg
from maipp.planners.search.first_leg import FirstLeg, depart
from maipp.planners.search.objective import Objective
from maipp.planners.search.optimiser import Finalists, SearchOptions, search
from maipp.planners.search.outlook import Ahead, Outlook
from maipp.planners.search.prospect import Prospect, aim_of, check_aim, foresight_for, prospect_of
from maipp.problem import Problem
from maipp.roadmap.zones import Zones
from maipp.scenario import DISTANCE_TOLERANCE, Scenario
from maipp.typing import Array, Bool, Float, Key

# A plan that comes this far too late to the meeting, inverse domain units, is worth half.
_LATE = 50.0

# Where it is not said otherwise, agents of teams up to this size plan this many legs; larger teams about so many in
# all, and each agent at least so many (docs/evidence/planning.md has the measurements behind this and the next).
_SMALL_TEAM, _FAR = 4, 8
_TEAM_LEGS, _FEWEST = 20, 2

# Where it is not said otherwise, a search takes so many gradient steps for each leg, and at least so many, from so many
# random plans of many legs or of few, which cost less (docs/evidence/planning.md has the measurements behind this too).
_STEPS_PER_LEG, _FEWEST_STEPS = 2.75, 12
_CANDIDATES, _SHORT_CANDIDATES, _SHORT_LEGS = 64, 128, 4

# More agents than this plan twice on the way of each leg, and fewer missions of them are stepped together.
_FEW = 5

# While there are many plans, one in so many of the points is looked at.
_ROUGH = 2

# Half of what the record of a route has room for: among zones, legs may be short.
_MOST_DECISIONS = 4


class LegMemory(NamedTuple):
    """What an agent that plans legs remembers from decision to decision."""

    plan: Float[Array, "h 2"]  # what is left of its last plan: displacements, units of a leg
    heard: Announcement  # last heard from each agent, leading axis m


class PlanSearch(eqx.Module):
    """Finds the legs, one measurement each, with the lowest expected Tr(P)."""

    scenario: Scenario | Problem
    zones: Zones | None = eqx.field(default=None, kw_only=True)  # None: those of the scenario, if it has any
    foreseer: Foresight | None = eqx.field(default=None, kw_only=True)  # None: the one named, if it is needed
    horizon: int | None = option(None, meaning="legs planned; None: by the number of agents")
    decisions: int | None = option(None, meaning="times that the agent plans per leg; None: by the number of agents")
    candidates: int | None = option(None, meaning="random plans scored; None: by the number of legs")
    elites: int = option(8, meaning="best of them, refined by gradient")
    steps: int | None = option(None, meaning="gradient steps; None: by the number of legs")
    survivors: int = option(2, meaning="best of these after half of the steps, refined to the end")
    rate: float = option(0.2, meaning="first gradient step, radians or legs")
    spread: float | None = option(None, meaning="trust in the spread of values not yet measured")
    blur: float = option(0.005, meaning="smoothing of the area's border, field units")
    points: int = option(225, meaning="grid points that the search looks at")
    meet: bool = option(True, meaning="with limited communication: end where the others end")
    recall: bool = option(True, meaning="of agents out of range, count on what was last heard")
    foresight: ForesightName = option("protocol", meaning="who says what the field will be where it is not measured")
    aim: float | None = option(None, meaning="weight of places likely of interest; None: 0.55, for protocol 0")

    def __post_init__(self) -> None:
        if self.zones is None:
            self.zones = planner_zones(self.scenario)
        self.foreseer = foresight_for(self.foresight, self.aim, self.scenario, self.foreseer)

    def check(self) -> None:
        """Raise InputError for options out of range."""
        if self.horizon is not None and self.horizon < 1:
            raise InputError(f"horizon={self.horizon}: give a whole number >= 1, or none")
        if self.decisions is not None and not 1 <= self.decisions <= _MOST_DECISIONS:
            raise InputError(f"decisions={self.decisions}: give a whole number from 1 to {_MOST_DECISIONS}, or none")
        for name in ("elites", "points"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}={getattr(self, name)}: give a whole number >= 1")
        for name in ("candidates", "steps"):
            if (value := getattr(self, name)) is not None and value < 1:
                raise InputError(f"{name}={value}: give a whole number >= 1, or none")
        if self.elites > self.candidates_scored:
            count = self.candidates_scored
            raise InputError(f"elites={self.elites} is more than candidates={count}; give at most as many")
        if not self.rate > 0 or not self.blur > 0:
            raise InputError(f"rate={self.rate}, blur={self.blur}: both must be > 0")
        if self.spread is not None and not self.spread >= 0:
            raise InputError(f"spread={self.spread}: give a number >= 0, or none")
        if self.spread is not None and self.foreseer is not None:
            raise InputError(f"spread={self.spread}: a foresight, or an aim, has a spread of its own; leave it out")
        check_aim(self.aim)

    @property
    def legs(self) -> int:
        """Legs planned, one measurement each: `horizon`; left out, eight in small teams, fewer in larger ones."""
        if self.horizon is not None:
            return self.horizon
        if self.scenario.agents <= _SMALL_TEAM:
            return _FAR
        return max(_TEAM_LEGS // self.scenario.agents, _FEWEST)

    @property
    def candidates_scored(self) -> int:
        """That a search scores: `candidates`; left out, 64, or 128 of few legs."""
        if self.candidates is not None:
            return self.candidates
        return _CANDIDATES if self.legs > _SHORT_LEGS else _SHORT_CANDIDATES

    @property
    def gradient_steps(self) -> int:
        """Of a search: `steps`; left out, the more the more legs there are."""
        return self.steps if self.steps is not None else max(round(_STEPS_PER_LEG * self.legs), _FEWEST_STEPS)

    @property
    def decisions_per_leg(self) -> int:
        """How often an agent plans on the way of each leg: `decisions`, or twice with many agents."""
        if self.decisions is not None:
            return self.decisions
        return 1 if self.scenario.agents <= _FEW else 2

    @property
    def waypoints(self) -> int:
        """Of what an agent sets out on: the bend of a leg and its end."""
        return 2

    @property
    def missions_per_core(self) -> int:
        """16, as by default; 4 with many agents, whose measurements fill the core's cache: a fifth faster with ten."""
        return 16 if self.scenario.agents <= _FEW else 4

    @property
    def objective(self) -> Objective:
        """What plans are judged by."""
        return Objective(self.scenario, self.spread, self.blur, aim_of(self.foresight, self.aim))

    def first_memory(self) -> LegMemory:
        """The memory of an agent that has neither planned nor heard anything."""
        nothing = nothing_announced(self.legs)
        heard = jax.tree.map(lambda a: jnp.broadcast_to(a, (self.scenario.agents, *a.shape)), nothing)
        return LegMemory(jnp.zeros((self.legs, 2)).at[:, 0].set(1.0), heard)

    def counted(self, observation: Observation, heard: Announcement) -> tuple[Belief, Announcement]:
        """The due agent's belief with what others announced counted as measured, and what was heard last of each."""
        heard = latest(observation.heard, observation.messages, heard)
        return with_announced(observation, heard, self.scenario.virtual_value, self.recall), heard

    def ahead(self, observation: Observation) -> Ahead:
        """The due agent's next legs."""
        offsets = measurement_offsets(observation.to_next_measurement, self.scenario.measurement_interval, self.legs)
        affordable = offsets <= observation.remaining + DISTANCE_TOLERANCE
        return Ahead(offsets, jnp.diff(offsets, prepend=0.0), affordable)

    def outlook(self, observation: Observation, belief: Belief, ahead: Ahead) -> Outlook:
        """What the due agent plans from; `belief` counts what others announced."""
        return Outlook(
            observation.position,
            ahead.steps,
            ahead.affordable,
            belief,
            observation.belief.variance,
            observation.inside,
            appointment(self.scenario, observation, meet=self.meet, zones=self.zones),
            observation.remaining,
            prospect_of(self.foreseer, observation.belief, self.objective.interest),
        )

    def plan(
        self, key: Key, outlook: Outlook, last: Float[Array, " h *d"], proposals: Float[Array, "p h 2"] | None = None
    ) -> Finalists:
        """The best plans found for one agent.

        `last` is the plan to begin from: headings (h,), radians, for straight legs, or displacements (h, 2), units of
        a leg, for legs that may bend; the plans returned are of the same form. Plans that miss the meeting at the end
        are worth less. `proposals` are plans to try besides random ones.
        """
        position, steps, affordable, belief, known, inside, meeting, remaining, prospect = outlook
        objective, extent = self.objective, self.scenario.extent
        reach = jnp.sum(jnp.where(affordable, steps, 0.0))
        index = objective.in_play(belief, inside, self.points, position, reach, prospect)
        coarse, coarse_inside, coarse_known = belief.at(index), inside[index], known[index]
        coarse_prospect = None if prospect is None else prospect.at(index)
        some = jnp.arange(0, len(index), _ROUGH)  # every so many of them, which are sorted by weight
        rough = coarse.at(some), coarse_inside[some], coarse_known[some]
        rough_prospect = None if coarse_prospect is None else coarse_prospect.at(some)

        def value(
            belief: Belief,
            inside: Bool[Array, " i"],
            known: Float[Array, " i"],
            prospect: Prospect | None,
            plans: Float[Array, "c h *d"],
        ) -> Float[Array, " c"]:
            points = self.walked(position, plans, steps) if last.ndim == 2 else walk(position, plans, steps, extent)
            taken = jnp.broadcast_to(affordable, points.shape[:-1])
            left = objective.expected(*objective.after(belief, points, taken), known, inside, prospect)
            if meeting is None or remaining is None:
                return left
            return left * (1.0 + _LATE * lateness(meeting, position, points, steps, remaining))

        return search(
            key,
            last,
            score=lambda plans: value(coarse, coarse_inside, coarse_known, coarse_prospect, plans),
            rough=lambda plans: value(*rough, rough_prospect, plans),
            final=lambda plans: value(belief, inside, known, prospect, plans),
            options=SearchOptions(self.candidates_scored, self.elites, self.gradient_steps, self.rate, self.survivors),
            proposals=proposals,
        )

    def walked(
        self, position: Float[Array, "2"], plans: Float[Array, "*c h 2"], steps: Float[Array, " h"]
    ) -> Float[Array, "*c h 2"]:
        """Where the legs of plans end: displacements in units of a leg, from `position`."""
        return walk_bent(position, plans, steps, self.scenario.extent, self.zones)

    def set_out(
        self, observation: Observation, outlook: Outlook, plan: Float[Array, "h 2"], ahead: Ahead
    ) -> tuple[Float[Array, "2 2"], Announcement, Float[Array, "h 2"]]:
        """What the due agent travels before it plans again, what it announces, and what is left of its plan then.

        Where there are no-go zones, the agent may set out for something farther away that is worth more for the way to
        it, and does not stand still before its budget is spent.
        """
        position = outlook.position
        points = self.walked(position, plan, ahead.steps)
        way = jnp.stack([bend(position, points[0], ahead.steps[0], self.scenario.extent, self.zones), points[0]])
        leg = FirstLeg(way, points, plan)
        if self.zones is not None:
            leg = better_leg(self.zones, self.objective, observation, outlook, leg, ahead)
        times = jnp.where(ahead.affordable, observation.time + ahead.offsets / observation.speed, jnp.inf)
        way, left = depart(position, leg, ahead.steps, self.scenario.measurement_interval / self.decisions_per_leg)
        return way, Announcement(leg.points, times), left
