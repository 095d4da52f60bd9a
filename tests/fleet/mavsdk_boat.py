"""A boat of MAVSDK's server components, an implementation of MAVLink that is not ours: `python mavsdk_boat.py PORT`.

It sends to that port of this computer, holds at 10 E, 0 N until it is put into its mission mode, and then goes along
what was uploaded to it. What happens is told as JSON lines. It ends with its standard input.
"""

import contextlib
import json
import math
import os
import sys
import threading
import time

from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.action_server import ActionServer, AllowableFlightModes, FlightMode
from mavsdk.plugins.mission_raw_server import MissionRawServer
from mavsdk.plugins.telemetry_server import Heading, Position, TelemetryServer, VelocityNed

METRE = 1 / 111_320.0  # degrees of latitude
TICK = 0.05  # s


class Boat:
    """What it does."""

    def __init__(self):
        self.x, self.y, self.speed = 10.0, 0.0, 1.0
        self.mode, self.mission, self.item = FlightMode.HOLD, [], 0

    def tell(self, what, **more):
        print(json.dumps({"what": what, "x": self.x, "y": self.y} | more), flush=True)

    def on_mission(self, result, plan, _):
        self.mission, self.item = plan.mission_items, 0
        items = [[item.command, item.x / 1e7, item.y / 1e7] for item in self.mission]
        self.tell("mission", result=result.name, items=items)

    def on_current(self, item, _):
        self.item = item.seq
        self.tell("current", item=item.seq)

    def on_clear(self, *_):
        self.mission, self.item = [], 0
        self.tell("clear")

    def on_mode(self, result, mode, _):
        """MAVSDK denies HOLD by itself, and leaves it to the vehicle."""
        self.mode = mode
        self.tell("mode", mode=mode.name, result=result.name)

    def travel(self, way):
        """Whether the current item is done."""
        if self.mode != FlightMode.MISSION or not 0 <= self.item < len(self.mission):
            return False
        item = self.mission[self.item]
        if item.command == 178:
            self.speed = item.param2
            return True
        east, north = (item.y / 1e7 - self.x) / METRE, (item.x / 1e7 - self.y) / METRE
        gap = math.hypot(east, north)
        share = min(way / gap, 1.0) if gap > 0 else 1.0
        self.x, self.y = self.x + share * east * METRE, self.y + share * north * METRE
        return share == 1.0


def main(port):
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
    boat = Boat()
    with Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT)) as mavsdk:
        mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")
        server = mavsdk.server_component()
        missions, telemetry, actions = MissionRawServer(server), TelemetryServer(server), ActionServer(server)
        missions.subscribe_incoming_mission(boat.on_mission)
        missions.subscribe_current_item_changed(boat.on_current)
        missions.subscribe_clear_all(boat.on_clear)
        actions.subscribe_flight_mode_change(boat.on_mode)
        actions.set_allowable_flight_modes(AllowableFlightModes(True, True, True))
        actions.set_armable(True, True)
        actions.set_armed_state(True)
        actions.set_flight_mode_internal(FlightMode.HOLD)
        boat.tell("ready")
        shown = boat.mode
        while True:
            time.sleep(TICK)
            if boat.mode != shown:
                shown = boat.mode
                actions.set_flight_mode_internal(shown)
            if boat.travel(boat.speed * TICK):
                done, boat.item = boat.item, boat.item + 1
                boat.tell("reached", item=done)
                missions.set_current_item_complete()
            with contextlib.suppress(Exception):  # nobody is connected yet
                position = Position(boat.y, boat.x, 0.0, 0.0)
                telemetry.publish_position(position, VelocityNed(0.0, 0.0, 0.0), Heading(0.0))


if __name__ == "__main__":
    main(int(sys.argv[1]))
