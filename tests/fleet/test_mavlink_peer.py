"""The MAVLink vehicle against MAVSDK's server components, over UDP on this computer and a proxy that loses and doubles.

MAVSDK's side is a process of its own (`mavsdk_boat.py`): mission, mode and position are its C++, not ours.
"""

import json
import random
import select
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from maipp.errors import InputError
from maipp.fleet.clock import WallClock
from maipp.fleet.mavlink import make, making
from maipp.fleet.mavlink.link import MavlinkConnection
from maipp.fleet.vehicle import Reached, Reading
from maipp.fleet.vehicles import VehicleContext
from maipp.live.team import TeamSurvey
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey
from tests.fleet.bridge import Source

LOSS, DOUBLE = 0.1, 0.1
METRE = 1 / 111_320.0
AREA = [[9.998, -0.002], [10.002, -0.002], [10.002, 0.002], [9.998, 0.002]]
MISSION = f"""
name: square
area: {{type: Polygon, coordinates: [{AREA}]}}
robots:
  - {{name: boat-1, start: [10, 0], speed: 25, budget_m: 1500}}
measurement_spacing_m: 20
kernel: {{length_scale_m: 100, mean: 10, std: 4}}
noise: 0.4
planner: shared-greedy
vehicle: {{kind: boat, autopilot: px4}}
scenario: {{grid: 10, nodes: 40, neighbours: 6}}
"""


@pytest.fixture(scope="module")
def mission():
    return prepare(parse_survey(MISSION, source="mission.yaml"))


