"""Fleets over sockets beside the simulator: the same worlds, robots that talk over loopback, in real time.

    python -m tests.fleet.sockets --worlds 20 --planner receding-horizon
    python -m tests.fleet.sockets --worlds 20 --planner receding-horizon --range 0.3 [--seldom]

Every robot has a thread, a Zenoh session, a survey and a log of its own. Printed are the mean Tr(P) of both (with a
range: the mean of the robots' own), and the mean of their differences with its standard error.
"""

import argparse
import threading
import time
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Interest
from maipp.engine import draw_missions
from maipp.engine.rollout import run_missions
from maipp.fleet.clock import WallClock
from maipp.fleet.filtered import Filtered
from maipp.fleet.launch import endpoints
from maipp.fleet.logs import Logs
from maipp.fleet.member import Pace
from maipp.fleet.robot import Robot
from maipp.fleet.simulated import Simulated
from maipp.fleet.zenoh_link import ZenohLink
from maipp.live.belief_query import believe
from maipp.live.setups import scenario_setup
from maipp.live.team import TeamSurvey
from maipp.live.world import World
from maipp.planners import make_planner
from maipp.scenario import Scenario


def traces(world, survey):
    """Tr(P) of what a survey knows."""
    mission = world.mission
    mean, std = believe(mission, survey._measurements, np.asarray(mission.grid))
    interest = Interest(mission.params.threshold, mission.params.beta, mission.shape.interest_rule)
    return float(interest.trace(jnp.asarray(mean), jnp.asarray(std) ** 2, mission.inside))


class Told:
    """Seconds that decisions and messages took."""

    def __init__(self):
        self.legs, self.meets = [], []


def fly(world, setup, speedup, reach, told, seldom=False):
    """A fleet in one world; its robots' surveys at the end."""
    field = eqx.filter_jit(lambda points: world.mission.field(points))
    real = np.asarray(world.mission.start).dtype
    np.asarray(field(jnp.zeros((1, 2), real)))
    TeamSurvey(world, setup).warm_up()
    scenario, mission = world.scenario, setup.digest(world)
    # As in the simulator, where agents learn of others at their decisions only.
    pace = Pace(contact=0.0, beat=1e9, round=1e9) if seldom else Pace(contact=0.05)
    clock, stop = WallClock(0.0, speedup, time.time() + 0.5), threading.Event()
    robots = []
    addresses = endpoints(setup.robots)
    for number, (name, (listen, connect)) in enumerate(addresses.items()):
        start = np.asarray(world.mission.start[number], np.float64)
        speed, interval = scenario.speeds[number], scenario.measurement_interval
        at = lambda points: np.asarray(field(jnp.asarray(points, real)), np.float64)  # noqa: E731
        vehicle = Simulated(setup.units, start, speed, interval, at, clock)
        link = ZenohLink(name, mission, connect=connect, listen=[listen])
        if reach is not None:
            link = Filtered(link, lambda vehicle=vehicle: vehicle.where().position, reach)
        survey = TeamSurvey(world, setup)
        logs = Logs(None, name, mission, tell=lambda text: None)
        robots.append(
            Robot(
                survey,
                logs,
                link,
                vehicle,
                clock,
                monotonic=time.monotonic,
                pace=pace,
                tell=lambda t: None,
            )
        )
    while any(len(robot.member.transport.peers()) < len(robots) - 1 for robot in robots):
        time.sleep(0.05)
    for robot in robots:
        if seldom:
            robot.member.exchange.announce = lambda part: None
        meet = robot.member.meet

        def timed(name=None, meet=meet):
            begun = time.monotonic()
            answered = meet(name)
            told.meets.append(time.monotonic() - begun)
            return answered

        robot.member.meet = timed

    def live(robot):
        robot.begin()
        while not stop.is_set():
            robot.work()
            time.sleep(0.002)

    while clock.now() == 0.0:
        time.sleep(0.01)
    threads = [threading.Thread(target=live, args=(robot,), daemon=True) for robot in robots]
    for thread in threads:
        thread.start()
    while not all(robot.done for robot in robots):
        time.sleep(0.05)
    stop.set()
    for thread in threads:
        thread.join()
    if reach is None:
        for robot in robots:
            robot.member.listen()
            robot.member.meet()
    for robot in robots:
        told.legs.append(robot.survey.robot(robot.name).odometer / robot.survey.robot(robot.name).arrivals)
        robot.member.transport.close()
    return [robot.survey for robot in robots]


def main():
    """Run the comparison."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--planner", default="receding-horizon")
    parser.add_argument("--budget", type=float, default=2.0)
    parser.add_argument("--range", type=float, default=None)
    parser.add_argument("--speedup", type=float, default=0.2)
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--seldom", action="store_true", help="robots talk when one of them decides, and not between")
    flags = parser.parse_args()
    scenario = Scenario(agents=3, budget=flags.budget, comm_range=flags.range)
    planner = make_planner(flags.planner, scenario, {})
    missions = draw_missions(scenario, seed=flags.seed, instances=flags.worlds, planner=planner)
    states = jax.device_get(run_missions(planner, missions, jax.random.key(flags.seed)))
    setup, rows, told = (
        scenario_setup(scenario, flags.planner, {}, flags.seed, None, 0.0, 0.0, False, None, None),
        [],
        Told(),
    )
    for number in range(flags.worlds):
        mission = jax.tree.map(lambda a, i=number: a[i], missions)
        world = World(
            scenario.replace(start=np.asarray(mission.start, np.float64).tolist()),
            planner,
            mission,
            jax.random.fold_in(jax.random.key(flags.seed), number),
        )
        surveys = fly(world, setup, flags.speedup, flags.range, told, flags.seldom)
        fleet = np.mean([traces(world, survey) for survey in surveys])
        rows.append((engine_trace(world, setup, jax.tree.map(lambda a, i=number: a[i], states), flags.range), fleet))
        print(number, *np.round(rows[-1], 3), flush=True)
    one, other = np.array(rows).T
    difference = other - one
    error = lambda values: values.std(ddof=1) / len(values) ** 0.5  # noqa: E731
    what = "Tr(P)" if flags.range is None else "own Tr(P)"
    print(f"{what}: simulator {one.mean():.3f} ({error(one):.3f}), sockets {other.mean():.3f} ({error(other):.3f})")
    print(f"sockets less simulator: {difference.mean():.3f} ({error(difference):.3f}), n = {len(rows)}")
    share = np.median(told.meets) * flags.speedup / np.mean(told.legs)
    print(f"an exchange takes {1e3 * np.median(told.meets):.1f} ms, {share:.1%} of a leg")


def engine_trace(world, setup, state, reach):
    """The same Tr(P) of what the simulator's agents measured: of all, or the mean of what each knows."""
    from maipp.live.scaled_measurement import ScaledMeasurement

    own = np.asarray(state.known) | np.eye(len(setup.robots), dtype=bool)[:, :, None]
    taken = np.isfinite(state.measurement_time)
    found = []
    for agent in range(len(setup.robots) if reach is not None else 1):
        survey = TeamSurvey(world, replace(setup))
        knows = taken & (own[agent] if reach is not None else True)
        for other, slot in zip(*np.nonzero(knows), strict=True):
            x, y = np.asarray(state.measurement_x[other, slot], np.float64).tolist()
            value, when = float(state.measurement_y[other, slot]), float(state.measurement_time[other, slot])
            survey._measurements.add(ScaledMeasurement(when, int(other), x, y, value, False), f"{other}.{slot}")
        found.append(traces(world, survey))
    return float(np.mean(found))


if __name__ == "__main__":
    main()
