"""No decision depends on the order of the slots that hold the measurements."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine import draw_missions, reset
from maipp.engine.decide import decide
from maipp.engine.observe import knowledge
from maipp.planners import make_planner
from maipp.scenario import Scenario

# Among no-go zones roadmap planners ask which measurements are the agent's own, and which of them are its last.
SCENARIO = Scenario(
    agents=2,
    budget=1.6,
    start=(0.15, 0.15),
    grid=6,
    nodes=16,
    neighbours=5,
    obstacles=(((0.3, 0.2), (0.4, 0.2), (0.4, 0.9), (0.3, 0.9)),),
)


def dithering(mission, planner):
    """What agent 1 knows that has measured around one place again and again; agent 0 has measured elsewhere."""
    rng = np.random.default_rng(3)
    known = knowledge(mission, reset(planner, mission), jnp.int32(1), jnp.array([True, False]))
    slots = mission.shape.slots
    x = np.stack(np.meshgrid([0.5, 0.75, 1.0], [0.0, 0.3, 0.6, 0.9]), axis=-1).reshape(-1, 2)[:slots]
    x = np.stack([x, x]).astype(np.float32)  # farther apart than measurements on the way
    x[1] = np.asarray(known.position) + rng.normal(0.0, 0.02, (slots, 2))
    times = np.sort(rng.uniform(0, 1, (2, slots)), axis=1).astype(np.float32)
    values = rng.normal(0.3, 0.3, 2 * slots).astype(np.float32)
    taken = np.arange(slots) < slots - 2
    x, values, times, taken, now = map(
        jnp.asarray, (x.reshape(-1, 2), values, times.reshape(-1), np.tile(taken, 2), np.float32(1.0))
    )
    return dataclasses.replace(
        known, measurement_x=x, measurement_y=values, measurement_time=times, known=taken, time=now
    )


def test_permuting_slots_changes_no_decision(tiny_planner):
    name, options = tiny_planner
    planner = make_planner(name, SCENARIO, options)
    prior = np.array([[0.7, 0.1], [0.1, 0.9]]), np.array([0.5, -0.5])
    drawn = draw_missions(SCENARIO, seed=2, instances=1, planner=planner, prior=prior)
    mission = jax.tree.map(lambda a: a[0], drawn)
    planner = planner.on(mission.problem)
    known = dithering(mission, planner)
    memory, key = planner.initial_memory(), jax.random.key(1)
    usual = decide(planner, mission, key, known, memory)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(known.known))
        names = ("measurement_x", "measurement_y", "measurement_time", "measured_by", "known")
        mixed = dataclasses.replace(known, **{field: getattr(known, field)[order] for field in names})
        other = decide(planner, mission, key, mixed, memory)
        assert bool(other.go) == bool(usual.go)
        # A factor in another order is rounded otherwise.
        np.testing.assert_allclose(other.leg, usual.leg, atol=2e-4)


def test_whose_measurements_they_are_matters():
    """The check of the one above: were the slots agent 0's, agent 1 would not be led out."""
    planner = make_planner("random", SCENARIO)
    mission = jax.tree.map(lambda a: a[0], draw_missions(SCENARIO, seed=2, instances=1, planner=planner))
    planner = planner.on(mission.problem)
    known = dithering(mission, planner)
    swapped = dataclasses.replace(known, measured_by=1 - known.measured_by)
    ends = []
    for one in (known, swapped):
        made = [decide(planner, mission, jax.random.key(i), one, ()) for i in range(12)]
        ends.append({tuple(np.round(np.asarray(each.leg[-1]), 3)) for each in made})
    assert len(ends[0]) == 1 < len(ends[1])  # led to the one place, or going anywhere
