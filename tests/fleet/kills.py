"""Robots as processes over sockets, one of which is killed (SIGKILL) again and again, at random moments.

    python -m tests.fleet.kills --kills 60 --robots 3

At the end all robots are home on their budgets, the one that was killed too, and every robot has every measurement that
any of them had written down.
"""

import argparse
import os
import random
import sys
import tempfile
import threading
import time
from pathlib import Path

from maipp.fleet.launch import Fleet, Process, endpoints, robot_command
from maipp.fleet.log import read_lines
from maipp.fleet.record import read_fleet_record
from maipp.scenario import Scenario
from maipp.scenario_io import save_scenario

READY, LONGEST = 120.0, 1500.0  # s


def fly(
    folder: Path, robots: int, kills: int, seed: int, budget: float = 1.2, planner: str = "greedy", speedup: float = 0.1
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
    for name, (listen, _) in (addresses := endpoints(names)).items():
        # All name all others: whoever comes back finds somebody, and is found.
        connect = [other for key, (other, _) in addresses.items() if key != name]
        more = ["--vehicle", "simulated", "--held", "--epoch", "0", "--speedup", str(speedup), "--seed", "3"]
        more += ["--planner", planner, "--listen", listen, "--connect", *connect]
        (folder / name).mkdir()
        command = robot_command(folder / "scenario.yaml", name, folder / name, more)
        processes[name] = Process(name, command, folder / f"{name}.txt", heard)
    killed = 0
    with Fleet([*processes.values()]):
        for process in processes.values():
            assert process.ready.wait(READY), (folder / f"{process.name}.txt").read_text()
        begin = time.time() + 0.2
        for process in processes.values():
            process.begin(begin)
        end = time.monotonic() + LONGEST
        while not all(event.is_set() for event in done.values()) and time.monotonic() < end:
            time.sleep(rng.uniform(0.2, 1.0))
            if killed < kills:
                name = names[killed % robots]
                killed += 1
                done[name].clear()
                processes[name].kill()
                processes[name].wait(time.monotonic())
                processes[name].start()
                assert processes[name].ready.wait(READY)
                processes[name].begin(begin)
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
    flags = parser.parse_args()
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        records, killed = fly(folder, flags.robots, flags.kills, flags.seed, flags.budget, flags.planner, flags.speedup)
        count = check(folder, records, [f"robot{i + 1}" for i in range(flags.robots)], flags.budget)
        starts = {path.stem.partition(".")[0]: 0 for path in (folder / "robot1").glob("*.log")}
        for path in (folder / "robot1").glob("*.log"):
            starts[path.stem.partition(".")[0]] += 1
        print(f"{killed} kills, logs {starts}: {count} measurements, none lost, everybody home")


if __name__ == "__main__":
    sys.exit(main())