@contextmanager
def proxy(loss, double, seed):
    """Ports of the vehicle's side and of ours, between which datagrams get lost and doubled."""
    chance, ended = random.Random(seed), threading.Event()
    with socket.socket(type=socket.SOCK_DGRAM) as far, socket.socket(type=socket.SOCK_DGRAM) as near:
        for side in (far, near):
            side.bind(("127.0.0.1", 0))
        with socket.socket(type=socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            ours = free.getsockname()[1]
        peers: dict[Any, Any] = {near: ("127.0.0.1", ours)}

        def run():
            while not ended.is_set():
                for side in select.select([far, near], [], [], 0.05)[0]:
                    data, peer = side.recvfrom(4096)
                    peers.setdefault(side, peer)
                    other = near if side is far else far
                    for _ in range(1 + (chance.random() < double)):
                        if other in peers and chance.random() >= loss:
                            other.sendto(data, peers[other])

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield far.getsockname()[1], ours
        finally:
            ended.set()
            thread.join()


class Peer:
    """MAVSDK's process, and what it tells."""

    def __init__(self, port):
        script = Path(__file__).with_name("mavsdk_boat.py")
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self.process = subprocess.Popen([sys.executable, str(script), str(port)], **pipes)  # pyright: ignore
        self.told: list[dict[str, Any]] = []
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith(b"{"):  # MAVSDK's own notes are between
                self.told.append(json.loads(line))

    def last(self, what):
        """What it told last of that."""
        return [told for told in self.told if told["what"] == what][-1]

    def end(self):
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()


def place_of(mission, folder, told):
    survey = cast(TeamSurvey, TeamSurvey.from_prepared(mission, seed=5, epoch=time.time() - 100.0))
    return VehicleContext("boat-1", survey, mission, folder, WallClock(survey.setup.units.epoch), 5, told.append)


def degrees(*points):
    return [(10.0 + east * METRE, north * METRE) for east, north in points]


def drive(vehicle, until, seconds=25.0) -> list[Any]:
    """What is reported until something is so; fails after some seconds."""
    reports, end = [], time.monotonic() + seconds
    while not until(reports):
        assert time.monotonic() < end, (vehicle.course.state, reports)
        time.sleep(0.02)
        reports += vehicle.poll()
    return reports


def arrived(reports):
    return bool(reports) and isinstance(reports[-1], Reached)


def test_upload_reached_hold_and_home_with_mavsdk(mission, tmp_path, monkeypatch):
    pytest.importorskip("mavsdk", reason="MAVSDK (pip install mavsdk) is not here")
    source, told = Source(), []
    monkeypatch.setattr(making, "LineInput", lambda: source)
    with proxy(LOSS, DOUBLE, seed=1) as (far, ours):
        peer = Peer(far)
        vehicle = None
        try:
            place = place_of(mission, tmp_path, told)
            options = {"url": f"udpin:127.0.0.1:{ours}", "sensor": "lines", "wait": "20", "radius": "3", "age": "60"}
            vehicle = make(place, options)
            assert vehicle.where().position == pytest.approx((10.0, 0.0), abs=1e-6)
            source.waiting += [(1, b'{"value": 3.5}'), (2, b'{"worth": 3.5}')]
            way = degrees((30.0, 0.0), (30.0, 30.0))
            vehicle.go(way, degrees((20.0, 0.0), (30.0, 10.0)))
            source.waiting += [(3, b'{"value": 3.75}')]
            *readings, reached = drive(vehicle, arrived)
            items = peer.last("mission")["items"]
            assert items[0][0] == 178 and [item[0] for item in items[1:]] == [16, 16]
            assert [(y, x) for _, x, y in items[1:]] == [pytest.approx(point, abs=1e-7) for point in way]
            # Positions come 20 times a second, at 25 m/s, and some get lost: the radius, and 5 m.
            assert np.hypot(*(np.array(reached.position) - way[-1])) / METRE < 8.0
            assert [type(reading) for reading in readings] == [Reading, Reading]
            assert [reading.value for reading in readings] == [3.75, 3.75]
            assert told[0].startswith("standard input, line 2: ") and '"value"' in told[0]
            drive(vehicle, lambda _: peer.last("mode")["mode"] == "HOLD")

            vehicle.go(degrees((30.0, 210.0)), [])  # some 7 s
            drive(vehicle, lambda _: peer.last("mode")["mode"] == "MISSION")
            drive(vehicle, lambda _: vehicle.where().position[1] > 50 * METRE)
            vehicle.hold()
            drive(vehicle, lambda _: peer.last("mode")["mode"] == "HOLD")
            assert 50 < peer.last("mode")["y"] / METRE < 209 and vehicle.poll() == []

            vehicle.go(degrees((0.0, 30.0), (0.0, 0.0)), [], home=True)
            reached = drive(vehicle, arrived)[-1]
            assert [item[0] for item in peer.last("mission")["items"]] == [178, 16, 16]  # no return to launch
            assert np.hypot(*(np.array(reached.position) - (10.0, 0.0))) / METRE < 8.0
            vehicle.close()
            assert peer.process.poll() is None
        finally:
            if vehicle is not None:
                vehicle.close()
            peer.end()


def heard_within(link, seconds, kind="HEARTBEAT"):
    """Whether such a message comes."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if any(heard.message.get_type() == kind for heard in link.take()):
            return True
        time.sleep(0.01)
    return False


def test_a_connection_that_is_closed_is_made_again_and_noise_is_left_out():
    beat = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    text = beat.heartbeat_encode(11, 12, 129, 0, 4).pack(beat)
    noise = random.Random(3).randbytes(20_000) + b"\xfd\x09" + text
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(10)
        link = MavlinkConnection(f"tcp:127.0.0.1:{server.getsockname()[1]}", 57600, 245, time.time)
        try:
            for _ in range(2):
                peer, _ = server.accept()
                with peer:
                    peer.sendall(noise + 3 * text)
                    assert heard_within(link, 5)
                    assert peer.recv(100)  # our own heartbeats
        finally:
            link.close()
    assert not link._thread.is_alive()


def test_nobody_there_is_told_in_one_line(mission, tmp_path):
    place = place_of(mission, tmp_path, [])
    with socket.socket(type=socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match=f"--with url=udpin:127.0.0.1:{port}: no autopilot: nothing heard"):
        make(place, {"url": f"udpin:127.0.0.1:{port}", "wait": "0.2"})
    assert not [thread for thread in threading.enumerate() if thread.name == "mavlink"]


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"url": "nonsense:1:2:3"}, "--with url=nonsense:1:2:3: cannot be opened"),
        ({"url": "/dev/no-such-cable"}, "--with url=/dev/no-such-cable: cannot be opened"),
        ({"colour": "red"}, "--with colour: not known; there is url, baud"),
        ({"margin": "-1"}, "--with margin=-1: give a number above 0"),
        ({"wait": "nan"}, "--with wait=nan"),
        ({"system": "300"}, "--with system=300: give a whole number from 0 to 255"),
        ({"source": "0"}, "--with source=0: give a whole number from 1 to 255"),
        ({"hold": "RTL"}, "--with hold=RTL: no mode of PX4 to hold in"),
    ],
)
def test_options_that_make_no_sense_are_refused(mission, tmp_path, options, problem):
    with pytest.raises(InputError, match=problem):
        make(place_of(mission, tmp_path, []), options)


def test_a_place_in_metres_is_refused(tmp_path, mission):
    from dataclasses import replace

    from tests.surveys.conftest import SQUARE

    square = prepare(parse_survey(SQUARE, source="mission.yaml"))
    place = place_of(mission, tmp_path, [])
    for other in (square, None):
        with pytest.raises(InputError, match="--vehicle mavlink: needs longitudes and latitudes"):
            make(replace(place, mission=other), {})


def test_without_the_extra_that_is_told(tmp_path, mission, monkeypatch):
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    with pytest.raises(InputError, match=r"--vehicle mavlink needs pymavlink: pip install 'maipp\[mavlink\]'"):
        make(place_of(mission, tmp_path, []), {})


def test_every_option_is_in_the_page_that_the_maker_names():
    page = Path(__file__).parents[2] / "docs" / "vehicles.md"
    assert "docs/vehicles.md" in (make.__doc__ or "")
    assert [key for key in making.OPTIONS if f"`{key}" not in page.read_text(encoding="utf-8")] == []
