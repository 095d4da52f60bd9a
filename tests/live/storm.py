"""A survey under the worst conditions: events twice, in any order, and the process killed again and again.

Meanwhile zones come, move and go, and the threshold and the robots' speeds change.

    python tests/live/storm.py --events 10000 --kills 100
    python tests/live/storm.py --latency receding-horizon intent-paths intent-search

First an undisturbed run makes the events: a team that follows what `maipp live` answers. Then all of them, and copies,
are sent in another order to a second process, which is killed (SIGKILL) at random moments, at start-up too, and whose
journal sometimes gets a torn last line. At the end both must answer the same belief, byte for byte; every event must be
in the journal once; and whatever was answered more than once must have got the same answer.
"""

import argparse
import json
import sys
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path[:0] = [str(Path(__file__).parent)]  # run as a program, and loaded by its test

from storm_service import Service, encode  # noqa: E402

AHEAD = 8  # requests sent before the first of them is answered
SPIKES, DECIDED = 0.05, 0.05  # shares of measurements that are wrong, and on which a person decides
CHANGED = 0.3  # share of legs on which zone, threshold or speed changes
CHANGES = ("zone", "threshold", "speed")
GRID, STATE = b'{"query": "belief"}\n', b'{"query": "state"}\n'


def truth(x: float, y: float) -> float:
    """The field that the robots measure, standardised."""
    return float(np.sin(5 * x) * np.cos(4 * y) + 0.3 * np.sin(9 * x * y))


@dataclass
class Team:
    """Robots that go where they are told, not quite exactly, and measure on the way."""

    service: Service
    rng: np.random.Generator
    per_leg: int  # measurements on each leg
    count: int  # events to make
    changed: float = 0.0  # share of legs on which something of the survey changes
    answers: list[bytes] = field(default_factory=list)
    events: list[dict[str, Any]] = field(default_factory=list)
    seconds: dict[str, list[float]] = field(default_factory=dict)  # by kind of event

    def run(self) -> None:
        """Until there are enough events or no robot has budget left."""
        robots = self.service.ready["robots"]
        where = {robot["name"]: np.array(robot["start"]) for robot in robots}
        clock = dict.fromkeys(where, 0.0)
        while clock and len(self.events) < self.count:
            name = min(clock, key=lambda each: clock[each])
            now, here = clock[name], where[name]
            answer = self.report("arrived", name, time=now, position=here.tolist())
            if answer["answer"] == "stop":
                del clock[name]
                continue
            path = np.array([here, *answer["waypoints"]])
            if self.rng.random() < self.changed:
                self.change(name, now)
            for share in np.linspace(0, 1, self.per_leg + 1)[1:]:
                spot = _along(path, share) + self.rng.normal(0, 0.001, 2)
                when = now + share * (answer["arrival"] - now)
                spike = 50.0 * (self.rng.random() < SPIKES)
                value = truth(*spot) + float(self.rng.normal(0, 0.01)) + spike
                self.report("measurement", name, time=when, position=spot.tolist(), value=value)
                if self.rng.random() < DECIDED:
                    kind = "keep" if spike or self.rng.random() < 0.3 else "withdraw"
                    self.report(kind, name, time=when, measurement=self.events[-1]["id"])
            where[name] = path[-1] + self.rng.normal(0, 0.005, 2)
            clock[name] = answer["arrival"] * 1.001

    def change(self, robot: str, now: float) -> None:
        """Move a zone or remove it, or change the threshold, or the speed of a robot.

        Zones are so small and so few that no order of theirs leaves too little room.
        """
        kind = CHANGES[sum(event["event"] in CHANGES for event in self.events) % len(CHANGES)]
        if kind == "zone":
            corner, side = self.rng.uniform(0.05, 0.85, 2), self.rng.uniform(0.05, 0.1)
            polygon = (corner + side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])).tolist()
            name = str(self.rng.choice(["ferry", "divers"]))
            self.report(kind, None, time=now, name=name, polygon=polygon if self.rng.random() < 0.8 else None)
        elif kind == "threshold":
            self.report(kind, None, time=now, threshold=float(self.rng.normal(0.4, 0.3)))
        else:
            self.report(kind, robot, time=now, speed=float(self.rng.uniform(0.5, 1.5)))

    def report(self, kind: str, robot: str | None, **values: Any) -> dict[str, Any]:
        """Send an event; gives the answer."""
        whose = {} if robot is None else {"robot": robot}
        event = {"event": kind, "id": f"{kind}-{len(self.events)}"} | whose | values
        began = time.perf_counter()
        line = self.service.ask(encode(event))
        self.seconds.setdefault(kind, []).append(time.perf_counter() - began)
        self.events.append(event)
        self.answers.append(line)
        answer = json.loads(line)
        assert answer["answer"] in ("go", "stop", "noted"), answer
        return answer


