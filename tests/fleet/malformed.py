"""Malformed messages to a robot: whatever comes, it refuses, says so, and goes on.

python tests/fleet/malformed.py --count 1000000
"""

import argparse
import contextlib
import json
import random
import time
from copy import deepcopy

import numpy as np

from maipp.errors import InputError
from maipp.fleet.exchange import HAVE, LINE, LOG
from maipp.fleet.frame import decode, decode_heads, decode_part, encode, encode_heads, encode_part
from maipp.fleet.hub import Hub
from maipp.fleet.log import Origin
from maipp.fleet.logs import LogSegment
from maipp.fleet.member import _INTENT, INTENT
from maipp.fleet.transport import Hint
from maipp.fleet.vehicle import Wish
from maipp.live.chain import link
from tests.fleet import schedules
from tests.fuzz.fuzz_mutate import malformed

SENDER = "robot2"
TOKENS = (b'"origin"', b'"start"', b'"packed"', b"true", b'"heads"', b'"event"', b'"state"', b'"leg"', b'"memory"')


NASTY = [
    *(
        None,
        True,
        -1,
        0,
        1e308,
        -1e308,
        5e-324,
        10**30,
        10**400,
        "",
        "x" * 3000,
        "\u2028\x00\x1b[31m",
        "robot1",
        SENDER,
    ),
    *([], {}, [[0, 0]], [0.5, 0.5], {"a": 1}, json.loads("[" * 60 + "]" * 60), "AAAA", "1e5", 1e5, -0.5),
]
WISHES = [
    {"event": "withdraw", "measurement": "robot2.01234561.2"},
    {"event": "budget", "budget": 3.0},
    {"event": "speed", "speed": 0.5},
    {"event": "zone", "name": "reef", "polygon": [[0.1, 0.1], [0.2, 0.1], [0.2, 0.2]]},
    {"event": "zone", "name": "reef", "polygon": None},
    {"event": "threshold", "threshold": 0.5},
    {"event": "keep", "measurement": "robot2.01234561.3"},
    {"event": "gone"},
]


def nasty(record, rng):
    """A record one or two values of which are others, missing, or more."""
    record = json.loads(json.dumps(record))
    for _ in range(rng.choice((1, 1, 2))):
        place = record
        while True:
            key = rng.choice([*place]) if isinstance(place, dict) else rng.randrange(len(place))
            inner = place[key]
            if not isinstance(inner, dict | list) or not inner or rng.random() < 0.2:
                break
            place = inner
        match rng.randrange(6):
            case 0:
                del place[key]
            case 1 if isinstance(place, dict):
                place[rng.choice(("more", "time", "state", "kernels", "robot"))] = deepcopy(rng.choice(NASTY))
            case _:
                place[key] = deepcopy(rng.choice(NASTY))
        if not record:
            break
    return record


def changed(seeds, number):
    """The malformed message of this number: most are quick to make, one in 25 is changed with thought."""
    if number % 25 == 0:
        return malformed(seeds, number, TOKENS)
    rng = random.Random(number)
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(data) + 1)
        match rng.randrange(5):
            case 0:
                data[at : at + 1] = rng.randbytes(1)
            case 1:
                del data[at : at + rng.choice((1, 4, 40, 1000))]
            case 2:
                data[at:at] = rng.choice(TOKENS)
            case 3:
                data[at:at] = data[at : at + 100]
            case 4:
                data[at:] = rng.randbytes(rng.randrange(100))
    return bytes(data)


