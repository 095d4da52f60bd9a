"""Where to go among no-go zones when the best plan leads nowhere: to what is farther away, or just out."""

import jax.numpy as jnp

from maipp.engine.decision import Observation
from maipp.engine.polyline import along_paths, first_part
from maipp.planners.announced.meeting import lateness
from maipp.planners.lookahead import predicted
from maipp.planners.plane.transit import best_transit
from maipp.planners.search.first_leg import FirstLeg, either, length
from maipp.planners.search.objective import Objective
from maipp.planners.search.outlook import Ahead, Outlook
from maipp.roadmap.shortest_paths import longest_free_leg
from maipp.roadmap.zones import Zones
from maipp.typing import Array, Bool, Float

# A leg of less than this part of what it costs is worth looking for another one.
_SHORT = 0.5


def better_leg(
    zones: Zones, objective: Objective, observation: Observation, outlook: Outlook, leg: FirstLeg, ahead: Ahead
) -> FirstLeg:
    """The leg, or the beginning of the way to something that is worth more for its length, or any way out."""
    position, inside, belief, known = outlook.position, outlook.inside, outlook.belief, outlook.known
    (offsets, steps, affordable), interval = ahead, objective.scenario.measurement_interval
    prospect = outlook.prospect
    now = objective.expected(belief.mean, belief.variance, known, inside, prospect)

    def gain(points: Float[Array, "k i 2"], taken: Bool[Array, "k i"]) -> Float[Array, " k"]:
        value = objective.scenario.virtual_value
        after = predicted(belief, points, taken, virtual_value=value)
        return now - objective.expected(*after, known, inside, prospect)

    planned = gain(leg.points[None], affordable[None])[0]
    rate = planned / jnp.maximum(jnp.sum(jnp.where(affordable, steps, 0.0)), interval)
    transit = best_transit(
        zones,
        position,
        observation.remaining,
        interval,
        jnp.where(inside, objective.worth(belief, prospect), 0.0),
        lambda points: gain(points, jnp.ones(points.shape[:-1], bool)),
    )
    far = jnp.isfinite(transit.distance) & (transit.distance >= steps[0])
    points, _ = along_paths(position, transit.path[None], offsets)
    begins = jnp.concatenate([position[None], points[0, :-1]])
    plan = (points[0] - begins) / jnp.maximum(steps, 1e-9)[:, None]
    away = FirstLeg(first_part(position, transit.path, steps[0])[:2], points[0], plan)
    in_time = jnp.asarray(True)
    if outlook.meeting is not None:
        late, later = (
            lateness(outlook.meeting, position, each, steps, observation.remaining) for each in (leg.points, points[0])
        )
        in_time = later <= late + 1e-6
    leg = either(far & in_time & (transit.rate > rate), away, leg)

    # Walls on all sides can leave a plan hardly any way: better somewhere than nowhere.
    end = longest_free_leg(zones, position, steps[0], objective.scenario.extent)
    run = FirstLeg(jnp.stack([end, end]), jnp.broadcast_to(end, leg.points.shape), jnp.zeros_like(leg.plan))
    run = either(far, away, run)
    short = length(position, leg.way) < _SHORT * jnp.minimum(steps[0], observation.remaining)
    return either(short & (length(position, run.way) > length(position, leg.way)), run, leg)