def _along(path: np.ndarray, share: float) -> np.ndarray:
    steps = np.hypot(*np.diff(path, axis=0).T)
    marks = np.concatenate([[0.0], np.cumsum(steps)])
    return np.array([np.interp(share * marks[-1], marks, axis) for axis in path.T])


def disordered(events: list[dict[str, Any]], rng: np.random.Generator, copies: float) -> list[dict[str, Any]]:
    """All events and copies of some, so that copies are that part of the whole; near ones in disorder, some far off.

    Arrivals stay within a hundred places: one from far ahead makes all those before it late, and nothing to decide.
    """
    extra = round(len(events) * copies / (1 - copies))
    index = np.concatenate([np.arange(len(events)), rng.integers(len(events), size=extra)])
    place = index + rng.uniform(0, 100, len(index))
    stays = np.array([events[i].get("event") == "arrived" for i in index])
    far = (rng.random(len(index)) < 0.2) & ~stays
    place[far] = rng.uniform(0, len(events), far.sum())
    return [events[i] for i in index[np.argsort(place)]]


def moments(count: int, kills: int, rng: np.random.Generator) -> Iterator[int]:
    """After how many deliveries to kill, in order; the last one is never reached."""
    yield from sorted(rng.choice(count, kills, replace=False).tolist())
    yield count + 1


@dataclass
class Storm:
    """Sends deliveries to a service that it kills meanwhile, until each has been answered."""

    service: Service
    rng: np.random.Generator
    answered: dict[str, bytes] = field(default_factory=dict)
    repeated: int = 0  # answers compared with an earlier one to the same event
    torn: int = 0

    def run(self, deliveries: list[dict[str, Any]], kills: int, progress: bool = False) -> None:
        """Deliver everything. Raises AssertionError where an answer differs from an earlier one to the same event."""
        waiting = deque(deliveries)
        when = moments(len(deliveries), kills, self.rng)
        next_kill, sent = next(when), 0
        self.service.begin()
        out: deque[dict[str, Any]] = deque()
        while waiting or out:
            while waiting and len(out) < AHEAD and sent < next_kill:
                out.append(waiting.popleft())
                self.service.send(encode(out[-1]))
                sent += 1
            if sent >= next_kill:
                time.sleep(self.rng.uniform(0, 0.02))  # any moment: reading, deciding, writing, answering
                for line in self.service.kill():
                    self.note(out.popleft(), line)
                waiting.extendleft(reversed(out))  # whoever was not answered sends again
                sent -= len(out)
                out.clear()
                self.restart()
                next_kill = next(when)
                if progress:
                    print(f"{sent} of {len(deliveries)} sent, {self.service.starts} starts", file=sys.stderr)
            else:
                self.note(out.popleft(), self.service.receive())

    def restart(self) -> None:
        """Start again; sometimes the journal was torn, sometimes the new process is killed before it is ready."""
        if self.rng.random() < 0.3:
            last = self.service.journal.read_bytes().splitlines(keepends=True)[-1]
            with open(self.service.journal, "ab") as file:
                file.write(last[: self.rng.integers(1, len(last))])
            self.torn += 1
        if self.rng.random() < 0.1:
            self.service.begin(wait=False)
            time.sleep(self.rng.uniform(0, 2))
            self.service.kill()
        self.service.begin()

    def note(self, event: dict[str, Any], line: bytes) -> None:
        """Compare the answer with those before."""
        assert json.loads(line).get("id") == event["id"], (event, line)
        self.repeated += event["id"] in self.answered
        assert self.answered.setdefault(event["id"], line) == line, (event, line)


