"""Robots as processes over sockets, one of which is killed (SIGKILL) again and again, at random moments.

    python -m tests.fleet.kills --kills 60 --robots 3
    python -m tests.fleet.kills --kills 6 --robots 5 --cuts
    python -m tests.fleet.kills --kills 6 --robots 3 --chain

With `--cuts` all links lead through proxies that swallow bytes, or reset connections, and heal again, at random
moments. In a `--chain` each robot has a link to the next one only, so that the first and the last never meet.

At the end all robots are home on their budgets, the one that was killed too, and every robot has every measurement that
any of them had written down.
"""

import argparse
import contextlib
import os
import random
import sys
import tempfile
import threading
import time
from pathlib import Path

from maipp.fleet.launch import FleetProcesses, Process, endpoints, robot_command
from maipp.fleet.log import read_lines
from maipp.fleet.recorded_fleet import read_fleet_record
from maipp.scenario import Scenario
from maipp.scenario_io import save_scenario
from tests.fleet.proxy import Proxy

READY, LONGEST = 120.0, 1500.0  # s


def fly(
    folder: Path,
    robots: int,
    kills: int,
    seed: int,
    budget: float = 1.2,
    planner: str = "greedy",
    speedup: float = 0.1,
    *,
    cuts: bool = False,
    chain: bool = False,
):
    """A fleet whose robots are killed in turn; the records of all robots' folders, and how often one was killed.

    At a `speedup` of 0.1 a leg of 0.2 takes two seconds: time enough to die on the way.
    """
    rng, scenario = random.Random(seed), Scenario(agents=robots, budget=budget, end="start", grid=8, nodes=24)
    save_scenario(scenario, folder / "scenario.yaml")
    names = [f"robot{i + 1}" for i in range(robots)]
    done = {name: threading.Event() for name in names}

    def heard(name, line):
        if " done: " in line:
            done[name].set()

    processes = {}
    stack, proxies = contextlib.ExitStack(), list[Proxy]()
    addresses = {name: listen for name, (listen, _) in endpoints(names).items()}
    for number, (name, listen) in enumerate(addresses.items()):
        # All name all others: whoever comes back finds somebody, and is found. One end of a link that is cut, or of a
        # chain, does: there is no other way.
        before = names[:number][-1:] if chain else names[:number]
        connect = [addresses[other] for other in (before if cuts or chain else names) if other != name]
        if cuts:
            links = [stack.enter_context(Proxy(int(address.rpartition(":")[2]))) for address in connect]
            connect = [link.address for link in links]
            proxies += links
        more = ["--vehicle", "simulated", "--held", "--epoch", "0", "--speedup", str(speedup), "--seed", "3"]
        more += ["--planner", planner, "--listen", listen]
        more += ["--connect", *connect] if connect else []
        (folder / name).mkdir()
        command = robot_command(folder / "scenario.yaml", name, folder / name, more)
        processes[name] = Process(name, command, folder / f"{name}.txt", heard)
    killed = 0
    with stack, FleetProcesses([*processes.values()]):
        for process in processes.values():
            assert process.ready.wait(READY), (folder / f"{process.name}.txt").read_text()
        begin = time.time() + 0.2
        for process in processes.values():
            process.begin(begin)
        end = time.monotonic() + LONGEST
        while not all(event.is_set() for event in done.values()) and time.monotonic() < end:
            time.sleep(rng.uniform(0.2, 1.0))
            if proxies and rng.random() < 0.7:
                rng.choice([Proxy.swallow, Proxy.reset, Proxy.heal])(rng.choice(proxies))
            if killed < kills:
                name = names[killed % robots]
                killed += 1
                done[name].clear()
                processes[name].kill()
                processes[name].wait(time.monotonic())
                processes[name].start()
                assert processes[name].ready.wait(READY)
                processes[name].begin(begin)
        for proxy in proxies:
            proxy.heal()
        settled = time.monotonic() + 20
        while time.monotonic() < settled and not same_logs(folder, names):
            time.sleep(0.1)
        assert all(event.is_set() for event in done.values()), "not all robots are done"
    return [read_fleet_record(folder / name) for name in names], killed


def logs(folder: Path) -> dict[str, list[bytes]]:
    """The whole lines of all logs in a robot's folder."""
    return {path.name: read_lines(path)[0] for path in sorted(folder.glob("*.log"))}


def same_logs(folder: Path, names: list[str]) -> bool:
    """Whether all robots have the same logs."""
    first, *others = (logs(folder / name) for name in names)
    return all(other == first for other in others)


def check(folder: Path, records, names: list[str], budget: float) -> int:
    """Raise AssertionError where something was lost, or somebody is not home; how many measurements there are."""
    assert same_logs(folder, names)
    for record in records:
        for robot in record.robots:
            assert robot.status == "stopped", (robot.name, robot.answer)
            assert robot.odometer <= budget + 1e-4
            start = record.place.starts[[each.name for each in record.robots].index(robot.name)]
            assert abs(robot.position - start).max() < 1e-3
    counts = {len(record.reports) for record in records}
    assert len(counts) == 1
    return counts.pop()


def main():
    """Run it from the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--robots", type=int, default=3)
    parser.add_argument("--budget", type=float, default=3.0)
    parser.add_argument("--planner", default="receding-horizon")
    parser.add_argument("--speedup", type=float, default=0.01)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cuts", action="store_true")
    parser.add_argument("--chain", action="store_true")
    flags = parser.parse_args()
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        how = flags.robots, flags.kills, flags.seed, flags.budget, flags.planner, flags.speedup
        records, killed = fly(folder, *how, cuts=flags.cuts, chain=flags.chain)
        count = check(folder, records, [f"robot{i + 1}" for i in range(flags.robots)], flags.budget)
        starts = {path.stem.partition(".")[0]: 0 for path in (folder / "robot1").glob("*.log")}
        for path in (folder / "robot1").glob("*.log"):
            starts[path.stem.partition(".")[0]] += 1
        print(f"{killed} kills, logs {starts}: {count} measurements, none lost, everybody home")


if __name__ == "__main__":
    sys.exit(main())