class Victim:
    """A robot with a log of its own, and good messages to make bad ones of."""

    def __init__(self, team):
        team.hub = Hub()
        self.told = []
        vehicles = [schedules.Scripted(team.clock, tuple(team.starts[i].tolist())) for i in range(2)]
        self.robot, self.other = (
            team.robot(i, vehicle, tell=self.told.append, incarnation="0123456" + str(i))
            for i, vehicle in enumerate(vehicles)
        )
        for robot, vehicle in zip((self.robot, self.other), vehicles, strict=True):
            robot.begin()
            robot.decide()
            for value in range(5):
                vehicle.move()
                vehicle.measures(0.1 * value)
                robot.measure()
            vehicle.arrives()
            robot.measure()
            robot.decide()
        for wish in WISHES:
            head = {"id": self.other._new_id(), "robot": SENDER, "time": 1.0}
            with contextlib.suppress(InputError):
                self.other._wish(Wish(wish), head | wish)
        self.member, self.mission = self.robot.member, team.mission
        known = self.other.logs.known[self.other.origin]
        message = np.zeros(5, np.float32).tobytes()
        self.seeds = {
            LINE: [encode_part(LogSegment(known.origin, n, [line], b"")) for n, line in enumerate(known.lines)],
            "part": [encode_part(LogSegment(known.origin, 0, known.lines, b""))],
            HAVE: [encode({"heads": encode_heads(self.other.logs.heads()), "status": {"time": 1.0, "done": False}})],
            LOG: [encode({"origin": str(known.origin), "from": 2, "most": 1000})],
            INTENT: [_INTENT.pack(time, 0.4, 0.6) + message for time in (1e-3, 1.0, 1e9)],
        }
        self.records = [json.loads(line) for line in known.lines]
        self.member.transport.receive()
        self.robot.member.meet()
        del self.told[:]

    def readers(self, count, first=0):
        """So many malformed messages to what reads frames; gives how many were taken for good ones."""
        taken, kinds = 0, [*self.seeds]
        for number in range(first, first + count):
            rng = random.Random(number)
            kind = kinds[number % len(kinds)]
            data = rng.randbytes(rng.randrange(200)) if number % 7 == 0 else changed(self.seeds[kind], number)
            for read in (decode, decode_part, lambda frame: decode_heads(decode(frame)[0].get("heads"))):
                try:
                    read(data)
                    taken += 1
                except ValueError:
                    pass
        return taken

    def hear(self, count, first=0):
        """So many malformed hints and answers to a robot, as the network brings them."""
        kinds = [*self.seeds]
        exchange, log = self.member.exchange, self.robot.logs
        before = {origin: [*known.lines] for origin, known in log.known.items()}
        for number in range(first, first + count):
            kind = kinds[number % len(kinds)]
            data = changed(self.seeds[kind], number)
            if kind == LOG:
                exchange._log(data)
            elif kind == "part":
                exchange.hear_line(SENDER, data)
            else:
                self.member._hear(Hint(SENDER, kind, data))
        for origin, lines in before.items():
            assert log.known[origin].lines[: len(lines)] == lines

    def lines(self, count, first=0):
        """So many logs that are chained as they should be, of records that are not as they should be."""
        for number in range(first, first + count):
            origin, chain, lines = Origin(SENDER, f"{number:08x}"), b"", []
            header = {"log": "maipp.fleet/1", **origin._asdict(), "mission": self.mission}
            rng = random.Random(number)
            text = json.dumps(nasty(rng.choice(self.records[1:]), rng))
            record = json.loads(text.replace("01234561", origin.incarnation))
            for seq, each in enumerate((header, {key: record[key] for key in record if key not in ("seq", "sum")})):
                try:
                    line, chain = link(chain, seq, each)
                except ValueError:  # numbers that are none, which no writer writes
                    break
                lines.append(line)
            self.member.exchange.hear_line(SENDER, encode_part(LogSegment(origin, 0, lines, b"")))
            log = self.robot.logs.known
            if len(log) > 1000:
                for each in [each for each in log if each not in (self.robot.origin, self.other.origin)]:
                    del log[each]

    def works(self):
        """The robot still measures and decides."""
        before = self.robot.logs.length(self.robot.origin)
        self.robot.vehicle.measures(0.0)
        self.robot.vehicle.arrives()
        self.robot.measure()
        self.robot.decide()
        return self.robot.logs.length(self.robot.origin) == before + 2 and self.robot.answer["answer"] in ("go", "stop")


def main():
    """Run them from the command line."""
    from tests.fleet.conftest import Team

    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0)
    told = parser.parse_args()
    victim = Victim(Team(schedules.SCENARIO, ("greedy", {})))
    # Of the records many are right in the end, and what they measure is taken over; a robot with 10,000 is slow.
    for what, count in ((victim.readers, told.count), (victim.hear, told.count), (victim.lines, told.count // 10)):
        begun = time.monotonic()
        what(count, told.first)
        print(f"{what.__name__}: {count} malformed, {time.monotonic() - begun:.0f} s", flush=True)
    assert victim.works()
    print(f"{victim.member.exchange.refused} refused and {len(victim.told)} told; the robot goes on")


if __name__ == "__main__":
    main()