def storm(
    folder: Path,
    scenario: str,
    *,
    planner: str,
    events: int,
    kills: int,
    per_leg: int,
    seed: int,
    progress: bool,
    adapt: bool = False,
) -> dict[str, Any]:
    """Both runs in a folder; gives what was seen. Raises AssertionError where anything differs or is lost."""
    rng = np.random.default_rng(seed)
    path = folder / "scenario.yaml"
    path.write_text(scenario, encoding="utf-8")
    calm = Service(path, folder / "calm.journal", planner, adapt)
    calm.begin()
    team = Team(calm, rng, per_leg, round(0.7 * events), CHANGED)
    team.run()
    expected, settings, kernel = calm.ask(GRID), changed_of(calm.ask(STATE)), json.loads(calm.ask(STATE)).get("kernel")
    assert calm.stop() == 0
    seen = {kind: 1e3 * float(np.median(times)) for kind, times in team.seconds.items()}
    if progress:
        print(f"undisturbed: {len(team.events)} events, median ms {seen}", file=sys.stderr)
    deliveries = disordered(team.events, rng, 0.3)
    wild = Service(path, folder / "wild.journal", planner, adapt)
    run = Storm(wild, rng)
    run.run(deliveries, kills, progress)
    assert wild.ask(GRID) == expected, "the belief differs from the undisturbed run's"
    assert json.loads(wild.ask(STATE)).get("kernel") == kernel, "the kernel differs from the undisturbed run's"
    assert changed_of(wild.ask(STATE)) == settings, "zones, threshold or speeds differ from the undisturbed run's"
    for event in deliveries[:: max(len(deliveries) // 200, 1)]:
        run.note(event, wild.ask(encode(event)))
    assert wild.stop() == 0
    records = [json.loads(line) for line in wild.journal.read_bytes().splitlines()[1:]]
    ids = [record["event"]["id"] for record in records]
    assert sorted(ids) == sorted(event["id"] for event in team.events), "events were lost or are there twice"
    assert [record["seq"] for record in records] == list(range(1, len(ids) + 1))
    assert b"NaN" not in wild.journal.read_bytes()
    return {
        "events": len(team.events),
        "deliveries": len(deliveries),
        "decisions": sum("odometer" in record.get("state", {}) for record in records),
        "changes": {kind: sum(event["event"] == kind for event in team.events) for kind in CHANGES},
        "kills": kills,
        "starts": wild.starts,
        "torn lines": run.torn,
        "answers compared": run.repeated,
        "kernel": kernel,
        "median ms": seen,
    }


def changed_of(line: bytes) -> dict[str, Any]:
    """What of a state depends on the set of events alone."""
    state = json.loads(line)
    told = {key: state.get(key) for key in ("events", "measurements", "kept_out", "threshold", "zones")}
    return told | {"speeds": [robot["speed"] for robot in state["robots"]]}


def latency(folder: Path, planner: str) -> dict[str, float]:
    """How long answers take in a survey of three robots with a budget of 3: medians, and processor time per arrival."""
    path = folder / "scenario.yaml"
    path.write_text("agents: 3\nbudget: 3\nstart: [0.5, 0.5]\n", encoding="utf-8")
    service = Service(path, folder / f"{planner}.journal", planner)
    service.begin()
    began = service.cpu_seconds()
    team = Team(service, np.random.default_rng(0), 1, 10_000)
    team.run()
    used = service.cpu_seconds() - began
    assert service.stop() == 0
    arrivals = len(team.seconds["arrived"])
    medians = {f"{kind}, median ms": 1e3 * float(np.median(times)) for kind, times in team.seconds.items()}
    every = np.concatenate([np.array(times) for times in team.seconds.values()])
    all_events = {"all, median ms": 1e3 * float(np.median(every)), "arrivals": arrivals}
    return medians | all_events | {"processor ms per arrival and its measurements": 1e3 * used / arrivals}


def main() -> None:
    """Run the storm and print what was seen."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--events", type=int, default=10_000, help="deliveries, copies included")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--planner", default="shared-greedy")
    parser.add_argument("--per-leg", type=int, default=12, help="measurements on each leg")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--adapt", action="store_true", help="refit the kernel under way")
    parser.add_argument("--latency", nargs="+", metavar="PLANNER", help="time the answers of these planners instead")
    flags = parser.parse_args()
    if flags.latency:
        with tempfile.TemporaryDirectory() as folder:
            for planner in flags.latency:
                print(planner, json.dumps(latency(Path(folder), planner), indent=2))
        return
    scenario = "agents: 3\nbudget: 60\nnoise: 0.0001\nstart: [0.5, 0.5]\n"
    with tempfile.TemporaryDirectory() as folder:
        began = time.monotonic()
        seen = storm(
            Path(folder),
            scenario,
            planner=flags.planner,
            events=flags.events,
            kills=flags.kills,
            per_leg=flags.per_leg,
            seed=flags.seed,
            progress=True,
            adapt=flags.adapt,
        )
    print(json.dumps(seen | {"minutes": round((time.monotonic() - began) / 60, 1)}, indent=2))


if __name__ == "__main__":
    main()
